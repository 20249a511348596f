use crate::islands::IslandList;
use sensing::RobotId;
use slam::{BadStretch, Team};

/// The scans of one robot on one island.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Track {
    /// Index of the robot.
    pub robot: usize,
    /// Index of the island.
    pub island: usize,
    /// Indices of the scans in the robot's log, in order.
    pub scans: Vec<usize>,
    /// The file its poses are in.
    pub file: String,
}

/// The tracks of all robots: robot by robot, each one's on the larger islands first. Scans that
/// are left out of the map are on none.
///
/// A robot's first track is `NAME.tum`, the others are `NAME.2.tum` and so on; numbers are skipped
/// where another robot is called so.
pub fn tracks(team: &Team, islands: &IslandList, names: &[&str]) -> Vec<Track> {
    let mut all = Vec::new();
    for (robot, name) in names.iter().enumerate() {
        let id = RobotId(robot as u16);
        let mut on = vec![Vec::new(); islands.islands.len()];
        let bad = team.bad_stretches(id);
        for (scan, pose) in team.scan_poses(id).enumerate() {
            if let Some(island) = islands.index(pose.patch).filter(|_| !is_bad(bad, scan)) {
                on[island].push(scan);
            }
        }
        let on = on.into_iter().enumerate().filter(|(_, scans)| !scans.is_empty());
        let files = files(name, names);
        let track = |((island, scans), file)| Track { robot, island, scans, file };
        all.extend(on.zip(files).map(track));
    }
    all
}

/// True for a scan that is left out of the map.
pub fn is_bad(stretches: &[BadStretch], scan: usize) -> bool {
    stretches.iter().any(|stretch| stretch.scans.contains(&scan))
}

/// Names for the trajectories of the robot `name`, a member of `names`.
fn files<'a>(name: &'a str, names: &'a [&str]) -> impl Iterator<Item = String> + 'a {
    let further = (2..).map(move |number| format!("{name}.{number}"));
    let free = further.filter(|further| !names.contains(&further.as_str()));
    std::iter::once(name.to_owned()).chain(free).map(|stem| format!("{stem}.tum"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_robots_share_a_file() {
        let names = ["a", "a.2", "b"];
        let first: Vec<String> = files("a", &names).take(3).collect();
        assert_eq!(first, ["a.tum", "a.3.tum", "a.4.tum"]);
        assert_eq!(files("a.2", &names).take(2).collect::<Vec<_>>(), ["a.2.tum", "a.2.2.tum"]);
    }
}
