use crate::Outcome;
use crate::args::{AteArgs, Global, RelationsArgs};
use crate::scoring::{AteScore, RelationScore, StampedPoses};
use crate::terminal::print;
use anyhow::{Result, bail};
use geometry::Pose2;
use logs::{open_relations, open_tum};

/// Scores a trajectory against true relations.
pub fn relations(args: &RelationsArgs, global: &Global) -> Result<Outcome> {
    let truth = open_relations(&args.relations)?;
    let poses = StampedPoses::of_tum(&open_tum(&args.traj)?);
    let Some(score) = RelationScore::new(&truth, &poses) else {
        bail!("no relation has both its stamps in the trajectory");
    };
    print(global, &score.to_line(), &score)?;
    if !score.is_complete() {
        bail!("only {} of {} relations could be used", score.used, score.total);
    }
    Ok(Outcome::Fine)
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
