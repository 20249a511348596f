//! Scratch: map a log and score it.
use geometry::Pose2;
use manifoldslam_slam::*;
use sensing::*;
use std::io::Read;
use std::time::Instant;

pub struct Rel {
    pub a: i64,
    pub b: i64,
    pub d: Pose2,
}

pub fn load(path: &str) -> (Vec<Observation>, Vec<i64>) {
    let data = std::process::Command::new("bzcat").arg(path).output().unwrap().stdout;
    let text = String::from_utf8(data).unwrap();
    let mut out = vec![];
    let mut keys = vec![];
    for l in text.lines() {
        if !l.starts_with("FLASER") {
            continue;
        }
        let f: Vec<&str> = l.split_ascii_whitespace().collect();
        let n: usize = f[1].parse().unwrap();
        let r: Vec<f32> = f[2..2 + n].iter().map(|v| v.parse().unwrap()).collect();
        let v: Vec<f64> = f[2 + n..2 + n + 7].iter().map(|v| v.parse().unwrap()).collect();
        let laser = Pose2::new(v[0], v[1], v[2]);
        let base = Pose2::new(v[3], v[4], v[5]);
        out.push(Observation {
            robot: RobotId(0),
            stamp: Stamp::from_secs(v[6]),
            odom_from_base: Some(base),
            base_from_laser: base.between(&laser),
            scan: Scan::classify(LaserModel::half_circle(n as u32), &r),
        });
        keys.push((v[6] * 1e4).round() as i64);
    }
    (out, keys)
}
pub fn relations(path: &str) -> Vec<Rel> {
    let mut t = String::new();
    std::fs::File::open(path).unwrap().read_to_string(&mut t).unwrap();
    t.lines()
        .filter_map(|l| {
            let v: Vec<f64> = l.split_ascii_whitespace().map(|x| x.parse().unwrap()).collect();
            if v.len() < 8 {
                return None;
            }
            Some(Rel {
                a: (v[0] * 1e4).round() as i64,
                b: (v[1] * 1e4).round() as i64,
                d: Pose2::new(v[2], v[3], v[7]),
            })
        })
        .collect()
}
pub fn score(keys: &[i64], traj: &[Pose2], rels: &[Rel]) -> String {
    let mut m = std::collections::HashMap::new();
    for (k, p) in keys.iter().zip(traj) {
        m.entry(*k).or_insert(*p);
    }
    let at = |k: i64| [0, -1, 1].iter().find_map(|d| m.get(&(k + d)));
    let mut t = vec![];
    let mut r = vec![];
    let mut worst = vec![];
    for q in rels {
        let (Some(a), Some(b)) = (at(q.a), at(q.b)) else { continue };
        let e = q.d.between(&a.between(b));
        t.push(e.norm());
        r.push(e.yaw.abs().to_degrees());
        let ix = |k: i64| keys.iter().position(|x| (x - k).abs() <= 1).unwrap_or(99999);
        worst.push((e.norm(), q.d.norm(), ix(q.a) as f64, ix(q.b) as f64));
    }
    let n = t.len() as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let (tm, rm) = (mean(&t), mean(&r));
    t.sort_by(f64::total_cmp);
    r.sort_by(f64::total_cmp);
    let i = (t.len() - 1) as f64;
    if std::env::var("WORST").is_ok() {
        worst.sort_by(|a, b| b.0.total_cmp(&a.0));
        for w in &worst[..10] {
            println!("   err {:.3} d {:.2} t {:.1} {:.1}", w.0, w.1, w.2, w.3);
        }
    }
    format!(
        "{}/{} trans {:.4} rot {:.3}  median {:.4}/{:.3} p95 {:.4}/{:.3} max {:.3}",
        t.len(),
        rels.len(),
        tm,
        rm,
        t[(0.5 * i) as usize],
        r[(0.5 * i) as usize],
        t[(0.95 * i) as usize],
        r[(0.95 * i) as usize],
        t[t.len() - 1]
    )
}
fn main() {
    let odo = std::env::args().nth(1).as_deref() != Some("off");
    for name in std::env::var("LOGS").unwrap_or("intel aces mit-csail".into()).split(' ') {
        let base = format!("../shared/data/laser-logs/{name}");
        let (obs, keys) = load(&format!("{base}.clf.bz2"));
        let rels = relations(&format!("{base}.relations"));
        let mut config = SlamConfig::default();
        config.odometry.enabled = odo;
        if let Ok(t) = std::env::var("CONF") {
            for kv in t.split(',') {
                let (k, v) = kv.split_once('=').unwrap();
                set(&mut config, k, v.parse().unwrap());
            }
        }
        let n = obs.len();
        let tm = std::sync::Arc::new(std::sync::Mutex::new(Default::default()));
        let t0 = Instant::now();
        let mut m = Mapper::observed(config, Box::new(Timer { open: vec![], sum: tm.clone() }));
        let reference: Vec<Pose2> = std::env::var("REF")
            .ok()
            .and_then(|d| std::fs::read_to_string(format!("{d}/{name}.traj")).ok())
            .map(|t| {
                t.lines()
                    .map(|l| {
                        let v: Vec<f64> = l.split(' ').map(|x| x.parse().unwrap()).collect();
                        Pose2::new(v[1], v[2], v[3])
                    })
                    .collect()
            })
            .unwrap_or_default();
        let mut scan_of: Vec<usize> = vec![];
        let (mut wrong, mut total) = (0, 0);
        for (i, o) in obs.into_iter().enumerate() {
            for e in m.step(o) {
                if let Event::Map(c) = e {
                    match c {
                        manifold::Change::PatchAdded(_) => scan_of.push(i),
                        manifold::Change::RelationAdded(r)
                            if r.provenance == manifold::Provenance::LoopClosure
                                && !reference.is_empty() =>
                        {
                            let (a, b) = (scan_of[r.from.index()], scan_of[r.to.index()]);
                            let t = reference[a].between(&reference[b]);
                            let e = t.between(&r.from_from_to.mean);
                            total += 1;
                            let bad = e.norm() > 0.3 || e.yaw.abs() > 0.1;
                            if bad {
                                wrong += 1;
                            }
                            if bad || std::env::var("VC").is_ok() {
                                println!(
                                    "  closure {a}->{b} err {:.2} {:.3} sig {:.3} {:.3} {:.4}",
                                    e.norm(),
                                    e.yaw,
                                    r.from_from_to.covariance[(0, 0)].sqrt(),
                                    r.from_from_to.covariance[(1, 1)].sqrt(),
                                    r.from_from_to.covariance[(2, 2)].sqrt()
                                );
                            }
                        }
                        _ => {}
                    }
                }
            }
        }
        if total > 0 {
            println!("  closures {total} wrong {wrong}");
        }
        let dt = t0.elapsed().as_secs_f64();
        println!(
            "{name:10} front {:.3}s patches {} {}",
            dt,
            m.manifold().patches().len(),
            score(&keys, &m.trajectory(), &rels)
        );
        let t1 = Instant::now();
        m.finish();
        let df = t1.elapsed().as_secs_f64();
        if std::env::var("V").is_ok() {
            println!("{name:10} {:?}", m.statistics());
            for (k, v) in tm.lock().unwrap().iter() {
                let v: &f64 = v;
                println!("    {k:?} {:.1} ms, {:.1} us/scan", v * 1e3, v * 1e6 / n as f64);
            }
        }
        let dt = df;
        if let Ok(d) = std::env::var("TRAJ") {
            let mut o = String::new();
            for (k, p) in keys.iter().zip(m.trajectory()) {
                o += &format!("{} {} {} {}\n", *k as f64 / 1e4, p.x, p.y, p.yaw);
            }
            std::fs::write(format!("{d}/{name}.traj"), o).unwrap();
        }
        println!(
            "{name:10} final {:.3}s patches {} {}",
            dt,
            m.manifold().patches().len(),
            score(&keys, &m.trajectory(), &rels)
        );
    }
}
type Sums = std::sync::Arc<std::sync::Mutex<std::collections::BTreeMap<Stage, f64>>>;
struct Timer {
    open: Vec<(f64, f64)>,
    sum: Sums,
}
fn cpu() -> (f64, f64) {
    let t = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    let main: f64 = t.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9;
    let mut all = 0.0;
    for e in std::fs::read_dir("/proc/self/task").unwrap() {
        if let Ok(t) = std::fs::read_to_string(e.unwrap().path().join("schedstat")) {
            all += t.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9;
        }
    }
    (main, all)
}
impl StageObserver for Timer {
    fn begin(&mut self, s: Stage) {
        let par = matches!(s, Stage::Refit | Stage::Relocalisation);
        self.open.push(if par {
            cpu()
        } else {
            let t = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
            (t.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9, 0.0)
        });
    }
    fn end(&mut self, s: Stage) {
        let par = matches!(s, Stage::Refit | Stage::Relocalisation);
        let t = self.open.pop().unwrap();
        let d = if par {
            cpu().1 - t.1
        } else {
            let u = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
            u.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9 - t.0
        };
        *self.sum.lock().unwrap().entry(s).or_default() += d;
    }
}
fn set(c: &mut SlamConfig, k: &str, v: f64) {
    match k {
        "cell" => c.field.cell_m = v as f32,
        "reach" => c.field.reach_m = v as f32,
        "rough" => c.field.roughness_m = v as f32,
        "range" => c.noise.range_std_m = v as f32,
        "bear" => c.noise.bearing_std_rad = v as f32,
        "kend" => c.matcher.kernel_end_m = v as f32,
        "kstart" => c.matcher.kernel_start_m = v as f32,
        "decay" => c.matcher.kernel_decay = v as f32,
        "iters" => c.matcher.max_iterations = v as u32,
        "step" => c.matcher.step_m = v as f32,
        "ext_d" => c.extension.distance_m = v,
        "ext_t" => c.extension.turn_rad = v,
        "expl" => c.extension.explained = v,
        "ext_i" => c.extension.translation_m = v,
        "ext_r" => c.extension.rotation_rad = v,
        "sub_d" => c.submap.distance_m = v,
        "sub_n" => c.submap.patches = v as usize,
        "sub_t" => c.submap.translation_m = v,
        "len" => c.lines.length_m = v,
        "minn" => c.lines.min_neighbours = v as usize,
        "maxn" => c.lines.max_neighbours = v as usize,
        "straight" => c.lines.straight_m = v,
        "smooth" => {}
        "lstd" => c.closing.largest_std_m = v,
        "caution" => c.closing.caution = v,
        "support" => c.closing.support = v as usize,
        "qd" => c.closing.query_distance_m = v,
        "qp" => c.closing.query_patches = v as usize,
        "win" => c.closing.window_m = v,
        "spacing" => c.closing.spacing_m = v,
        "rr" => c.refit.reach_m = v as f32,
        "minscore" => c.closing.min_score = v as f32,
        "maxw" => c.closing.max_windows = v as usize,
        "jump" => c.lines.jump_ratio = v,
        "jm" => c.lines.jump_m = v,
        "close" => c.closing.enabled = v > 0.5,
        "share" => c.closing.share = v,
        "every" => c.closing.every_m = v,
        "cands" => c.closing.candidates = v as usize,
        "ft" => c.relation_floor.translation_m = v,
        "fr" => c.relation_floor.rotation_rad = v,
        "creach" => c.closing.reach_m = v,
        "rival" => c.closing.rival = v,
        "through" => c.closing.seen_through = v,
        "rounds" => c.refit.rounds = v as usize,
        "od" => c.refit.overlap_distance_m = v,
        "on" => c.refit.overlaps_per_patch = v as usize,
        "os" => c.refit.overlap_share = v,
        "rk" => c.refit.kernel_start_m = v,
        "rke" => c.refit.kernel_end_m = v,
        "oi" => c.refit.overlap_sharing = v,
        "cm" => c.refit.group_radius_m = v,
        "cr" => c.refit.group_margin_m = v,
        "method" => {
            c.refit.method = if v == 0.0 {
                RefitMethod::Global
            } else if v == 1.0 {
                RefitMethod::BreadthFirst
            } else {
                RefitMethod::Relations
            }
        }
        "mc" => c.match_correlation = v,
        "otr" => c.odometry.translation_per_rad_m = v,
        "ncos" => c.matcher.normal_cos = v as f32,
        "opm" => c.odometry.translation_per_m = v,
        "orr" => c.odometry.rotation_per_rad = v,
        "orm" => c.odometry.rotation_per_m_rad = v,
        "otf" => c.odometry.translation_floor_m = v,
        "orf" => c.odometry.rotation_floor_rad = v,
        _ => panic!("{k}"),
    }
}
