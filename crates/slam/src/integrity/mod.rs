//! Watching over a robot's data: notices when they go bad and says from which scan on.

mod bridge;
mod faults;
mod pieces;
mod sensor;
mod suspicion;
mod visibility;

pub(crate) use bridge::bridge;
pub use faults::{BadStretch, Fault, IntegritySettings};
pub(crate) use sensor::Verdict;

use crate::front_end::Localisation;
use crate::map::Map;
use geometry::Pose2;
use pieces::Pieces;
use sensing::{Observation, Scan};
use sensor::SensorWatch;
use suspicion::{Suspicion, Witness};

/// Everything that watches over one robot's data.
#[derive(Clone, Debug)]
pub(crate) struct Integrity {
    pub sensors: SensorWatch,
    pub pieces: Pieces,
    suspicion: Suspicion,
}

/// A scan that is kept although it may not become a patch, with its laser's mounting.
pub(crate) struct WitnessScan {
    scan: Scan,
    base_from_laser: Pose2,
}

impl Integrity {
    pub fn new(settings: IntegritySettings) -> Self {
        Integrity {
            sensors: SensorWatch::new(settings),
            pieces: Pieces::new(settings),
            suspicion: Suspicion::new(settings),
        }
    }

    /// True while the sensors tell nothing of use.
    pub fn is_bad(&self) -> bool {
        self.sensors.is_bad()
    }

    /// The observation's scan, if it is wanted even if it does not become a patch.
    pub fn witness(&self, observation: &Observation) -> Option<WitnessScan> {
        let Observation { scan, base_from_laser, .. } = observation;
        let wanted = self.suspicion.is_open() || self.pieces.is_unproven();
        wanted.then(|| WitnessScan { scan: scan.clone(), base_from_laser: *base_from_laser })
    }

    /// Judges a localised scan; once the robot is found to be lost, for how many scans it has been.
    pub fn judge(
        &mut self,
        scan: Option<WitnessScan>,
        found: &Localisation,
        map: &Map,
    ) -> Option<usize> {
        // What the sensors are about to explain is no reason to search further.
        if self.sensors.is_in_doubt() {
            return None;
        }
        let patch = found.is_patch.then(|| map.manifold.patch(found.patch));
        let (scan, base_from_laser) = match (patch, &scan) {
            (Some(patch), _) => (&*patch.scan, patch.base_from_laser),
            (None, Some(kept)) => (&kept.scan, kept.base_from_laser),
            (None, None) => return None,
        };
        let island_from_base = map.pose(found.patch) * found.patch_from_base;
        self.pieces.drive(island_from_base, scan);
        let witness = Witness {
            scan,
            island_from_base,
            island_from_laser: island_from_base * base_from_laser,
            patch: patch.map(|p| p.id),
            near: found.patch,
            slope: island_from_base.rotate(found.slope),
            recovered: found.recovered,
            shift: found.shift,
        };
        self.suspicion.watch(&witness, map)
    }

    /// A new piece of map begins.
    pub fn restart(&mut self) {
        self.suspicion.restart();
    }
}
