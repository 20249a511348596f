//! Scratch: map a log and score it.
use geometry::Pose2;
use manifoldslam_slam::*;
use sensing::*;
use std::io::Read;
use std::time::Instant;

pub struct Rel { pub a: i64, pub b: i64, pub d: Pose2 }

pub fn load(path: &str) -> (Vec<Observation>, Vec<i64>) {
    let data = std::process::Command::new("bzcat").arg(path).output().unwrap().stdout;
    let text = String::from_utf8(data).unwrap();
    let mut out = vec![]; let mut keys = vec![];
    for l in text.lines() {
        if !l.starts_with("FLASER") { continue }
        let f: Vec<&str> = l.split_ascii_whitespace().collect();
        let n: usize = f[1].parse().unwrap();
        let r: Vec<f32> = f[2..2+n].iter().map(|v| v.parse().unwrap()).collect();
        let v: Vec<f64> = f[2+n..2+n+7].iter().map(|v| v.parse().unwrap()).collect();
        let laser = Pose2::new(v[0], v[1], v[2]); let base = Pose2::new(v[3], v[4], v[5]);
        out.push(Observation { robot: RobotId(0), stamp: Stamp::from_secs(v[6]), odom_from_base: Some(base),
            base_from_laser: base.between(&laser), scan: Scan::classify(LaserModel::half_circle(n as u32), &r) });
        keys.push((v[6]*1e4).round() as i64);
    }
    (out, keys)
}
pub fn relations(path: &str) -> Vec<Rel> {
    let mut t = String::new(); std::fs::File::open(path).unwrap().read_to_string(&mut t).unwrap();
    t.lines().filter_map(|l| { let v: Vec<f64> = l.split_ascii_whitespace().map(|x| x.parse().unwrap()).collect();
        if v.len()<8 {return None} Some(Rel{a:(v[0]*1e4).round() as i64,b:(v[1]*1e4).round() as i64,d:Pose2::new(v[2],v[3],v[7])}) }).collect()
}
pub fn score(keys:&[i64], traj:&[Pose2], rels:&[Rel]) -> String {
    let mut m = std::collections::HashMap::new();
    for (k,p) in keys.iter().zip(traj) { m.entry(*k).or_insert(*p); }
    let at=|k:i64| [0,-1,1].iter().find_map(|d| m.get(&(k+d)));
    let mut t=vec![]; let mut r=vec![];
    let mut worst=vec![];
    for q in rels { let (Some(a),Some(b))=(at(q.a),at(q.b)) else {continue};
        let e=q.d.between(&a.between(b));
        t.push(e.norm()); r.push(e.yaw.abs().to_degrees()); let ix=|k:i64| keys.iter().position(|x| (x-k).abs()<=1).unwrap_or(99999); worst.push((e.norm(), q.d.norm(), ix(q.a) as f64, ix(q.b) as f64)); }
    let n=t.len() as f64; let mean=|v:&[f64]| v.iter().sum::<f64>()/n;
    let (tm,rm)=(mean(&t),mean(&r));
    t.sort_by(f64::total_cmp); r.sort_by(f64::total_cmp);
    let i=(t.len()-1) as f64;
    if std::env::var("WORST").is_ok() { worst.sort_by(|a,b| b.0.total_cmp(&a.0)); for w in &worst[..10] { println!("   err {:.3} d {:.2} t {:.1} {:.1}", w.0,w.1,w.2,w.3);} }
    format!("{}/{} trans {:.4} rot {:.3}  median {:.4}/{:.3} p95 {:.4}/{:.3} max {:.3}", t.len(), rels.len(), tm, rm, t[(0.5*i) as usize], r[(0.5*i) as usize], t[(0.95*i) as usize], r[(0.95*i) as usize], t[t.len()-1])
}
fn main() {
    let odo = std::env::args().nth(1).as_deref() != Some("off");
    for name in std::env::var("LOGS").unwrap_or("intel aces mit-csail".into()).split(' ') {
        let base=format!("../shared/data/laser-logs/{name}");
        let (obs,keys)=load(&format!("{base}.clf.bz2")); let rels=relations(&format!("{base}.relations"));
        let mut config=SlamConfig::default(); config.odometry.enabled=odo;
        if let Ok(t)=std::env::var("CONF") { for kv in t.split(',') { let (k,v)=kv.split_once('=').unwrap(); set(&mut config,k,v.parse().unwrap()); } }
        let t0=Instant::now();
        let mut m=Mapper::new(config);
        for (i,o) in obs.into_iter().enumerate() { m.step(o); if let Ok(d)=std::env::var("DBG") { let (a,b)=d.split_once('-').unwrap(); let (a,b):(usize,usize)=(a.parse().unwrap(),b.parse().unwrap()); if i>=a && i<=b { let r=m.last.unwrap(); let t=m.trajectory(); let d=t[i-1].between(&t[i]); let inf=r.covariance.try_inverse().unwrap(); println!("  {i} motion {:.3} {:.3} {:.4} odo {:.3} {:.3} {:.4} inl {:.2} it {} info {:.0} {:.0} {:.0} sig {:.4} {:.4} {:.5} ", d.x,d.y,d.yaw,m.odo.x,m.odo.y,m.odo.yaw,r.inlier_ratio,r.iterations,inf[(0,0)],inf[(1,1)],inf[(2,2)],r.covariance[(0,0)].sqrt(),r.covariance[(1,1)].sqrt(),r.covariance[(2,2)].sqrt()); } } if std::env::var("LOW").is_ok() { let r=m.last_inliers; if r<0.5 { println!("  low {i} {r:.2}"); } } }
        let dt=t0.elapsed().as_secs_f64();
        println!("{name:10} front {:.3}s patches {} tried {} accepted {} opts {} {}", dt, m.manifold().patches().len(), m.tried(), m.accepted, m.optimised, score(&keys,&m.trajectory(),&rels));
        let dt = { let t=Instant::now(); m.finish(); t.elapsed().as_secs_f64() };
        println!("{name:10} final {:.3}s patches {} {}", dt, m.manifold().patches().len(), score(&keys,&m.trajectory(),&rels));
    }
}
fn set(c:&mut SlamConfig,k:&str,v:f64){ match k {
    "cell"=>c.field.cell_m=v as f32,"reach"=>c.field.reach_m=v as f32,"rough"=>c.field.roughness_m=v as f32,
    "range"=>c.noise.range_std_m=v as f32,"bear"=>c.noise.bearing_std_rad=v as f32,"kend"=>c.matcher.kernel_end_m=v as f32,"kstart"=>c.matcher.kernel_start_m=v as f32,"decay"=>c.matcher.kernel_decay=v as f32,
    "ext_d"=>c.extension.distance_m=v,"ext_t"=>c.extension.turn_rad=v,"expl"=>c.extension.explained=v,"ext_i"=>c.extension.translation_m=v,"ext_r"=>c.extension.rotation_rad=v,
    "sub_d"=>c.submap.distance_m=v,"sub_n"=>c.submap.patches=v as usize,"sub_t"=>c.submap.translation_m=v,
    "len"=>c.lines.length_m=v,"minn"=>c.lines.min_neighbours=v as usize,"maxn"=>c.lines.max_neighbours=v as usize,"straight"=>c.lines.straight_m=v,"smooth"=>c.lines.smooth=v,"jump"=>c.lines.jump_ratio=v,"jm"=>c.lines.jump_m=v,
    "close"=>c.closing.enabled=v>0.5,"share"=>c.closing.share=v,"every"=>c.closing.every_m=v,"cands"=>c.closing.candidates=v as usize,"ft"=>c.closing.floor_t=v,"fr"=>c.closing.floor_r=v,"creach"=>c.closing.reach_m=v,
    "rounds"=>c.refit.rounds=v as usize,"od"=>c.refit.overlap_distance_m=v,"on"=>c.refit.overlaps_per_patch=v as usize,"os"=>c.refit.overlap_share=v,"rk"=>c.refit.kernel_m=v,"oi"=>c.refit.overlap_inflation=v,"si"=>c.refit.seq_inflation=v,"cm"=>c.refit.cluster_m=v,"cr"=>c.refit.cluster_reach_m=v,
    "ncos"=>c.matcher.normal_cos=v as f32,
    "opm"=>c.odometry.translation_per_m=v,"orr"=>c.odometry.rotation_per_rad=v,"orm"=>c.odometry.rotation_per_m_rad=v,"ow"=>c.odometry.weight=v,"ro"=>c.odometry.refit_weight=v,"otr"=>c.odometry.translation_per_rad_m=v,"rp"=>c.refit.reloc_prior=v,"ui"=>c.refit.unary_inflation=v,"otf"=>c.odometry.translation_floor_m=v,"orf"=>c.odometry.rotation_floor_rad=v,
    _=>panic!("{k}") } }
