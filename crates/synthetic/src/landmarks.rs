use crate::{RayCaster, Run, standard_normal};
use geometry::{Matrix2, Pose2, Vector2, wrap_angle};
use rand::{Rng, SeedableRng, rngs::StdRng};
use sensing::{LandmarkKind, Sighting};
use std::sync::Arc;

/// Something to be recognised that stands in a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Landmark {
    /// What it is.
    pub kind: LandmarkKind,
    /// What it is read as.
    pub id: Option<Arc<str>>,
    /// Where it is, world frame, metres.
    pub position: Vector2<f64>,
}

/// What recognises landmarks and other robots, and what it gets wrong: independent normal errors,
/// of which it tells the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkSensor {
    /// Nothing is seen farther away, metres.
    pub range_m: f64,
    /// Nor farther to a side, radians.
    pub half_view_rad: f64,
    /// Error along the sight line, metres.
    pub range_std_m: f64,
    /// Error of the direction, radians.
    pub bearing_std_rad: f64,
    /// Error of another robot's heading, radians; `None` where it is not seen.
    pub yaw_std_rad: Option<f64>,
    /// It looks once in so many scans.
    pub every: usize,
}

impl Default for LandmarkSensor {
    /// A camera that reads printed tags: 6 m, 90 degrees, once in five scans.
    fn default() -> Self {
        LandmarkSensor {
            range_m: 6.0,
            half_view_rad: 0.25 * std::f64::consts::PI,
            range_std_m: 0.05,
            bearing_std_rad: 0.01,
            yaw_std_rad: None,
            every: 5,
        }
    }
}

impl LandmarkSensor {
    /// Adds to a run's observations the landmarks that were in view: walls hide them.
    pub fn see(&self, run: &mut Run, landmarks: &[Landmark], seed: u64) {
        let world = RayCaster::new(run.plan.clone());
        let mut rng = StdRng::seed_from_u64(seed);
        for k in (0..run.truth.len()).step_by(self.every.max(1)) {
            for landmark in landmarks {
                let Some(at) = self.in_view(&world, &run.truth[k], landmark.position) else {
                    continue;
                };
                let sighting =
                    self.measured(landmark.kind, landmark.id.clone(), at, None, &mut rng);
                run.observations[k].sightings.push(sighting);
            }
        }
    }

    /// Adds to the observations of robots that drive in one world at the same time the other robots
    /// in view. They are called as `names` say; scans of equal stamps are taken at once.
    pub fn see_each_other(&self, runs: &mut [Run], names: &[&str], seed: u64) {
        let Some(world) = runs.first().map(|run| RayCaster::new(run.plan.clone())) else { return };
        let mut rng = StdRng::seed_from_u64(seed);
        for seer in 0..runs.len() {
            for seen in (0..runs.len()).filter(|&seen| seen != seer) {
                for k in (0..runs[seer].truth.len()).step_by(self.every.max(1)) {
                    let stamp = runs[seer].observations[k].stamp;
                    let other = runs[seen].observations.iter().position(|o| o.stamp == stamp);
                    let Some(other) = other.map(|at| runs[seen].truth[at]) else { continue };
                    let here = runs[seer].truth[k];
                    let Some(at) = self.in_view(&world, &here, other.translation()) else {
                        continue;
                    };
                    let (kind, name) = (LandmarkKind::Robot, Some(names[seen].into()));
                    let yaw = Some(here.between(&other).yaw);
                    let sighting = self.measured(kind, name, at, yaw, &mut rng);
                    runs[seer].observations[k].sightings.push(sighting);
                }
            }
        }
    }

    /// Where something is seen from a base, without error; `None` where it is not.
    pub fn in_view(
        &self,
        world: &RayCaster,
        world_from_base: &Pose2,
        position: Vector2<f64>,
    ) -> Option<Vector2<f64>> {
        let at = world_from_base.inverse().transform(position);
        let distance = at.norm();
        let direction = (position - world_from_base.translation()).try_normalize(1e-6)?;
        let near = distance <= self.range_m && at.y.atan2(at.x).abs() <= self.half_view_rad;
        // What hangs on a wall is not hidden by it.
        let short = distance - 0.05;
        let hidden = world.cast(world_from_base.translation(), direction, short).is_some();
        (near && !hidden).then_some(at)
    }

    fn measured(
        &self,
        kind: LandmarkKind,
        id: Option<Arc<str>>,
        at: Vector2<f64>,
        yaw: Option<f64>,
        rng: &mut StdRng,
    ) -> Sighting {
        let unit = at / at.norm();
        let side = Vector2::new(-unit.y, unit.x);
        let (along, across) = (self.range_std_m, self.bearing_std_rad * at.norm());
        let error = unit * along * standard_normal(rng) + side * across * standard_normal(rng);
        let covariance: Matrix2<f64> =
            unit * unit.transpose() * along.powi(2) + side * side.transpose() * across.powi(2);
        let turned =
            |(yaw, std): (f64, f64)| (wrap_angle(yaw + std * standard_normal(rng)), std * std);
        let yaw = yaw.zip(self.yaw_std_rad).map(turned);
        Sighting { kind, id, position: at + error, covariance, yaw }
    }
}

/// Ids as robots read them: each, with a chance of `wrong`, as that of another.
pub fn misread(landmarks: &[Landmark], wrong: f64, seed: u64) -> Vec<Landmark> {
    let mut rng = StdRng::seed_from_u64(seed);
    let mut read = landmarks.to_vec();
    for (i, landmark) in read.iter_mut().enumerate() {
        if landmarks.len() > 1 && rng.random::<f64>() < wrong {
            let other = (i + rng.random_range(1..landmarks.len())) % landmarks.len();
            landmark.id.clone_from(&landmarks[other].id);
        }
    }
    read
}
