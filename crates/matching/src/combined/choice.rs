use super::CombinedSettings;
use crate::{MatchResult, MatchStatus, Prior};
use geometry::{Vector3, wrap_angle};

/// An answer of the local matcher with the share of the scan that lies on surfaces of the
/// reference and could be seen there.
#[derive(Clone, Copy)]
pub(super) struct Refined {
    pub result: MatchResult,
    pub explained: f64,
}

/// Answers nearer to each other than this are the same, metres and radians.
pub(super) const SAME_M: f64 = 0.3;
pub(super) const SAME_RAD: f64 = 0.2;
/// Answers farther apart than this are not the same even along a direction that is not observed.
const SAME_PLACE_M: f64 = 2.5;

/// The answer that explains most of the scan; ambiguous if one elsewhere explains as much.
pub(super) fn choose(refined: &[Refined], prior: &Prior, s: &CombinedSettings) -> Refined {
    let usable = || refined.iter().filter(|answer| answer.result.status.is_usable());
    let merit = |answer: &Refined| answer.explained + answer.result.inlier_ratio;
    let most = |best: Option<Refined>, next: &Refined| match best {
        Some(best) if merit(&best) >= merit(next) => Some(best),
        _ => Some(*next),
    };
    let Some(best) = usable().fold(None, most) else {
        let result = MatchResult::failed(prior.pose, 0, MatchStatus::Diverged);
        let nothing = Refined { result, explained: 0.0 };
        return refined.first().copied().unwrap_or(nothing);
    };
    let as_good = |other: &&Refined| {
        other.explained > best.explained - s.rival_explained
            && other.result.inlier_ratio > best.result.inlier_ratio - s.rival_inliers
    };
    match usable().filter(as_good).find(|other| !is_same(&other.result, &best.result)) {
        Some(rival) => {
            let status = MatchStatus::Ambiguous { rival: rival.result.pose };
            Refined { result: MatchResult { status, ..best.result }, ..best }
        }
        None => best,
    }
}

/// Whether two answers are one: near each other, or apart along what the better one does not claim
/// to know.
fn is_same(other: &MatchResult, best: &MatchResult) -> bool {
    let apart = best.pose.between(&other.pose);
    let mut apart = Vector3::new(apart.x, apart.y, wrap_angle(apart.yaw));
    if let MatchStatus::Degenerate { weak_axis } = best.status {
        let along = weak_axis.dot(&apart).clamp(-SAME_PLACE_M, SAME_PLACE_M);
        apart -= weak_axis * along;
    }
    apart.xy().norm() < SAME_M && apart.z.abs() < SAME_RAD
}
