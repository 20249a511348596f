use geometry::{Pose2, Vector2};
use manifold::{Manifold, PatchId};
use matching::LinePoint;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The manifold with what the pipeline derives from its scans and remembers of its making.
#[derive(Clone, Debug, Default)]
pub(crate) struct Map {
    pub manifold: Manifold,
    /// Line points of every patch, in the patch's frame.
    pub surfaces: Vec<Vec<LinePoint>>,
    /// The line points of the patches that saw ground, that of the ground included; `surfaces` has
    /// them without.
    pub with_ground: BTreeMap<PatchId, Vec<LinePoint>>,
    /// See [`Map::slope`]; patches beyond the end stand on the level.
    pub slopes: Vec<Vector2<f64>>,
}

/// Lasers whose planes differ by more than this see floors, ramps and ceilings in different places,
/// radians: less than the flattest ramp, more than the doubt about a bias and the noise of a
/// reading.
const SAME_PLANE_RAD: f64 = 0.04;

/// True for lasers that sweep planes of about the same slope, each rise per metre along two axes.
pub(crate) fn same_plane(one: &Vector2<f64>, other: &Vector2<f64>) -> bool {
    (one - other).norm() <= SAME_PLANE_RAD
}

/// Surfaces within 45 degrees of a direction face it.
const FACING_COS: f32 = 0.7;

/// True for a surface that faces a direction, or its opposite.
pub(crate) fn faces(point: &LinePoint, direction: &Vector2<f32>) -> bool {
    (point.nx * direction.x + point.ny * direction.y).abs() > FACING_COS
}

impl Map {
    /// Present pose of a patch in its island.
    pub fn pose(&self, patch: PatchId) -> Pose2 {
        self.manifold.patch(patch).island_from_patch
    }

    /// True unless two patches of an island certainly lie on different levels, or their lasers
    /// leaned differently: nothing else may be closed, fitted or looked up between them. Unknown
    /// heights and attitudes tell nothing.
    pub fn comparable(&self, a: PatchId, b: PatchId) -> bool {
        !self.manifold.apart_in_height(a, b) && self.lean_alike(a, b)
    }

    /// True for a patch that stands on a floor, as far as is known.
    pub fn is_level(&self, patch: PatchId) -> bool {
        self.slope(patch) == Vector2::zeros()
    }

    /// True for a patch whose surfaces are those of its scan and nothing else, and may all be
    /// compared: it stands on the level, and no ground was left out of what it sees.
    pub fn is_the_same_in_any_map(&self, patch: PatchId) -> bool {
        self.is_level(patch) && !self.with_ground.contains_key(&patch)
    }

    /// True when two patches' lasers swept planes of about the same slope.
    pub fn lean_alike(&self, a: PatchId, b: PatchId) -> bool {
        self.leans_alike(a, &self.pose(b).rotate(self.slope(b)))
    }

    /// [`Map::lean_alike`] for a laser that swept a plane of a slope given in the island's frame.
    pub fn leans_alike(&self, patch: PatchId, slope: &Vector2<f64>) -> bool {
        same_plane(&self.pose(patch).rotate(self.slope(patch)), slope)
    }

    /// Rise per metre forwards and to the left of the ground under a patch; zero where nothing
    /// tells.
    pub fn slope(&self, patch: PatchId) -> Vector2<f64> {
        self.slopes.get(patch.index()).copied().unwrap_or_else(Vector2::zeros)
    }

    /// The line points of `to` that can be compared with those of `from`. Where lasers lean
    /// differently, what faces the way they do lies elsewhere for each (a floor, a ramp, a ceiling
    /// met at a height of its own); walls along it lie where they lie for any laser.
    pub fn comparable_surface(&self, from: PatchId, to: PatchId) -> Cow<'_, [LinePoint]> {
        let surface = self.surface(to);
        if self.lean_alike(from, to) {
            return Cow::Borrowed(surface);
        }
        let between = self.pose(to).between(&self.pose(from)).rotate(self.slope(from));
        let differs = (between - self.slope(to)).normalize().cast::<f32>();
        Cow::Owned(surface.iter().filter(|p| !faces(p, &differs)).copied().collect())
    }

    /// Line points of a patch.
    pub fn surface(&self, patch: PatchId) -> &[LinePoint] {
        &self.surfaces[patch.index()]
    }

    /// Sets the slope of the ground under a patch.
    pub fn set_slope(&mut self, patch: PatchId, slope: Vector2<f64>) {
        if self.slopes.len() <= patch.index() {
            self.slopes.resize(patch.index() + 1, Vector2::zeros());
        }
        self.slopes[patch.index()] = slope;
    }

    /// Sets the line points of a patch.
    pub fn set_surface(&mut self, patch: PatchId, surface: Vec<LinePoint>) {
        if self.surfaces.len() <= patch.index() {
            self.surfaces.resize(patch.index() + 1, Vec::new());
        }
        self.surfaces[patch.index()] = surface;
        self.with_ground.remove(&patch);
    }
}
