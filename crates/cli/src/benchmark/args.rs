use crate::args::positive;
use clap::{Args as ClapArgs, Subcommand};
use geometry::Pose2;
use std::path::PathBuf;

/// What can be compared: the four situations of the thesis, then places of other kinds.
pub const PLACE_NAMES: [&str; 7] =
    ["lobby", "corridor", "wood", "same-scan", "rooms", "submap", "degenerate"];

/// Commands of `bench`.
#[derive(Debug, Subcommand)]
pub enum BenchCommand {
    /// Compare the scan matchers by the protocol of the ManifoldSLAM thesis, and more
    Matchers(MatchersArgs),
}

/// Arguments of `bench matchers`.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Four situations as in the ManifoldSLAM thesis (2006, section 7.1): lobby, corridor, wood, \
    same-scan. From 85 disturbed guesses each, repeated with fresh noise, the error \
    sqrt(dx^2 + dy^2 + (3 m)^2 dyaw^2) in nine cells. Then rooms and submap: error over the Cramer-Rao \
    bound; degenerate: a plain corridor and a round room. Times are medians over all matches, taken while \
    others run: use --threads 1 on an idle machine for undisturbed ones.\n\n\
    The folder holds matchers.md, matchers.csv (and accuracy.csv, degenerate.csv, log.csv), scans.png, \
    errors.png, error-time.png, basins.png and metrics.json.\n\n\
    Examples:\n  \
    manifoldslam bench matchers -o out/matchers\n  \
    manifoldslam bench matchers --matcher plicp --matcher wsm --situation lobby --repeats 3\n  \
    manifoldslam bench matchers --noise 0.03 --situation rooms --situation submap\n  \
    manifoldslam bench matchers --scans intel.clf.bz2:100 intel.clf.bz2:104 -o out/pair\n  \
    manifoldslam bench matchers --log intel.clf.bz2 --pairs 100"
)]
pub struct MatchersArgs {
    /// Result folder; replaced if it is an older result [default: print only]
    #[arg(long, short, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// A matcher to compare; may be given several times [default: all]
    #[arg(long, value_name = "NAME", value_parser = matching::MATCHER_NAMES)]
    pub matcher: Vec<String>,
    /// Where to compare; may be given several times [default: everywhere]
    #[arg(long, value_name = "NAME", value_parser = PLACE_NAMES)]
    pub situation: Vec<String>,
    /// How often the 85 guesses are tried, each time with fresh noise
    #[arg(long, value_name = "N", default_value_t = 15,
        value_parser = clap::value_parser!(u16).range(1..=10_000))]
    pub repeats: u16,
    /// Gaussian range noise [default: USARSim's, 0.1 % of the range, in the four situations; 0.015
    /// elsewhere]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    pub noise: Option<f64>,
    /// Seed of all noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Pairs of scans in `rooms`, `submap` and `degenerate`
    #[arg(long, value_name = "N", default_value_t = 200,
        value_parser = clap::value_parser!(u16).range(1..=20_000))]
    pub rooms: u16,
    /// Leave out the heat maps of how far off a guess may be
    #[arg(long)]
    pub no_basins: bool,
    /// Two scans of one's own: the first of a CARMEN log, or the N-th by LOG:N or LOG#N
    #[arg(long, value_names = ["A", "B"], num_args = 2, conflicts_with_all = ["situation", "log"])]
    pub scans: Option<Vec<String>>,
    /// True pose of B seen from A [default: what the first matcher finds]
    #[arg(long, value_name = "X,Y,YAW_DEG", value_parser = pose, allow_hyphen_values = true,
        requires = "scans")]
    pub truth: Option<Pose2>,
    /// A real log: how far do the matchers agree on scans a little apart?
    #[arg(long, value_name = "LOG", conflicts_with = "situation")]
    pub log: Option<PathBuf>,
    /// At most this many pairs of the log
    #[arg(long, value_name = "N", default_value_t = 200, requires = "log",
        value_parser = clap::value_parser!(u16).range(1..))]
    pub pairs: u16,
}

impl MatchersArgs {
    /// Is this place to be compared at?
    pub fn wants(&self, place: &str) -> bool {
        let own = self.scans.is_some() || self.log.is_some();
        !own && (self.situation.is_empty() || self.situation.iter().any(|name| name == place))
    }
}

fn pose(text: &str) -> Result<Pose2, String> {
    let wrong = || "must be three numbers X,Y,YAW_DEG: metres and degrees".to_owned();
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse())
        .collect::<Result<_, _>>()
        .map_err(|_| wrong())?;
    match numbers[..] {
        [x, y, yaw] if [x, y, yaw].iter().all(|v| v.is_finite()) => {
            Ok(Pose2::new(x, y, yaw.to_radians()))
        }
        _ => Err(wrong()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_three_numbers() {
        let found = pose("1, -0.5,90").unwrap_or_default();
        assert!((found.yaw.to_degrees() - 90.0).abs() < 1e-12 && found.y == -0.5);
        for bad in ["", "1,2", "1,2,3,4", "a,b,c", "1,2,nan"] {
            assert!(pose(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_situations_are_the_places_first_named() {
        let names = synthetic::Situation::ALL.map(synthetic::Situation::name);
        assert_eq!(PLACE_NAMES[..4], names);
    }
}
