use crate::SlamConfig;
use crate::active_submap::PatchPoints;
use crate::front_end::FrontEnd;
use crate::loop_closing::{Closure, LoopCloser};
use crate::refit::{optimise, refit, relation, relocalise};
use geometry::Pose2;
use manifold::{Manifold, PatchId, Provenance};
use matching::{FastMatcher, LinePoint, line_points};
use optimizer::Kernel;
use sensing::Observation;

/// Where a scan was taken: a pose relative to a patch, so that it moves with the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanPose {
    /// The patch.
    pub patch: PatchId,
    /// The robot's base seen from the patch.
    pub patch_from_base: Pose2,
}

/// One map from a stream of observations.
pub struct Mapper {
    config: SlamConfig,
    front_end: FrontEnd,
    closer: LoopCloser,
    manifold: Manifold,
    points: PatchPoints,
    scans: Vec<ScanPose>,
    scan_points: Vec<Vec<LinePoint>>,
    odometry: Vec<Option<Pose2>>,
    scan_odometry: Vec<Option<Pose2>>,
    driven: f64,
    drivens: Vec<(f64, f64)>,
    turned: f64,
    pub accepted: usize,
    pub optimised: usize,
    /// debug
    pub last_inliers: f64,
    pub odo: Pose2, pub last: Option<matching::MatchResult>, last_odo: Pose2,
}

impl Mapper {
    /// An empty map.
    pub fn new(config: SlamConfig) -> Self {
        let matcher = FastMatcher { settings: config.matcher };
        Mapper {
            config,
            front_end: FrontEnd::new(config),
            closer: LoopCloser::new(config.closing, config.submap, config.field, matcher),
            manifold: Manifold::new(),
            points: Vec::new(),
            scans: Vec::new(),
            scan_points: Vec::new(),
            odometry: Vec::new(), scan_odometry: Vec::new(), driven: 0.0, turned: 0.0, drivens: Vec::new(),
            accepted: 0,
            optimised: 0,
            last_inliers: 1.0, odo: Pose2::IDENTITY, last: None, last_odo: Pose2::IDENTITY,
        }
    }

    /// One observation.
    pub fn step(&mut self, observation: Observation) {
        let scan = line_points(&observation.scan, &observation.base_from_laser, &self.config.noise, &self.config.lines);
        self.scan_points.push(scan.clone());
        if let Some(o) = observation.odom_from_base { self.odo = self.last_odo.between(&o); self.last_odo = o; self.driven += self.odo.norm(); self.turned += self.odo.yaw.abs(); }
        let odometry = observation.odom_from_base.filter(|_| self.config.odometry.enabled);
        self.scan_odometry.push(odometry);
        let l = self.front_end.process(observation, scan, &mut self.manifold, &mut self.points);
        self.last = l.result;
        self.last_inliers = l.result.map_or(1.0, |r| r.inlier_ratio);
        self.scans.push(ScanPose { patch: l.patch, patch_from_base: l.patch_from_base });
        if l.is_patch { self.odometry.push(odometry); self.drivens.push((self.driven, self.turned)); }
        if l.is_patch && self.config.closing.enabled {
            self.close_loops(l.patch);
        }
    }

    fn close_loops(&mut self, patch: PatchId) {
        let found = self.closer.search(patch, &self.manifold, &self.points);
        let mut moved = false;
        for closure in found {
            let consistent = |a: &Closure| {
                let m = &self.manifold;
                let seq = m.patch(a.to).island_from_patch.between(&m.patch(closure.to).island_from_patch);
                let old = m.patch(a.from).island_from_patch.between(&m.patch(closure.from).island_from_patch);
                let via = a.result.pose.inverse() * old * closure.result.pose;
                let e = seq.between(&via);
                e.norm() < 0.15 + 0.02 * seq.norm() && e.yaw.abs() < 0.04
            };
            let small = closure.surprise < 12.0 && closure.shift.norm() < 0.5;
            let support = self.closer.pending.iter().filter(|a| a.to != closure.to && consistent(a)).count();
            if std::env::var("V").is_ok() {
                eprintln!("closure {}->{} share {:.2} surprise {:.1} shift {:.2} {:.2} support {}", closure.from.0, closure.to.0, closure.result.inlier_ratio, closure.surprise, closure.shift.norm(), closure.shift.yaw, support);
            }
            self.closer.pending.push(closure);
            if small || support >= 2 {
                let accept: Vec<Closure> = if small { vec![closure] } else {
                    self.closer.pending.iter().copied().filter(|a| a.to == closure.to || consistent(a)).collect()
                };
                for c in accept {
                    let mut covariance = c.result.covariance * 4.0;
                    let f = &self.config.closing;
                    covariance[(0, 0)] += f.floor_t * f.floor_t; covariance[(1, 1)] += f.floor_t * f.floor_t; covariance[(2, 2)] += f.floor_r * f.floor_r;
                    self.manifold.relate(c.from, c.to, relation(c.result.pose, covariance), Provenance::LoopClosure);
                    self.accepted += 1;
                }
                self.closer.pending.retain(|a| a.to.0 + 60 > patch.0 && !small);
                moved |= closure.shift.norm() > 0.05 || closure.shift.yaw.abs() > 0.01;
            }
        }
        if moved {
            self.optimised += 1;
            optimise(&mut self.manifold, Kernel::Cauchy { scale: 3.0 });
            self.front_end.relocate(&self.manifold, &self.points, patch);
        }
    }

    /// The global pass.
    pub fn finish(&mut self) {
        let matcher = FastMatcher { settings: self.config.matcher };
        let t = std::time::Instant::now();
        if self.config.closing.enabled { optimise(&mut self.manifold, Kernel::Cauchy { scale: 3.0 }); }
        let t1 = t.elapsed();
        let mut odo = Vec::new();
        let o = self.config.odometry;
        for k in 1..self.odometry.len() {
            if let (Some(a), Some(b)) = (self.odometry[k - 1], self.odometry[k]) {
                let (d, t) = (self.drivens[k].0 - self.drivens[k - 1].0, self.drivens[k].1 - self.drivens[k - 1].1);
                let st = o.translation_floor_m + o.translation_per_m * d + o.translation_per_rad_m * t;
                let sr = o.rotation_floor_rad + o.rotation_per_m_rad * d + o.rotation_per_rad * t;
                odo.push((k as u32, a.between(&b), o.refit_weight * st.powi(-2), o.refit_weight * sr.powi(-2)));
            }
        }
        refit(&mut self.manifold, &odo, &self.points, self.config.field, &matcher, &self.config.refit);
        let t2 = t.elapsed();
        relocalise(&self.manifold, &self.points, &mut self.scans, &self.scan_points, self.config.field, &matcher, &self.config.refit, &self.scan_odometry, &self.config.odometry);
        eprintln!("   opt {:?} refit {:?} relocalise {:?}", t1, t2 - t1, t.elapsed() - t2);
    }

    /// The map.
    pub fn manifold(&self) -> &Manifold {
        &self.manifold
    }

    /// Base pose of every scan in the map's frame, in the order of the observations.
    pub fn trajectory(&self) -> Vec<Pose2> {
        let pose = |s: &ScanPose| self.manifold.patch(s.patch).island_from_patch * s.patch_from_base;
        self.scans.iter().map(pose).collect()
    }
    pub fn tried(&self) -> usize { self.closer.tried }
}
