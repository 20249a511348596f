use super::{MappedRobot, MappingTimes};
use crate::islands::IslandList;
use crate::level_maps::HangingPath;
use crate::tracks::{Track, tracks};
use geometry::Pose2;
use manifold::PatchId;
use sensing::RobotId;
use slam::Team;

/// Logs turned into one map, or as many as the evidence supports.
pub struct MappedTeam {
    /// The robots, by name; their order is that of the team's robots.
    pub robots: Vec<MappedRobot>,
    /// The map.
    pub team: Team,
    /// Base pose of every scan of every robot in the frame of the island it is on; those that are
    /// left out stand where the robot believed to be.
    pub poses: Vec<Vec<Pose2>>,
    /// The connected maps.
    pub islands: IslandList,
    /// Which scans of which robot are on which of them.
    pub tracks: Vec<Track>,
    /// Where the time went, all robots and the team together.
    pub times: MappingTimes,
    /// Logs that could not be mapped, with reasons.
    pub failures: Vec<String>,
}

impl MappedTeam {
    /// What a team has mapped, with its robots in the team's order.
    pub fn new(
        team: Team,
        robots: Vec<MappedRobot>,
        times: MappingTimes,
        failures: Vec<String>,
    ) -> Self {
        let poses = (0..robots.len()).map(|k| team.trajectory(RobotId(k as u16))).collect();
        let islands = IslandList::of(team.manifold());
        let names: Vec<&str> = robots.iter().map(|robot| robot.name.as_str()).collect();
        let tracks = tracks(&team, &islands, &names);
        MappedTeam { robots, team, poses, islands, tracks, times, failures }
    }

    /// The team's robots with what was mapped of them.
    pub fn robots(&self) -> impl Iterator<Item = (RobotId, &MappedRobot)> {
        self.robots.iter().enumerate().map(|(k, robot)| (RobotId(k as u16), robot))
    }

    /// Each robot's path on an island; empty for robots that are not on it.
    pub fn paths_on(&self, island: usize) -> Vec<Vec<Pose2>> {
        let hanging = self.hanging_paths_on(island).into_iter();
        hanging.map(|path| path.into_iter().map(|(_, pose)| pose).collect()).collect()
    }

    /// [`MappedTeam::paths_on`] with the patches that the poses hang on.
    pub fn hanging_paths_on(&self, island: usize) -> Vec<HangingPath> {
        let mut paths = vec![Vec::new(); self.robots.len()];
        for track in self.tracks.iter().filter(|track| track.island == island) {
            let hangs_on: Vec<PatchId> =
                self.team.scan_poses(RobotId(track.robot as u16)).map(|pose| pose.patch).collect();
            let patches = track.scans.iter().map(|&scan| hangs_on[scan]);
            paths[track.robot] = patches.zip(self.poses_of(track)).collect();
        }
        paths
    }

    /// The robots' names.
    pub fn names(&self) -> Vec<&str> {
        self.robots.iter().map(|robot| robot.name.as_str()).collect()
    }

    /// Base poses of a track's scans, in the frame of its island.
    pub fn poses_of<'a>(&'a self, track: &'a Track) -> impl Iterator<Item = Pose2> + 'a {
        track.scans.iter().map(|&scan| self.poses[track.robot][scan])
    }

    /// Some of the input could not be used.
    pub fn is_lossy(&self) -> bool {
        self.robots.iter().any(|robot| robot.facts.is_lossy())
    }
}
