use super::contender::{Contender, Pair, cloud};
use super::degenerate::Statuses;
use super::own_scans::options;
use anyhow::{Result, bail};
use geometry::{Pose2, wrap_angle};
use indicatif::ProgressBar;
use logs::{CarmenReader, LogFile, LogRecord};
use matching::MatchResult;
use matching::protocol::median;
use rayon::prelude::*;
use serde::Serialize;
use std::path::Path;

/// A scan is taken up when the robot has driven or turned so far since the last one: about as
/// far as patches lie apart.
const STEP_M: f64 = 0.3;
const STEP_RAD: f64 = std::f64::consts::PI / 18.0;
/// Scans farther apart than this follow a gap or a jump of the log.
const JUMP_M: f64 = 1.0;
const JUMP_RAD: f64 = std::f64::consts::FRAC_PI_4;

/// How far the matchers agree on a real log.
#[derive(Debug, Serialize)]
pub struct LogResult {
    /// The log's name.
    pub log: String,
    /// Pairs of scans.
    pub pairs: usize,
    /// Pairs that so few matchers found usable that there is no consensus.
    pub without_consensus: usize,
    /// The matchers, as they were named.
    pub matchers: Vec<LogFigures>,
}

/// One matcher's answers against the consensus: of every coordinate the median over the matchers
/// that called their answer usable.
#[derive(Debug, Serialize)]
pub struct LogFigures {
    /// The matcher.
    pub matcher: String,
    /// Difference in translation: median and 95 % quantile, metres.
    pub translation_median_m: f64,
    /// See above.
    pub translation_95_m: f64,
    /// Difference in yaw: median and 95 % quantile, degrees.
    pub yaw_median_deg: f64,
    /// See above.
    pub yaw_95_deg: f64,
    /// Median inlier ratio.
    pub inlier_ratio: f64,
    /// How its matches ended.
    #[serde(flatten)]
    pub statuses: Statuses,
    /// Mean number of iterations.
    pub iterations: f64,
    /// Median time of a match, milliseconds.
    pub median_time_ms: f64,
}

/// Reads a log's pairs of scans; true beside them when some of the log was lost.
pub fn read_pairs(log: &Path, most: usize) -> Result<(Vec<Pair>, bool)> {
    let mut reader = CarmenReader::new(LogFile::open(log)?.input, options()).with_name(log);
    let mut pairs: Vec<(LogRecord, LogRecord)> = Vec::new();
    let mut last: Option<LogRecord> = None;
    for record in reader.by_ref() {
        let Some(pose) = record.observation.odom_from_base else { continue };
        let Some(before) = last.take() else {
            last = Some(record);
            continue;
        };
        let step = before.observation.odom_from_base.unwrap_or(pose).between(&pose);
        if step.norm() < STEP_M && step.yaw.abs() < STEP_RAD {
            last = Some(before);
            continue;
        }
        if step.norm() < JUMP_M && step.yaw.abs() < JUMP_RAD {
            pairs.push((before, record.clone()));
        }
        last = Some(record);
    }
    let lossy = reader.finish().is_lossy();
    if pairs.is_empty() {
        bail!("{}: no two scans with odometry that lie 0.3 m or 10 degrees apart", log.display());
    }
    let kept = most.min(pairs.len());
    // Evenly spread over the whole log.
    let chosen = (0..kept).map(|k| &pairs[k * pairs.len() / kept]);
    let pairs = chosen
        .map(|(a, b)| {
            let [a, b] = [&a.observation, &b.observation];
            let odometry = |seen: &sensing::Observation| seen.odom_from_base.unwrap_or_default();
            Pair {
                reference: cloud(&a.scan, &a.base_from_laser),
                scan: cloud(&b.scan, &b.base_from_laser),
                truth: odometry(a).between(&odometry(b)),
            }
        })
        .collect();
    Ok((pairs, lossy))
}

/// Matches every pair from its odometry and compares the answers.
pub fn agree(name: &str, pairs: &[Pair], contenders: &[Contender], bar: &ProgressBar) -> LogResult {
    let answers: Vec<Vec<(MatchResult, f64)>> = contenders
        .iter()
        .map(|contender| {
            bar.set_message(contender.name);
            let one = |pair: &Pair| {
                let answer = contender.timed(pair, &pair.truth);
                bar.inc(1);
                answer
            };
            pairs.par_iter().map(one).collect()
        })
        .collect();
    let consensus: Vec<Option<Pose2>> = (0..pairs.len())
        .map(|k| consensus(&pairs[k].truth, answers.iter().map(|all| &all[k].0)))
        .collect();
    let figures = contenders.iter().zip(&answers);
    LogResult {
        log: name.to_owned(),
        pairs: pairs.len(),
        without_consensus: consensus.iter().filter(|pose| pose.is_none()).count(),
        matchers: figures.map(|(c, answers)| sum_up(c.name, answers, &consensus)).collect(),
    }
}

/// Needs three usable answers: fewer have no middle.
fn consensus<'a>(
    odometry: &Pose2,
    answers: impl Iterator<Item = &'a MatchResult>,
) -> Option<Pose2> {
    let usable: Vec<Pose2> = answers.filter(|a| a.status.is_usable()).map(|a| a.pose).collect();
    if usable.len() < 3 {
        return None;
    }
    let middle = |value: &dyn Fn(&Pose2) -> f64| median(usable.iter().map(value));
    // Turns are compared around the odometry's, so that none wraps.
    let turn = middle(&|p| wrap_angle(p.yaw - odometry.yaw))?;
    Some(Pose2::new(middle(&|p| p.x)?, middle(&|p| p.y)?, odometry.yaw + turn))
}

fn sum_up(name: &str, answers: &[(MatchResult, f64)], consensus: &[Option<Pose2>]) -> LogFigures {
    let both = || answers.iter().zip(consensus).filter_map(|((a, _), c)| Some((a.pose, (*c)?)));
    let translations = sorted(both().map(|(a, c)| (a.translation() - c.translation()).norm()));
    let yaws = sorted(both().map(|(a, c)| wrap_angle(a.yaw - c.yaw).abs().to_degrees()));
    let iterations: f64 = answers.iter().map(|(a, _)| f64::from(a.iterations)).sum();
    LogFigures {
        matcher: name.to_owned(),
        translation_median_m: quantile(&translations, 0.5),
        translation_95_m: quantile(&translations, 0.95),
        yaw_median_deg: quantile(&yaws, 0.5),
        yaw_95_deg: quantile(&yaws, 0.95),
        inlier_ratio: median(answers.iter().map(|(a, _)| a.inlier_ratio)).unwrap_or_default(),
        statuses: Statuses::of(answers.iter().map(|(a, _)| a)),
        iterations: iterations / answers.len().max(1) as f64,
        median_time_ms: 1e3 * median(answers.iter().map(|(_, secs)| *secs)).unwrap_or_default(),
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Of sorted values; zero without any.
fn quantile(values: &[f64], share: f64) -> f64 {
    let last = values.len().saturating_sub(1) as f64;
    values.get((share * last).round() as usize).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use matching::MatchStatus;

    #[test]
    fn the_consensus_is_the_middle_of_what_is_usable() {
        let answer = |x: f64, yaw: f64, status: MatchStatus| MatchResult {
            pose: Pose2::new(x, 0.0, yaw),
            covariance: Default::default(),
            inlier_ratio: 1.0,
            iterations: 1,
            status,
        };
        let converged = MatchStatus::Converged;
        // Across the turn where yaw wraps.
        let mut answers = vec![answer(1.0, 3.1, converged), answer(1.2, -3.1, converged)];
        let odometry = Pose2::new(1.0, 0.0, 3.0);
        assert_eq!(consensus(&odometry, answers.iter()), None);
        answers.push(answer(9.0, 3.12, converged));
        answers.push(answer(77.0, 0.0, MatchStatus::Diverged));
        let found = consensus(&odometry, answers.iter()).unwrap();
        assert!((found.x - 1.2).abs() < 1e-12 && (found.yaw - 3.12).abs() < 1e-12, "{found:?}");
    }
}
