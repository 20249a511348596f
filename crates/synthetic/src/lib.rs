//! Worlds with known truth: floor plans, exact ray casting, a laser and wheels with honest noise.
//!
//! Everything is drawn from a seed, so that the same call gives the same bytes on every machine
//! with the same `rand`. Frames: plans and true poses live in `world`; odometry starts at the
//! identity.
//!
//! ```
//! use manifoldslam_synthetic::two_loop_building;
//! let run = two_loop_building(1);
//! assert_eq!(run.truth.len(), run.observations.len());
//! ```
//!
//! Reading order: [`FloorPlan`], [`RayCaster`], [`Scanner`], [`Drive`], [`WheelNoise`], [`Run`],
//! then the buildings made of them and the CARMEN writer.

mod bad_data;
mod buildings;
mod campus;
mod campus_parts;
mod campus_site;
mod carmen;
mod drive;
mod error;
mod floor_plan;
mod inertial_unit;
mod landmarks;
mod large_buildings;
mod lobby;
mod normal;
mod ray_caster;
mod room;
mod run;
mod scanner;
mod site;
mod situations;
mod solid_world;
mod storeys;
mod trajectory_error;
mod twin_worlds;
mod twins;
mod wheels;
mod wing;
mod wood;

pub use bad_data::{Mishap, MishapRun, mishap};
pub use buildings::{
    circular_room, corridor, corridor_run, two_loop_building, two_loop_building_with,
};
pub use campus::Campus;
pub use carmen::{write_carmen, write_relations, write_truth};
pub use drive::Drive;
pub use error::SyntheticError;
pub use floor_plan::{Circle, FloorPlan, Wall};
pub use inertial_unit::InertialUnit;
pub use landmarks::{Landmark, LandmarkSensor, misread};
pub use large_buildings::{hall, office, office_plan, ring_corridor};
pub use normal::standard_normal;
pub use ray_caster::{RayCaster, SurfaceHit};
pub use room::{RoomPair, noisy_room, noisy_room_pair};
pub use run::{Robot, Run};
pub use scanner::{LaserNoise, Scanner, TrueBeam};
pub(crate) use site::Site;
pub use situations::Situation;
pub use solid_world::{Ground, SolidWorld};
pub use storeys::{Ascent, Storeys, StoreysRun};
pub use trajectory_error::trajectory_error;
pub use twins::{Meeting, TwinCase, TwinFamily, TwinPart, twins};
pub use wheels::WheelNoise;
