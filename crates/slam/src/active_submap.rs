use crate::map::Map;
use geometry::{Pose2, Vector2};
use manifold::{PatchId, SubmapLimits};
use matching::{FieldSettings, LikelihoodPyramid, LikelihoodSettings, LinePoint, SurfelField};

/// One sight line in so many is looked along, ...
const SIGHT_LINES_STEP: usize = 3;
/// ... up to this far before its end, metres, ...
const BEFORE_END_M: f32 = 0.5;
/// ... and not at all if it ends nearer than this to the laser, metres.
const NEAREST_END_M: f32 = 1.0;

/// A local submap as a surfel field, in the frame of its anchor patch.
#[derive(Clone, Debug)]
pub(crate) struct ActiveSubmap {
    pub anchor: PatchId,
    /// Patches and their poses seen from the anchor.
    pub members: Vec<(PatchId, Pose2)>,
    pub field: SurfelField,
}

impl ActiveSubmap {
    /// An empty submap.
    pub fn new(settings: FieldSettings) -> Self {
        let field = SurfelField::new(settings, (0.0, 0.0), (0.0, 0.0));
        ActiveSubmap { anchor: PatchId(0), members: Vec::new(), field }
    }

    /// Gathers the local submap of `anchor` and lays its field, with room to drive on by
    /// `margin_m`.
    pub fn rebuild(&mut self, map: &Map, anchor: PatchId, limits: &SubmapLimits, margin_m: f64) {
        self.gather(map, anchor, limits);
        self.lay(map, margin_m);
    }

    /// Gathers the local submap of `anchor`; its field stays as it was until [`ActiveSubmap::lay`].
    pub fn gather(&mut self, map: &Map, anchor: PatchId, limits: &SubmapLimits) {
        let anchor_pose = map.pose(anchor);
        let submap = map.manifold.local_submap(anchor, limits);
        let seen = |patch: PatchId| (patch, anchor_pose.between(&map.pose(patch)));
        self.anchor = anchor;
        self.members = submap.iter().map(|m| seen(m.patch)).collect();
        self.members.sort_by_key(|m| m.0);
    }

    /// Lays the field of the members, with room to drive on by `margin_m`.
    pub fn lay(&mut self, map: &Map, margin_m: f64) {
        lay_field(&mut self.field, map, &self.members, margin_m);
    }

    /// What wide searches look in: all points of the members, in the anchor's frame, blurred by
    /// what the submap is bent.
    pub fn pyramid(&self, map: &Map) -> LikelihoodPyramid {
        let positions = self.members.iter().flat_map(|(patch, pose)| {
            let mover = LinePoint::mover(pose);
            map.surface(*patch).iter().map(move |p| {
                let moved = mover(p);
                Vector2::new(moved.x.into(), moved.y.into())
            })
        });
        let grid =
            LikelihoodSettings { cell_m: 0.1, sigma_m: 0.12, ..LikelihoodSettings::default() };
        LikelihoodPyramid::from_points(positions, &grid)
    }

    /// Share of a scan's sight lines that pass through a wall of the submap when the scan is at
    /// `anchor_from_base`.
    pub fn seen_through(
        &self,
        scan: &[LinePoint],
        anchor_from_base: &Pose2,
        base_from_laser: &Pose2,
    ) -> f64 {
        let laser = (*anchor_from_base * *base_from_laser).translation().cast::<f32>();
        let (mut lines, mut blocked) = (0usize, 0usize);
        let mover = LinePoint::mover(anchor_from_base);
        for p in scan.iter().step_by(SIGHT_LINES_STEP).map(mover) {
            let end = Vector2::new(p.x, p.y);
            let range = (end - laser).norm();
            if range < NEAREST_END_M {
                continue;
            }
            let short = laser + (end - laser) * ((range - BEFORE_END_M) / range);
            lines += 1;
            blocked += usize::from(self.field.blocks(
                (laser.x, laser.y),
                (short.x, short.y),
                self.field.settings().cell_m,
            ));
        }
        blocked as f64 / lines.max(1) as f64
    }

    /// Adds a patch just created.
    pub fn push(&mut self, patch: PatchId, anchor_from_patch: Pose2, surface: &[LinePoint]) {
        self.members.push((patch, anchor_from_patch));
        self.field.insert(surface, &anchor_from_patch);
    }

    /// The members whose origins are nearest to a pose in the anchor's frame, nearest first.
    pub fn nearest_members(&self, pose: &Pose2, most: usize) -> Vec<(PatchId, Pose2)> {
        let mut members = self.members.clone();
        members.sort_by(|a, b| a.1.distance(pose).total_cmp(&b.1.distance(pose)));
        members.truncate(most);
        members
    }

    /// The member whose origin is nearest to a pose in the anchor's frame, and its pose. Rotation
    /// counts: a radian of turn is as far as `metres_per_radian`.
    pub fn nearest(&self, anchor_from_base: &Pose2, metres_per_radian: f64) -> (PatchId, Pose2) {
        let cost = |pose: &Pose2| {
            let (dx, dy) = (pose.x - anchor_from_base.x, pose.y - anchor_from_base.y);
            let turn = geometry::wrap_angle(pose.yaw - anchor_from_base.yaw).abs();
            (dx * dx + dy * dy).sqrt() + metres_per_radian * turn
        };
        self.members
            .iter()
            .map(|&(patch, pose)| (cost(&pose), patch, pose))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or((self.anchor, Pose2::IDENTITY), |(_, patch, pose)| (patch, pose))
    }
}

/// Fills `field` with the surfaces of `members`, its window `margin_m` larger than they are.
pub(crate) fn lay_field(
    field: &mut SurfelField,
    map: &Map,
    members: &[(PatchId, Pose2)],
    margin_m: f64,
) {
    let (mut min, mut max) = ((0.0f32, 0.0f32), (0.0f32, 0.0f32));
    for (patch, pose) in members {
        for p in map.surface(*patch).iter().map(LinePoint::mover(pose)) {
            min = (min.0.min(p.x), min.1.min(p.y));
            max = (max.0.max(p.x), max.1.max(p.y));
        }
    }
    let low = (f64::from(min.0) - margin_m, f64::from(min.1) - margin_m);
    let high = (f64::from(max.0) + margin_m, f64::from(max.1) + margin_m);
    field.reset(low, high);
    for (patch, pose) in members {
        field.insert(map.surface(*patch), pose);
    }
}
