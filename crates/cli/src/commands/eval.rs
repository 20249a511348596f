use crate::Outcome;
use crate::args::{AteArgs, Global};
use crate::crossing::CrossingScores;
use crate::scoring::{AteScore, RelationScore, StampedPoses};
use crate::terminal::print;
use anyhow::{Result, bail};
use clap::Args;
use geometry::Pose2;
use logs::{open_relations, open_tum};
use std::path::{Path, PathBuf};

/// Arguments of `eval relations`.
#[derive(Debug, Args)]
#[command(
    after_help = "Several trajectories are robots' in one map frame. A relation is measured once for every pair of \
    them that holds its stamps, the first in the first, the second in the second: within a trajectory where both are \
    the same, else across. A scan that two robots share is thus measured by both. `used` counts relations, \
    `measurements` measurements; figures are over measurements. --across-of scores one trajectory on the \
    measurements of others, for comparison: whoever holds the stamps, the poses are those of --traj.\n\n\
    Exit code 1 when fewer than 95 % of the relations could be used.\n\n\
    Examples:\n  \
    manifoldslam eval relations --relations intel.relations --traj out/intel/intel.tum\n  \
    manifoldslam eval relations --relations intel.relations --traj out/intel-1.tum out/intel-2.tum\n  \
    manifoldslam eval relations --relations intel.relations --traj out/intel/intel.tum \
    --across-of out/intel-1.tum out/intel-2.tum"
)]
pub struct RelationsArgs {
    /// Lines `t1 t2 x y z roll pitch yaw`: the pose at t2 seen from t1
    #[arg(long, value_name = "FILE")]
    relations: PathBuf,
    /// Trajectories, in one frame: TUM, or `t x y yaw`
    #[arg(long, value_name = "FILE", required = true, num_args = 1..)]
    traj: Vec<PathBuf>,
    /// Trajectories that say which relations lie across robots; their poses do not matter
    #[arg(long, value_name = "FILE", num_args = 2..)]
    across_of: Vec<PathBuf>,
}

/// Scores trajectories against true relations.
pub fn relations(args: &RelationsArgs, global: &Global) -> Result<Outcome> {
    let truth = open_relations(&args.relations)?;
    let poses: Vec<StampedPoses> = args.traj.iter().map(|p| stamped(p)).collect::<Result<_>>()?;
    let (used, total) = match (&poses[..], args.across_of.is_empty()) {
        ([one], true) => {
            let Some(score) = RelationScore::new(&truth, one) else {
                bail!("no relation has both its stamps in the trajectory");
            };
            print(global, &score.to_line(), &score)?;
            (score.used, score.total)
        }
        (several, true) => told(&CrossingScores::new(&truth, several), global)?,
        ([one], false) => {
            let robots: Vec<_> =
                args.across_of.iter().map(|p| stamped(p)).collect::<Result<_>>()?;
            told(&CrossingScores::of_one(&truth, &robots, one), global)?
        }
        _ => bail!("--across-of compares with one trajectory; give --traj a single file"),
    };
    if (used as f64) < 0.95 * total as f64 {
        bail!("only {used} of {total} relations could be used");
    }
    Ok(Outcome::Fine)
}

/// Prints the scores; relations used, and all.
fn told(scores: &CrossingScores, global: &Global) -> Result<(usize, usize)> {
    let Some(all) = &scores.all else {
        bail!("no relation has both its stamps in the trajectories");
    };
    print(global, &scores.to_text(), scores)?;
    Ok((all.score.used, all.score.total))
}

fn stamped(path: &Path) -> Result<StampedPoses> {
    Ok(StampedPoses::of_tum(&open_tum(path)?))
}

/// Scores a trajectory against a true trajectory.
pub fn ate(args: &AteArgs, global: &Global) -> Result<Outcome> {
    let truth = StampedPoses::of_tum(&open_tum(&args.truth)?);
    let estimate = open_tum(&args.traj)?;
    let pairs: Vec<(Pose2, Pose2)> = estimate
        .iter()
        .filter_map(|pose| Some((truth.at(pose.stamp_text.parse().ok()?)?, pose.pose)))
        .collect();
    let Some(score) = AteScore::new(&pairs) else {
        bail!("the trajectories have no stamp in common");
    };
    let missing = estimate.len() - pairs.len();
    let mut text = score.to_line();
    if missing > 0 {
        text.push_str(&format!("\n{missing} of {} poses have no truth", estimate.len()));
    }
    print(global, &text, &score)?;
    Ok(Outcome::Fine)
}
