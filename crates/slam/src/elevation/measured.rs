use super::{BIAS_STD_RAD, climbed, slope_of};
use manifold::{Islands, Manifold, PatchId, Provenance, Relation};
use sensing::Attitude;
use std::collections::BTreeSet;

/// A measured difference in height between two patches: `height[to] - height[from]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rise {
    pub from: PatchId,
    pub to: PatchId,
    pub rise_m: f64,
    pub variance_m2: f64,
    /// The robot whose unit's remaining bias adds `bias * distance_m`; nothing where zero.
    pub robot: usize,
    pub distance_m: f64,
    /// Geometry said so: it may be wrong altogether.
    pub doubtful: bool,
}

/// Error of the height difference of two patches that see the same walls, metres: a step, and the
/// laser's swaying.
const RELATED_STD_M: f64 = 0.05;
/// Share by which the slope at a relation's ends misses what lies between them.
const SLOPE_SHARE: f64 = 0.5;
/// Where nobody knows, the ground may rise by this much a metre: the steepest ramp for wheels.
pub(crate) const UNKNOWN_SLOPE: f64 = 0.15;

/// All that is known of differences in height: the ways with climb, and the relations beside them.
pub(crate) fn rises(manifold: &Manifold, islands: &Islands, biases: &[Attitude]) -> Vec<Rise> {
    let mut rises = Vec::new();
    let mut driven = BTreeSet::new();
    for way in manifold.ways() {
        let Some(climb) = way.climb else { continue };
        if islands.of(way.from) != islands.of(way.to) {
            continue;
        }
        let robot = usize::from(manifold.patch(way.from).robot.0);
        let (rise_m, variance_m2) = climbed(&climb, biases[robot].pitch_rad);
        let level = rise_m == 0.0;
        driven.insert((way.from, way.to));
        rises.push(Rise {
            from: way.from,
            to: way.to,
            rise_m,
            variance_m2,
            robot,
            distance_m: if level { 0.0 } else { climb.distance_m },
            doubtful: false,
        });
    }
    for relation in manifold.active_relations() {
        let ends = (relation.from, relation.to);
        if !driven.contains(&ends) && !driven.contains(&(ends.1, ends.0)) {
            rises.push(related(manifold, relation, biases));
        }
    }
    rises
}

/// What a relation says: its ends lie on the ground that both robots stand on.
fn related(manifold: &Manifold, relation: &Relation, biases: &[Attitude]) -> Rise {
    let ends = [relation.from, relation.to].map(|id| manifold.patch(id));
    let offset = relation.from_from_to.mean.translation();
    let slopes = ends.map(|patch| slope_of(patch, biases));
    let (rise_m, doubt) = match slopes {
        [Some(from), Some(to)] => {
            let to = relation.from_from_to.mean.rotate(to);
            let mean = 0.5 * (from + to);
            (mean.dot(&offset), SLOPE_SHARE * mean.norm() * offset.norm())
        }
        _ => (0.0, UNKNOWN_SLOPE * offset.norm()),
    };
    Rise {
        from: relation.from,
        to: relation.to,
        rise_m,
        variance_m2: RELATED_STD_M * RELATED_STD_M
            + doubt * doubt
            + (BIAS_STD_RAD * offset.norm()).powi(2),
        robot: 0,
        distance_m: 0.0,
        doubtful: relation.provenance != Provenance::Sequential,
    }
}
