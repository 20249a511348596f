use super::{Known, Team, Track};
use crate::climbing::Climbing;
use crate::elevation::recall_ground;
use crate::map::Map;
use crate::merging::Merge;
use crate::track::{ScanPose, ScanRecord};
use crate::{BadStretch, Preparation, SlamConfig, StageObserver, Statistics};
use geometry::Pose2;
use manifold::{Manifold, Patch, PatchId};
use matching::{CompactPoints, LinePoint};
use rayon::prelude::*;
use sensing::{Observation, RobotId, Stamp};

/// Scans prepared together on one thread.
const BATCH: usize = 64;

/// A team as it was kept somewhere.
#[derive(Clone, Debug, Default)]
pub struct StoredTeam {
    /// The map.
    pub manifold: Manifold,
    /// For every robot its scans in the order of its log.
    pub scans: Vec<Vec<StoredScan>>,
    /// For every robot what its mapping counted.
    pub statistics: Vec<Statistics>,
    /// For every robot the stretches of its log that are left out.
    pub bad_stretches: Vec<Vec<BadStretch>>,
    /// Islands that were merged, and merges that may be.
    pub merges: Vec<Merge>,
}

/// A scan as a global pass needs it.
#[derive(Clone, Debug)]
pub struct StoredScan {
    /// Where it was found when it was taken.
    pub found: ScanPose,
    /// Where the last global pass has it.
    pub pose: ScanPose,
    /// Its stamp.
    pub stamp: Stamp,
    /// The robot in its odometry frame, where that is known.
    pub odom_from_base: Option<Pose2>,
    /// The scan with its mounting and sweep; without it the scan's place follows from its
    /// neighbours alone.
    pub observation: Option<Observation>,
}

impl Team {
    /// A team that goes on from where it was kept; it is the same as the one that was kept when the
    /// configuration is the same.
    pub fn resume(
        config: SlamConfig,
        observer: Box<dyn StageObserver>,
        stored: StoredTeam,
    ) -> Self {
        let StoredTeam { manifold, scans, statistics, bad_stretches, merges } = stored;
        let observations: Vec<Observation> = manifold.patches().iter().map(taken_from).collect();
        let mut surfaces = surfaces(&config, observations);
        let robots = manifold.robots().len();
        let mut tracks = vec![Track::default(); robots];
        for (track, counted) in tracks.iter_mut().zip(statistics) {
            track.statistics = counted;
        }
        for (track, bad) in tracks.iter_mut().zip(bad_stretches) {
            track.bad = bad;
        }
        for (track, scans) in tracks.iter_mut().zip(scans) {
            let (records, levelled) = recorded(&config, scans);
            track.scans = records;
            for (patch, surface) in levelled {
                surfaces[patch.index()] = surface;
            }
            for (k, scan) in track.scans.iter_mut().enumerate() {
                scan.left_out = track.bad.iter().any(|stretch| stretch.scans.contains(&k));
            }
        }
        for patch in manifold.patches() {
            tracks[usize::from(patch.robot.0)].patches.push(patch.id);
        }
        let mut map = Map { manifold, surfaces, ..Map::default() };
        recall_ground(&mut map, &config.elevation);
        Team { map, tracks, merges, ..Team::observed(config, observer) }
    }

    /// Prepares for a robot's log to be mapped once more from its beginning, when only a part of it
    /// was: its changes are taken for those that the map has, as far as it has them.
    ///
    /// The log and the configuration must be those of the first time, and the robot must not have
    /// been joined with others.
    pub fn begin_again(&mut self, robot: RobotId) {
        let manifold = &self.map.manifold;
        let own = |patch: PatchId| manifold.patch(patch).robot == robot;
        let track = &mut self.tracks[usize::from(robot.0)];
        let relations = manifold.relations().iter().filter(|r| own(r.from) && own(r.to));
        track.known = Known {
            patches: std::mem::take(&mut track.patches).into(),
            relations: relations.map(|r| r.id).collect(),
            ways: manifold.ways().iter().filter(|way| own(way.from)).count(),
            sightings: manifold.sightings().iter().filter(|seen| own(seen.patch)).count(),
        };
    }

    /// Name in the team's map of what a robot calls by its own.
    pub fn patch_of(&self, robot: RobotId, own: PatchId) -> PatchId {
        self.tracks[usize::from(robot.0)].patches[own.index()]
    }
}

/// What the robot saw when the patch was made.
fn taken_from(patch: &Patch) -> Observation {
    Observation {
        robot: patch.robot,
        stamp: patch.stamp,
        odom_from_base: None,
        base_from_laser: patch.base_from_laser,
        scan: Clone::clone(&patch.scan),
        sweep: patch.sweep,
        attitude: patch.attitude,
        sightings: Vec::new(),
    }
}

/// A robot's scans as they were when they were taken, those of leaning robots levelled again, and
/// the surfaces of the patches that were made of those.
fn recorded(
    config: &SlamConfig,
    scans: Vec<StoredScan>,
) -> (Vec<ScanRecord>, Vec<(PatchId, Vec<LinePoint>)>) {
    let seen = scans.iter().filter_map(|scan| scan.observation.clone()).collect();
    let mut surfaces = surfaces(config, seen).into_iter();
    let mut climbing = Climbing::new(config.elevation);
    let (mut records, mut levelled) = (Vec::with_capacity(scans.len()), Vec::new());
    let mut newest = None;
    for StoredScan { found, pose, stamp, odom_from_base, observation } in scans {
        let mut odom_from_base = config.usable_odometry(odom_from_base);
        let mut surface = Vec::new();
        if let Some(mut seen) = observation {
            surface = surfaces.next().unwrap_or_default();
            seen.odom_from_base = odom_from_base;
            climbing.level_odometry(&mut seen);
            climbing.level(&mut seen, &mut surface);
            odom_from_base = seen.odom_from_base;
            // A patch was made of the first scan that hangs on it.
            if seen.attitude.is_some() && newest < Some(found.patch) {
                levelled.push((found.patch, surface.clone()));
            }
        }
        newest = newest.max(Some(found.patch));
        let surface = CompactPoints::new(&surface);
        records.push(ScanRecord { found, pose, stamp, odom_from_base, left_out: false, surface });
    }
    (records, levelled)
}

/// The surfaces that scans show, as when they were taken.
fn surfaces(config: &SlamConfig, observations: Vec<Observation>) -> Vec<Vec<LinePoint>> {
    let preparation = Preparation::new(config);
    observations
        .into_par_iter()
        .with_min_len(BATCH)
        .map_init(
            || preparation.clone(),
            |preparation, observation| preparation.prepare(observation).surface,
        )
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Unobserved;
    use synthetic::{Robot, Storeys};

    /// Two robots, kept before they are joined: what the team derives from what is kept is the
    /// same, that of scans taken on a ramp included.
    #[test]
    fn a_team_of_leaning_robots_is_the_same_when_it_was_kept() {
        let config = SlamConfig::default();
        let run = Storeys::default().record(&Robot::default(), 2).run;
        let parts = [&run.observations[..400], &run.observations[300..]];
        let mut team = Team::new(config);
        for (number, part) in parts.iter().enumerate() {
            team.map_robot(&format!("robot-{number}"), part.iter().cloned());
        }
        let kept = |(track, part): (&Track, &&[Observation])| {
            let scans = track.scans.iter().zip(*part);
            let stored = |(scan, seen): (&ScanRecord, &Observation)| StoredScan {
                found: scan.found,
                pose: scan.pose,
                stamp: scan.stamp,
                odom_from_base: seen.odom_from_base,
                observation: Some(Observation { odom_from_base: None, ..seen.clone() }),
            };
            scans.map(stored).collect::<Vec<_>>()
        };
        let stored = StoredTeam {
            manifold: team.map.manifold.clone(),
            scans: team.tracks.iter().zip(&parts).map(kept).collect(),
            ..StoredTeam::default()
        };
        let resumed = Team::resume(config, Box::new(Unobserved), stored);
        assert_eq!(resumed.map.slopes, team.map.slopes);
        assert!(!team.map.with_ground.is_empty(), "ground is seen as walls near the ramp");
        assert_eq!(resumed.map.with_ground, team.map.with_ground);
        assert_eq!(resumed.map.surfaces, team.map.surfaces);
        for (one, other) in resumed.tracks.iter().zip(&team.tracks) {
            for (scan, as_was) in one.scans.iter().zip(&other.scans) {
                assert_eq!(scan.odom_from_base, as_was.odom_from_base);
                assert_eq!(scan.surface, as_was.surface);
            }
        }
    }
}
