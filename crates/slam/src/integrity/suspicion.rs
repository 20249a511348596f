use super::IntegritySettings;
use super::visibility::{View, Visibility};
use crate::map::{Map, same_plane};
use geometry::{Pose2, Vector2};
use manifold::PatchId;
use sensing::Scan;

/// Compares scans with what was seen before from about the same place, and suspects that the robot
/// is elsewhere when they contradict it.
#[derive(Clone, Debug)]
pub(crate) struct Suspicion {
    settings: IntegritySettings,
    /// The last patches that were not suspected.
    trusted: Vec<PatchId>,
    usual: Usual,
    case: Option<Case>,
}

/// A scan with the pose it was given.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Witness<'a> {
    pub scan: &'a Scan,
    pub island_from_base: Pose2,
    pub island_from_laser: Pose2,
    /// The patch it became.
    pub patch: Option<PatchId>,
    /// A patch on the same ground: that one, or the nearest.
    pub near: PatchId,
    /// Rise of the ground per metre along the island's axes.
    pub slope: Vector2<f64>,
    /// It did not fit where it was expected.
    pub recovered: bool,
    /// From where it was expected to where it was found.
    pub shift: Pose2,
}

/// A scan found farther than this from where it was expected is startling, metres and radians.
const SHIFT_M: f64 = 0.2;
const SHIFT_RAD: f64 = 0.3;

impl Witness<'_> {
    /// True for a scan that was not where it was expected: odometry is wrong, or the robot is
    /// elsewhere.
    fn startles(&self) -> bool {
        self.recovered || self.shift.norm() > SHIFT_M || self.shift.yaw.abs() > SHIFT_RAD
    }
}

/// An open suspicion.
#[derive(Clone, Debug)]
struct Case {
    /// Contradictions beyond this convict.
    limit: f64,
    /// Everything seen since it began, over so many scans.
    seen: Visibility,
    scans: usize,
    /// How the ground rose when it began.
    slope: Vector2<f64>,
    /// Patches made since.
    patches: Vec<PatchId>,
}

/// Mean and spread of the contradictions that are usual here.
#[derive(Clone, Copy, Debug)]
struct Usual {
    mean: f64,
    variance: f64,
}

/// A patch is compared with so many of the others, those nearest ...
const COMPARED: usize = 3;
/// ... of so many that came before it: some twenty metres.
const TRUSTED: usize = 40;
/// A radian of turn is as far as so many metres.
const METRES_PER_RADIAN: f64 = 1.0;
/// So few points say nothing.
const LEAST_POINTS: u32 = 40;
/// Share of the newest patch in what is usual.
const NEWEST: f64 = 0.1;

impl Usual {
    /// What is taken for usual before anything is known: people may be about.
    const UNKNOWN: Usual = Usual { mean: 0.0, variance: 0.01 };

    fn note(&mut self, contradiction: f64) {
        let off = contradiction - self.mean;
        self.mean += NEWEST * off;
        self.variance += NEWEST * (off * off - self.variance);
    }
}

impl Suspicion {
    pub fn new(settings: IntegritySettings) -> Self {
        Suspicion { settings, trusted: Vec::new(), usual: Usual::UNKNOWN, case: None }
    }

    /// Forgets what was seen: the robot is on a new piece of map.
    pub fn restart(&mut self) {
        self.trusted.clear();
        self.case = None;
    }

    /// True while it wants to see every scan, not only those that become patches.
    pub fn is_open(&self) -> bool {
        self.case.is_some()
    }

    /// Takes the next scan; once it is settled that the robot is lost, the number of scans for
    /// which it has been, this one included.
    pub fn watch(&mut self, witness: &Witness, map: &Map) -> Option<usize> {
        if !self.settings.enabled || (self.case.is_none() && witness.patch.is_none()) {
            return None;
        }
        let seen = self.compare(witness, map);
        let Some(case) = &mut self.case else {
            let limit = self.limit(witness.startles());
            if seen.compared() < LEAST_POINTS || seen.contradiction() <= limit {
                self.trust(witness.patch, seen);
            } else {
                let patches = witness.patch.into_iter().collect();
                self.case = Some(Case { limit, seen, scans: 1, slope: witness.slope, patches });
            }
            return None;
        };
        case.scans += 1;
        case.seen += seen;
        case.patches.extend(witness.patch);
        // Where a ramp begins the laser tips, and sees what lies at other heights.
        let tips = !same_plane(&case.slope, &witness.slope);
        if case.scans < self.settings.scans && !tips {
            return None;
        }
        let case = self.case.take()?;
        if case.seen.contradiction() > case.limit && !tips {
            return Some(case.scans);
        }
        let seen = if tips { Visibility::default() } else { case.seen };
        case.patches.into_iter().for_each(|patch| self.trust(Some(patch), seen));
        None
    }

    fn trust(&mut self, patch: Option<PatchId>, seen: Visibility) {
        self.trusted.extend(patch);
        let spare = self.trusted.len().saturating_sub(TRUSTED);
        self.trusted.drain(..spare);
        if seen.compared() >= LEAST_POINTS {
            self.usual.note(seen.contradiction());
        }
    }

    /// Contradictions beyond this are suspect.
    fn limit(&self, startled: bool) -> f64 {
        let IntegritySettings { startled: low, contradicting, sigmas, .. } = self.settings;
        let unusual = self.usual.mean + sigmas * self.usual.variance.sqrt();
        unusual.max(if startled { low } else { contradicting })
    }

    fn compare(&self, witness: &Witness, map: &Map) -> Visibility {
        let own = View { scan: witness.scan, map_from_laser: witness.island_from_laser };
        let far = |patch: &PatchId| {
            let apart = map.pose(*patch).between(&witness.island_from_base);
            apart.norm() + METRES_PER_RADIAN * apart.yaw.abs()
        };
        let comparable = |p: &&PatchId| {
            let apart = map.manifold.apart_in_height(**p, witness.near);
            !apart && map.leans_alike(**p, &witness.slope)
        };
        let trusted = self.trusted.iter().filter(comparable);
        let mut nearest: Vec<(f64, PatchId)> = trusted.map(|p| (far(p), *p)).collect();
        nearest.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut seen = Visibility::default();
        for (_, patch) in nearest.into_iter().take(COMPARED) {
            let patch = map.manifold.patch(patch);
            let map_from_laser = patch.island_from_patch * patch.base_from_laser;
            seen += Visibility::of(&own, &View { scan: &patch.scan, map_from_laser });
        }
        seen
    }
}
