use geometry::{Matrix2, Pose2, Vector2};
use manifold::PatchId;
use sensing::{LandmarkKind, RobotId};
use std::sync::Arc;

/// A landmark's place on an island.
///
/// An id that is read wrong, occurs twice or was moved has several places.
#[derive(Clone, Debug, PartialEq)]
pub struct IslandLandmark {
    /// What it is.
    pub kind: LandmarkKind,
    /// Which one it is, where that is known.
    pub id: Option<Arc<str>>,
    /// The patch from which it is known best.
    pub patch: PatchId,
    /// Present pose of that patch in the island's frame.
    pub island_from_patch: Pose2,
    /// Where the landmark is seen from the patch, metres.
    pub position: Vector2<f64>,
    /// Covariance of `position`, in the patch's frame, m^2.
    pub covariance: Matrix2<f64>,
    /// Heading seen from the patch, radians, and its variance: another robot's, where it is known.
    pub yaw: Option<(f64, f64)>,
    /// How often it was seen.
    pub sightings: usize,
    /// By whom, ascending.
    pub robots: Vec<RobotId>,
}

impl IslandLandmark {
    /// Where it is in the island's frame.
    pub fn in_island(&self) -> Vector2<f64> {
        self.island_from_patch.transform(self.position)
    }

    /// Its covariance seen from its patch, turned into the island's axes.
    pub fn covariance_in_island(&self) -> Matrix2<f64> {
        turned(&self.covariance, self.island_from_patch.yaw)
    }

    /// Its heading in the island's frame, with its variance.
    pub fn yaw_in_island(&self) -> Option<(f64, f64)> {
        self.yaw.map(|(yaw, variance)| (self.island_from_patch.yaw + yaw, variance))
    }
}

/// What one island knows of landmarks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IslandLandmarks {
    /// The landmarks.
    pub landmarks: Vec<IslandLandmark>,
    /// Row by row, for each two landmarks the covariance that the way between their patches adds to
    /// the position of one seen from the other, in the island's axes, m^2.
    pub drift: Vec<Matrix2<f64>>,
    /// Area in which the island's landmarks may lie, m^2.
    pub area_m2: f64,
}

impl IslandLandmarks {
    /// What the way between two landmarks' patches adds to their relative position.
    pub fn drift(&self, a: usize, b: usize) -> Matrix2<f64> {
        self.drift[a * self.landmarks.len() + b]
    }
}

/// A covariance seen in axes from which its own are turned by `yaw`: `R C R^T`.
pub(crate) fn turned(covariance: &Matrix2<f64>, yaw: f64) -> Matrix2<f64> {
    let (s, c) = yaw.sin_cos();
    let rotation = Matrix2::new(c, -s, s, c);
    rotation * covariance * rotation.transpose()
}
