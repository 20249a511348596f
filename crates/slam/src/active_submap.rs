use geometry::Pose2;
use manifold::{Manifold, PatchId, SubmapLimits};
use matching::{FieldSettings, LinePoint, SurfelField};

/// The local submap the robot is localised in, as a surfel field in the frame of its anchor patch.
#[derive(Clone, Debug)]
pub(crate) struct ActiveSubmap {
    pub anchor: PatchId,
    pub members: Vec<(PatchId, Pose2)>,
    pub field: SurfelField,
}

/// The line points of every patch, in the patch's frame, by patch index.
pub(crate) type PatchPoints = Vec<Vec<LinePoint>>;

impl ActiveSubmap {
    pub fn new(settings: FieldSettings) -> Self {
        let field = SurfelField::new(settings, (0.0, 0.0), (0.0, 0.0));
        ActiveSubmap { anchor: PatchId(0), members: Vec::new(), field }
    }

    /// Gathers the local submap of `anchor` and lays its field, with room to drive on by `margin_m`.
    pub fn rebuild(
        &mut self,
        manifold: &Manifold,
        points: &PatchPoints,
        anchor: PatchId,
        limits: &SubmapLimits,
        margin_m: f64,
    ) {
        let anchor_pose = manifold.patch(anchor).island_from_patch;
        self.anchor = anchor;
        self.members = manifold
            .local_submap(anchor, limits)
            .iter()
            .map(|m| (m.patch, anchor_pose.between(&manifold.patch(m.patch).island_from_patch)))
            .collect();
        self.members.sort_by_key(|m| m.0);
        let (min, max) = window(&self.members, points, margin_m);
        self.field.reset(min, max);
        for (patch, pose) in &self.members {
            self.field.insert(&points[patch.index()], pose);
        }
    }

    /// Adds a patch just created.
    pub fn push(&mut self, patch: PatchId, anchor_from_patch: Pose2, points: &[LinePoint]) {
        self.members.push((patch, anchor_from_patch));
        self.field.insert(points, &anchor_from_patch);
    }

    /// The member whose origin is nearest to a pose in the anchor's frame, its pose and distance.
    /// Rotation counts: `metres_per_radian` of turn is as far as a metre.
    pub fn nearest(&self, anchor_from_base: &Pose2, metres_per_radian: f64) -> (PatchId, Pose2) {
        let cost = |pose: &Pose2| {
            let delta = pose.between(anchor_from_base);
            delta.norm() + metres_per_radian * delta.yaw.abs()
        };
        self.members
            .iter()
            .map(|&(patch, pose)| (cost(&pose), patch, pose))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or((self.anchor, Pose2::IDENTITY), |(_, patch, pose)| (patch, pose))
    }
}

fn window(
    members: &[(PatchId, Pose2)],
    points: &PatchPoints,
    margin_m: f64,
) -> ((f64, f64), (f64, f64)) {
    let (mut min, mut max) = ((0.0f64, 0.0f64), (0.0f64, 0.0f64));
    for (patch, pose) in members {
        let (s, c) = pose.yaw.sin_cos();
        for p in &points[patch.index()] {
            let (px, py) = (f64::from(p.x), f64::from(p.y));
            let (x, y) = (pose.x + c * px - s * py, pose.y + s * px + c * py);
            min = (min.0.min(x), min.1.min(y));
            max = (max.0.max(x), max.1.max(y));
        }
    }
    ((min.0 - margin_m, min.1 - margin_m), (max.0 + margin_m, max.1 + margin_m))
}
