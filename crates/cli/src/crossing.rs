//! True relations between several robots' trajectories in one map frame.

use crate::scoring::{RelationScore, StampedPoses, relation_error};
use geometry::Pose2;
use logs::TrueRelation;
use serde::Serialize;
use std::collections::BTreeSet;

/// Scores by where the two stamps of a relation lie.
///
/// A relation is measured once for every ordered pair of trajectories `(i, j)` of which `i` holds
/// its first stamp and `j` its second: within where `i` is `j`, across where not. A stamp that two
/// robots share is so measured by both, and no choice between them favours anybody.
#[derive(Debug, Serialize)]
pub struct CrossingScores {
    /// All measurements; `total` is the number of all relations.
    pub all: Option<GroupScore>,
    /// Those within one trajectory.
    pub within: Option<GroupScore>,
    /// Those across two.
    pub across: Option<GroupScore>,
}

/// The score of a group of measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GroupScore {
    /// Measurements the figures are over.
    pub measurements: usize,
    /// The figures; `used` and `total` count relations.
    #[serde(flatten)]
    pub score: RelationScore,
}

/// Trajectories that hold the two stamps of a relation.
struct Measurement {
    relation: usize,
    from: usize,
    to: usize,
}

impl CrossingScores {
    /// Scores robots' trajectories.
    pub fn new(truth: &[TrueRelation], robots: &[StampedPoses]) -> Self {
        Self::scored(truth, robots, |secs, robot| robots[robot].at(secs))
    }

    /// Scores one trajectory on the measurements of the robots', whose poses do not matter.
    pub fn of_one(truth: &[TrueRelation], robots: &[StampedPoses], one: &StampedPoses) -> Self {
        Self::scored(truth, robots, |secs, _| one.at(secs))
    }

    fn scored(
        truth: &[TrueRelation],
        robots: &[StampedPoses],
        pose: impl Fn(f64, usize) -> Option<Pose2>,
    ) -> Self {
        let measurements = measurements(truth, robots);
        let group = |wanted: fn(&Measurement) -> bool, total: Option<usize>| {
            let (mut errors, mut used, mut asked) = (Vec::new(), BTreeSet::new(), BTreeSet::new());
            for m in measurements.iter().filter(|m| wanted(m)) {
                let relation = &truth[m.relation];
                asked.insert(m.relation);
                let poses = (pose(relation.from_secs, m.from), pose(relation.to_secs, m.to));
                if let (Some(from), Some(to)) = poses {
                    errors.push(relation_error(relation, from, to));
                    used.insert(m.relation);
                }
            }
            let total = total.unwrap_or(asked.len());
            let score = RelationScore::of_errors(&errors, used.len(), total)?;
            Some(GroupScore { measurements: errors.len(), score })
        };
        CrossingScores {
            all: group(|_| true, Some(truth.len())),
            within: group(|m| m.from == m.to, None),
            across: group(|m| m.from != m.to, None),
        }
    }

    /// One line per group for people.
    pub fn to_text(&self) -> String {
        let groups = [("all", &self.all), ("within", &self.within), ("across", &self.across)];
        let line = |(name, group): (&str, &Option<GroupScore>)| match group {
            Some(g) => {
                format!("{name:<7} measurements {}  {}\n", g.measurements, g.score.to_line())
            }
            None => format!("{name:<7} no relation\n"),
        };
        groups.map(line).concat()
    }
}

/// Every relation with every pair of trajectories that holds its stamps.
fn measurements(truth: &[TrueRelation], robots: &[StampedPoses]) -> Vec<Measurement> {
    let holding = |secs: f64| (0..robots.len()).filter(move |&i| robots[i].at(secs).is_some());
    let of = |relation: usize| {
        let to_secs = truth[relation].to_secs;
        holding(truth[relation].from_secs).flat_map(move |from| {
            holding(to_secs).map(move |to| Measurement { relation, from, to })
        })
    };
    (0..truth.len()).flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn relation(from: f64, to: f64, x: f64) -> TrueRelation {
        TrueRelation { from_secs: from, to_secs: to, from_from_to: Pose2::new(x, 0.0, 0.0) }
    }

    fn robot(poses: &[(f64, f64)]) -> StampedPoses {
        StampedPoses::new(poses.iter().map(|&(secs, x)| (secs, Pose2::new(x, 0.0, 0.0))))
    }

    /// Two robots share the scan at 2 s, and place it 0.1 m apart.
    #[test]
    fn shared_scans_are_measured_by_both() {
        let robots = [robot(&[(1.0, 0.0), (2.0, 1.0)]), robot(&[(2.0, 1.1), (3.0, 2.0)])];
        let truth = [relation(1.0, 2.0, 1.0), relation(1.0, 3.0, 2.5), relation(1.0, 9.0, 0.0)];
        let scores = CrossingScores::new(&truth, &robots);
        let figures = |group: &Option<GroupScore>| {
            group.map(|g| (g.measurements, g.score.used, g.score.total, g.score.trans_mean_m))
        };
        // 1 -> 2 within the first, 0; across, 0.1. 1 -> 3 across, 0.5.
        let close = |a: Option<(usize, usize, usize, f64)>, b: (usize, usize, usize, f64)| {
            let a = a.unwrap();
            assert_eq!((a.0, a.1, a.2), (b.0, b.1, b.2));
            assert!((a.3 - b.3).abs() < 1e-12, "{a:?} {b:?}");
        };
        close(figures(&scores.all), (3, 2, 3, 0.2));
        close(figures(&scores.within), (1, 1, 1, 0.0));
        close(figures(&scores.across), (2, 2, 2, 0.3));
    }

    #[test]
    fn another_trajectory_is_scored_on_the_same_measurements() {
        let robots = [robot(&[(1.0, 70.0), (2.0, 50.0)]), robot(&[(2.0, 9.0), (3.0, 8.0)])];
        let one = robot(&[(1.0, 0.0), (2.0, 1.0), (3.0, 2.0), (4.0, 3.0)]);
        let truth = [relation(1.0, 2.0, 1.2), relation(2.0, 3.0, 1.0), relation(3.0, 4.0, 7.0)];
        let scores = CrossingScores::of_one(&truth, &robots, &one);
        let across = scores.across.unwrap();
        assert_eq!((across.measurements, across.score.used), (2, 2));
        assert!((across.score.trans_mean_m - 0.1).abs() < 1e-12);
        // No robot holds the last relation's second stamp.
        assert_eq!(scores.all.unwrap().measurements, 4);
    }

    #[test]
    fn one_robot_has_nothing_across() {
        let truth = [relation(1.0, 2.0, 1.0)];
        let one = robot(&[(1.0, 0.0), (2.0, 1.0)]);
        let scores = CrossingScores::new(&truth, &[one]);
        assert!(scores.across.is_none() && scores.all == scores.within);
        assert!(scores.to_text().ends_with("across  no relation\n"));
    }
}
