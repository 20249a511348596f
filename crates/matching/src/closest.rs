//! What ICP and its descendants share: every scan point is paired with the closest reference point,
//! the worst pairs are dropped, a weighted sum of squared distances is minimised, and so on until
//! the pose settles. They differ in the weight of a pair alone: all ways alike (ICP), across the
//! reference's line (PL-ICP), or by the planes on both sides (GICP).
//!
//! Where it ends, a few steps more take the pose to its minimum by rounding: docs/math/
//! closest-points.md, "The end".

mod pairs;
mod settings;
mod slides;
mod step;
mod uncertainty;

use crate::{CloudPoint, MatchResult, MatchStatus, NeighbourTree, PointCloud, Prior};
use geometry::{LieGroup, Matrix2, Matrix3, Pose2, Vector2, Vector3};
use nalgebra::Matrix2x3;
pub(crate) use pairs::ClosestPair;
use pairs::{closest_pairs, drop_worst};
pub use settings::ClosestSettings;
use slides::Slides;
pub(crate) use step::{ARM_M, scale, weak_axis};
use step::{solve, step_length};
use uncertainty::answer;
pub(crate) use uncertainty::{RangeErrors, sliding_covariance};

/// A pose locked to a wrong turn is so many beams off at most.
const TURNS: u32 = 3;
/// Polishing steps at most; they shrink fast or not at all.
const POLISHING_STEPS: u32 = 12;
/// A polishing step shorter than this, metres, is rounding.
const POLISHED_M: f64 = 1e-10;

/// A scan at a pose with its pairs.
pub(crate) struct Linearisation {
    pub pairs: Vec<ClosestPair>,
    /// Information and gradient of half the cost, as a right perturbation in the scan's frame.
    pub h: Matrix3<f64>,
    pub g: Vector3<f64>,
    /// The same information with partners that slide along their segments as the scan moves; zero
    /// for those that do not.
    pub sliding: Matrix3<f64>,
}

impl Linearisation {
    /// The same with partners that slide, for a step.
    fn slid(&self) -> Self {
        Linearisation { pairs: Vec::new(), h: self.sliding, ..*self }
    }
}

/// The weight of a pair: the information of the distance between its points, in the reference
/// frame. `None` where the points' surfaces are not known well enough to tell.
pub(crate) trait PairWeight: Sync {
    fn of(&self, pair: &ClosestPair, rotation: &Matrix2<f64>) -> Option<Matrix2<f64>>;
}

/// What of the reference a scan point is compared with.
pub(crate) trait Correspondence: Sync {
    /// Whether partners slide along segments, and a plain step falls short of the minimum.
    const SLIDES: bool = false;
    /// The gate narrows once a step is shorter than this share of it.
    const SETTLED_SHARE: f64 = if Self::SLIDES { 0.02 } else { 0.05 };

    /// The partner of a scan point, given in the reference frame, if there is one within the gate.
    fn closest(&self, moved: &Vector2<f64>, gate_m: f64) -> Option<Partner>;
}

/// What a scan point is paired with.
pub(crate) struct Partner {
    /// Index of the reference point.
    pub index: usize,
    /// The point itself, or one on the segment that begins there.
    pub point: CloudPoint,
    /// The direction that the partner slides along when the scan point moves, of any length.
    pub along: Option<Vector2<f64>>,
}

/// The nearest of the reference's points.
pub(crate) struct NearestPoint<'a> {
    reference: &'a PointCloud,
    tree: NeighbourTree,
}

impl<'a> NearestPoint<'a> {
    pub fn of(reference: &'a PointCloud) -> Self {
        let tree = NeighbourTree::new(reference.points.iter().map(|p| p.position));
        NearestPoint { reference, tree }
    }
}

impl Correspondence for NearestPoint<'_> {
    fn closest(&self, moved: &Vector2<f64>, gate_m: f64) -> Option<Partner> {
        let (index, _) = self.tree.nearest(*moved, gate_m * gate_m)?;
        Some(Partner { index, point: self.reference.points[index], along: None })
    }
}

/// An iteration over two clouds.
pub(crate) struct ClosestPoints<'a, C, W> {
    pub settings: &'a ClosestSettings,
    pub correspondence: &'a C,
    pub weight: &'a W,
    pub scan: &'a PointCloud,
    /// A turn by which every point may have found the neighbour of its partner, and rest there:
    /// one beam, radians. Zero where partners are not single points, or weights let them slide.
    pub locked_turn_rad: f64,
}

impl<C: Correspondence, W: PairWeight> ClosestPoints<'_, C, W> {
    /// Finds `reference_from_scan`; `covariance` tells that of the outcome as a right perturbation.
    pub fn align(
        &self,
        prior: &Prior,
        covariance: impl Fn(&Linearisation, &Pose2) -> Option<Matrix3<f64>>,
    ) -> MatchResult {
        self.align_from(prior.pose, self.settings.gate_start_m, prior, covariance)
    }

    /// [`ClosestPoints::align`] from a pose that is not the prior's and a gate to begin with.
    pub fn align_from(
        &self,
        start: Pose2,
        gate_m: f64,
        prior: &Prior,
        covariance: impl Fn(&Linearisation, &Pose2) -> Option<Matrix3<f64>>,
    ) -> MatchResult {
        let (mut pose, mut iterations) = match self.settle(start, gate_m, prior) {
            Ok(settled) => settled,
            Err(failure) => return *failure,
        };
        for _ in 0..TURNS {
            let Some(turned) = self.better_turned(&pose) else { break };
            let Ok((there, more)) = self.settle(turned, self.settings.gate_end_m, prior) else {
                break;
            };
            (pose, iterations) = (there, iterations + more);
        }
        let (pose, polishing) = if C::SLIDES { self.polished(pose, prior) } else { (pose, 0) };
        self.conclude(&pose, iterations + polishing, covariance)
    }

    /// Iterates until the pose stands still at the last gate: the pose and the iterations used.
    fn settle(
        &self,
        start: Pose2,
        gate_m: f64,
        prior: &Prior,
    ) -> Result<(Pose2, u32), Box<MatchResult>> {
        let s = self.settings;
        let (mut pose, mut gate) = (start, gate_m);
        let (mut iterations, mut last_step) = (0, f64::INFINITY);
        let mut slides = Slides::default();
        while iterations < s.max_iterations && !(last_step < s.step_m && gate <= s.gate_end_m) {
            iterations += 1;
            let here = self.linearise(&pose, gate);
            let step = solve(&here, &pose, prior, s.degenerate_ratio)
                .filter(|_| here.pairs.len() >= s.min_pairs);
            let Some(mut step) = step else {
                return Err(failed(pose, iterations, MatchStatus::TooFewPoints));
            };
            if C::SLIDES && slides.wanted(&step, gate) {
                let slide = solve(&here.slid(), &pose, prior, s.degenerate_ratio);
                step = slide.and_then(|slide| slides.cut(slide, gate)).unwrap_or(step);
            }
            pose = pose.retract(&step);
            last_step = step_length(&step);
            if !pose.is_finite() || pose.distance(&prior.pose) > s.max_shift_m {
                return Err(failed(prior.pose, iterations, MatchStatus::Diverged));
            }
            if last_step < C::SETTLED_SHARE * gate {
                gate = (gate * s.gate_decay).max(s.gate_end_m);
                slides = Slides::default();
            }
        }
        // Pairs may swap for ever between two equally good sets: small steps are settled enough.
        if last_step > 0.1 * s.gate_end_m {
            return Err(failed(pose, iterations, MatchStatus::Diverged));
        }
        Ok((pose, iterations))
    }

    /// The pose turned by one beam to either side, if the scan fits better there.
    fn better_turned(&self, pose: &Pose2) -> Option<Pose2> {
        if self.locked_turn_rad == 0.0 {
            return None;
        }
        let turned = |sign: f64| pose.retract(&Vector3::new(0.0, 0.0, sign * self.locked_turn_rad));
        let misfit = |pose: &Pose2| {
            let gate = self.settings.gate_end_m;
            let pairs = self.linearise(pose, gate).pairs;
            let unpaired = self.scan.len().saturating_sub(pairs.len());
            pairs.iter().map(|pair| pair.error).sum::<f64>() + gate * gate * unpaired as f64
        };
        let here = misfit(pose);
        [1.0, -1.0].map(turned).into_iter().find(|there| misfit(there) < here)
    }

    /// The last steps, as long as they shrink by half or more: partners on a segment slide along it
    /// with the scan, and a step that knows so goes all the way where a plain one goes a part of it
    /// (Newton's method on the distance to the segment). The pose and the steps taken.
    fn polished(&self, mut pose: Pose2, prior: &Prior) -> (Pose2, u32) {
        let s = self.settings;
        let mut longest = 10.0 * s.step_m;
        for iteration in 0..POLISHING_STEPS {
            let here = self.linearise(&pose, s.gate_end_m);
            let Some(step) = solve(&here.slid(), &pose, prior, s.degenerate_ratio) else {
                return (pose, iteration);
            };
            let length = step_length(&step);
            if length > longest || length < POLISHED_M {
                return (pose, iteration);
            }
            pose = pose.retract(&step);
            longest = 0.5 * length;
        }
        (pose, POLISHING_STEPS)
    }

    fn conclude(
        &self,
        pose: &Pose2,
        iterations: u32,
        covariance: impl Fn(&Linearisation, &Pose2) -> Option<Matrix3<f64>>,
    ) -> MatchResult {
        let s = self.settings;
        let here = self.linearise(pose, s.gate_end_m);
        let inlier_ratio = here.pairs.len() as f64 / self.scan.len().max(1) as f64;
        let covariance = covariance(&here, pose).filter(|c| c.iter().all(|v| v.is_finite()));
        let Some(covariance) = covariance.filter(|_| here.pairs.len() >= s.min_pairs) else {
            return MatchResult::failed(*pose, iterations, MatchStatus::TooFewPoints);
        };
        let status = match weak_axis(&answer(&here, pose), s.degenerate_ratio) {
            _ if inlier_ratio < s.min_inlier_ratio => MatchStatus::Diverged,
            Some(weak_axis) => MatchStatus::Degenerate { weak_axis },
            None => MatchStatus::Converged,
        };
        MatchResult { pose: *pose, covariance, inlier_ratio, iterations, status }
    }

    /// Pairs the scan at a pose and sums what they say.
    fn linearise(&self, pose: &Pose2, gate_m: f64) -> Linearisation {
        let (sin, cos) = pose.yaw.sin_cos();
        let rotation = Matrix2::new(cos, -sin, sin, cos);
        let s = self.settings;
        let mut pairs = closest_pairs(self.correspondence, self.scan, pose, gate_m);
        pairs.retain_mut(|pair| {
            let agree = pair.normals_agree(&rotation, s.normal_cos);
            pair.weigh(self.weight.of(pair, &rotation).filter(|_| agree))
        });
        // While the gate is wide, the pairs that fit worst may be the only ones that see which way.
        let narrowness = if C::SLIDES { (s.gate_end_m / gate_m).min(1.0) } else { 1.0 };
        drop_worst(&mut pairs, s, 1.0 - (1.0 - s.keep) * narrowness);
        let (mut h, mut g, mut sliding) = (Matrix3::zeros(), Vector3::zeros(), Matrix3::zeros());
        for pair in &pairs {
            let jacobian = pair.jacobian(&rotation);
            let weighted = jacobian.transpose() * pair.weight;
            h += weighted * jacobian;
            g -= weighted * pair.residual;
            if C::SLIDES {
                sliding += jacobian.transpose() * pair.sliding_weight() * jacobian;
            }
        }
        Linearisation { pairs, h, g, sliding }
    }
}

impl ClosestPair {
    /// Derivative of the moved scan point by a right perturbation `(x, y, yaw)`.
    pub fn jacobian(&self, rotation: &Matrix2<f64>) -> Matrix2x3<f64> {
        let b = self.scan.position;
        rotation * Matrix2x3::new(1.0, 0.0, -b.y, 0.0, 1.0, b.x)
    }
}

/// [`MatchResult::failed`] in a box, which keeps results of single steps small.
pub(crate) fn failed(pose: Pose2, iterations: u32, status: MatchStatus) -> Box<MatchResult> {
    Box::new(MatchResult::failed(pose, iterations, status))
}
