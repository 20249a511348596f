use crate::{Scan, Stamp};
use geometry::{LieGroup, Pose2, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// A robot's planar velocity in its own base frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Forward speed, metres a second.
    pub forward_m_per_sec: f64,
    /// Turning rate, counter-clockwise, radians a second.
    pub yaw_rad_per_sec: f64,
}

impl Twist {
    /// The motion in the base frame after `secs` of constant velocity: an arc.
    pub fn motion(&self, secs: f64) -> Pose2 {
        Pose2::exp(&Vector3::new(self.forward_m_per_sec * secs, 0.0, self.yaw_rad_per_sec * secs))
    }
}

/// Whether and how scans are corrected for the robot's motion during a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DeskewSettings {
    /// Time from the first beam to the last, seconds; 0, which logs that do not tell it call for,
    /// takes scans as taken at once. A scanner at 10 Hz takes up to 0.1, a SICK LMS 0.0067.
    pub sweep_secs: f64,
    /// Which moment of the sweep the log's stamp and pose belong to: 0 the first beam, 1 the last.
    pub reference: f64,
}

impl Default for DeskewSettings {
    fn default() -> Self {
        DeskewSettings { sweep_secs: 0.0, reference: 0.5 }
    }
}

impl DeskewSettings {
    /// The sweep of a scan taken at a velocity; `None` when scans are taken as they are.
    pub fn sweep(&self, twist: Option<Twist>) -> Option<Sweep> {
        let duration_secs = Some(self.sweep_secs).filter(|secs| *secs > 0.0)?;
        Some(Sweep { twist: twist?, duration_secs, reference: self.reference })
    }
}

/// Velocities from the odometry of successive scans, for logs that do not tell them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Velocimeter {
    last: Option<(Stamp, Pose2)>,
}

impl Velocimeter {
    /// Velocity up to this scan. `None` for the first scan, without odometry, and where stamps or
    /// odometry jump.
    pub fn observe(&mut self, stamp: Stamp, odom_from_base: Option<Pose2>) -> Option<Twist> {
        let now = odom_from_base.map(|pose| (stamp, pose));
        let (before, after) = std::mem::replace(&mut self.last, now).zip(now)?;
        let secs = after.0.secs_since(before.0);
        if !(SHORTEST_SECS..LONGEST_SECS).contains(&secs) {
            return None;
        }
        let motion = before.1.between(&after.1).log() / secs;
        let twist = Twist { forward_m_per_sec: motion.x, yaw_rad_per_sec: motion.z };
        (motion.x.abs() < FASTEST_M_PER_SEC && motion.z.abs() < FASTEST_RAD_PER_SEC)
            .then_some(twist)
    }
}

/// Times between scans that velocities are told from, seconds.
const SHORTEST_SECS: f64 = 0.005;
const LONGEST_SECS: f64 = 1.0;
/// Faster than this odometry has jumped.
const FASTEST_M_PER_SEC: f64 = 10.0;
const FASTEST_RAD_PER_SEC: f64 = 10.0;

/// A sweep taken while the robot moved: beams are measured one after the other, from the first to
/// the last in `duration_secs`, at constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Velocity of the base during the sweep.
    pub twist: Twist,
    /// Time from the first to the last beam, seconds.
    pub duration_secs: f64,
    /// Where in the sweep the scan's pose belongs: 0 at the first beam, 1 at the last.
    pub reference: f64,
}

/// One hit of a moving scanner, in the base frame at the sweep's reference time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeskewedHit {
    /// Index of the beam in its scan.
    pub beam: u32,
    /// Where the laser was when it measured the beam, metres.
    pub origin: Vector2<f64>,
    /// Where the beam hit, metres.
    pub endpoint: Vector2<f64>,
}

impl Sweep {
    /// `reference_from_beam`: the base frame at the time of beam `index` of `beams`, seen from the
    /// base frame at the reference time.
    pub fn reference_from_beam(&self, index: usize, beams: usize) -> Pose2 {
        let progress = if beams > 1 { index as f64 / (beams - 1) as f64 } else { self.reference };
        self.twist.motion((progress - self.reference) * self.duration_secs)
    }

    /// The scan's hits as one rigid picture at the reference time: each beam starts where the laser
    /// was when it was measured.
    pub fn deskew(&self, scan: &Scan, base_from_laser: &Pose2) -> Vec<DeskewedHit> {
        (0..scan.len())
            .filter_map(|i| {
                let range = f64::from(scan.hit(i)?);
                let (sin, cos) = scan.laser().bearing(i).sin_cos();
                let reference_from_laser =
                    self.reference_from_beam(i, scan.len()) * *base_from_laser;
                Some(DeskewedHit {
                    beam: i as u32,
                    origin: reference_from_laser.translation(),
                    endpoint: reference_from_laser.transform(Vector2::new(cos, sin) * range),
                })
            })
            .collect()
    }
}
