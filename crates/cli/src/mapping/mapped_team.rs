use super::{MappedRobot, MappingTimes};
use crate::islands::IslandList;
use geometry::Pose2;
use sensing::RobotId;
use slam::Team;

/// Logs turned into one map, or as many as the evidence supports.
pub struct MappedTeam {
    /// The robots, by name; their order is that of the team's robots.
    pub robots: Vec<MappedRobot>,
    /// The map.
    pub team: Team,
    /// Base pose of every scan of every robot in the frame of the island it is on.
    pub poses: Vec<Vec<Pose2>>,
    /// The connected maps.
    pub islands: IslandList,
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
        MappedTeam { robots, team, poses, islands, times, failures }
    }

    /// The team's robots with what was mapped of them.
    pub fn robots(&self) -> impl Iterator<Item = (RobotId, &MappedRobot)> {
        self.robots.iter().enumerate().map(|(k, robot)| (RobotId(k as u16), robot))
    }

    /// Each robot's path on an island; empty for robots that are not on it.
    pub fn paths_on(&self, island: usize) -> Vec<Vec<Pose2>> {
        let path = |(id, _): (RobotId, _)| {
            let scans = self.team.scan_poses(id).zip(&self.poses[usize::from(id.0)]);
            let here = scans.filter(|(scan, _)| self.islands.index(scan.patch) == Some(island));
            here.map(|(_, pose)| *pose).collect()
        };
        self.robots().map(path).collect()
    }

    /// Some of the input could not be used.
    pub fn is_lossy(&self) -> bool {
        self.robots.iter().any(|robot| robot.facts.is_lossy())
    }
}
