use crate::benchmark::args::BenchCommand;
use crate::commands::cut::CutArgs;
use crate::commands::eval::RelationsArgs;
use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// One accurate, detailed map from laser logs.
#[derive(Debug, Parser)]
#[command(
    name = "manifoldslam",
    version,
    after_help = "Examples:\n  \
        manifoldslam demo\n  \
        manifoldslam map intel.clf.bz2 -o out/intel\n  \
        manifoldslam map robot1.clf robot2.clf robot3.clf -o out/team\n  \
        manifoldslam render out/intel --resolution 0.01 --crop=-5,-5,15,10 -o corner.png\n  \
        manifoldslam eval relations --relations intel.relations --traj out/intel/intel.tum\n  \
        manifoldslam bench matchers -o out/matchers\n\n\
        Exit codes: 0 fine, 1 failed, 2 wrong usage, 3 finished but some of the input was lost."
)]
pub struct Args {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Options of every command.
    #[command(flatten)]
    pub global: Global,
}

/// Options of every command.
#[derive(Clone, Debug, ClapArgs)]
pub struct Global {
    /// Print nothing but errors
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Print the result as JSON on standard output
    #[arg(long, global = true)]
    pub json: bool,
    /// Worker threads [default: one per core]; the result does not depend on it
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Map logs: poses, graph, map image and report in one folder
    Map(MapArgs),
    /// Optimise a pose graph in g2o format
    Optimize(OptimizeArgs),
    /// Draw a map again, at another resolution or cropped
    Render(RenderArgs),
    /// Say what is in a manifold file
    Info(InfoArgs),
    /// Take back parts of a map, or confirm them
    Edit(EditArgs),
    /// Save what can be saved of a damaged manifold file
    Salvage(SalvageArgs),
    /// Score a trajectory against the truth
    #[command(subcommand)]
    Eval(EvalCommand),
    /// Cut a log into the logs of several robots that know nothing of each other
    Cut(CutArgs),
    /// Show the configuration
    #[command(subcommand)]
    Config(ConfigCommand),
    /// Map a built-in synthetic building and compare the result with the truth
    Demo(DemoArgs),
    /// Compare parts of the program with each other and with published figures
    #[command(subcommand)]
    Bench(BenchCommand),
}

/// Where the configuration comes from.
#[derive(Clone, Debug, Default, PartialEq, ClapArgs)]
pub struct ConfigArgs {
    /// Configuration file, TOML; what it does not name keeps its default (see `config show`)
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The matcher that localises scans; all but `fast` are for comparison, and slow
    #[arg(long, value_name = "NAME", value_parser = matching::MATCHER_NAMES)]
    pub matcher: Option<String>,
    /// Use the log's odometry, or do without
    #[arg(long, value_name = "on|off")]
    pub odometry: Option<Switch>,
    /// Side of a map cell, metres
    #[arg(long, value_name = "METRES", value_parser = positive)]
    pub resolution: Option<f64>,
}

/// On or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// On.
    On,
    /// Off.
    Off,
}

/// Arguments of `map`.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "The folder holds map.png, map.pgm and map.yaml (ROS map_server), LOG.tum (the base pose \
    of every scan), graph.g2o, patches.csv, config.toml, metrics.json and report.html, and site.manifold, the map \
    with everything it was made from. Several logs are taken for \
    robots of one team that know nothing of each other's start: what the evidence says belongs together becomes \
    one map, the rest islands (map.png the largest, map-2.png the next). A robot is called what its log is \
    called; the order of the logs does not matter. Where a robot's data went bad (carried, fallen, laser \
    covered) its map is cut: those scans are left out, and what is on another island is in LOG.2.tum.\n\n\
    Examples:\n  \
    manifoldslam map intel.clf.bz2 -o out/intel\n  \
    manifoldslam map --odometry off aces.clf.bz2 -o out/aces\n  \
    manifoldslam map robot1.clf robot2.clf robot3.clf -o out/team\n  \
    manifoldslam map day2.clf --onto out/team/site.manifold\n  \
    manifoldslam map --separately --json day1.clf day2.clf.gz -o out > metrics.json"
)]
pub struct MapArgs {
    /// CARMEN logs: plain, gzip or bzip2
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Result folder; replaced if it is an older result [with --onto: default is the folder of
    /// FILE, if that is a result]
    #[arg(long, short, value_name = "DIR", required_unless_present = "onto")]
    pub output: Option<PathBuf>,
    /// Add the logs to the map in this manifold file: another robot, another day, or a run that was
    /// interrupted
    #[arg(long, value_name = "FILE", conflicts_with = "separately")]
    pub onto: Option<PathBuf>,
    /// Map every log by itself, each into its own folder below DIR
    #[arg(long)]
    pub separately: bool,
    /// Where the configuration comes from.
    #[command(flatten)]
    pub config: ConfigArgs,
}

/// Arguments of `optimize`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "Examples:\n  \
    manifoldslam optimize M3500.g2o -o better.g2o\n  \
    manifoldslam optimize --robust doubtful.g2o -o better.g2o\n  \
    manifoldslam optimize --kernel dcs --scale 9 doubtful.g2o -o better.g2o")]
pub struct OptimizeArgs {
    /// Pose graph to read, in the plane or in space
    #[arg(value_name = "IN.g2o")]
    pub input: PathBuf,
    /// Pose graph to write
    #[arg(long, short, value_name = "OUT.g2o")]
    pub output: PathBuf,
    /// Find out which loop closures are wrong and leave them out
    #[arg(long, conflicts_with_all = ["kernel", "spanning_tree"])]
    pub robust: bool,
    /// Robust kernel on loop closures
    #[arg(long, value_enum, default_value = "none")]
    pub kernel: KernelName,
    /// Scale of the kernel: squared Mahalanobis length at which it begins to doubt
    #[arg(long, value_name = "CHI2", default_value_t = 9.0, value_parser = positive)]
    pub scale: f64,
    /// Apply the kernel to every edge, not to closures alone
    #[arg(long)]
    pub all_edges: bool,
    /// Most iterations
    #[arg(long, value_name = "N", default_value_t = 100)]
    pub iterations: usize,
    /// Method of stepping
    #[arg(long, value_enum, default_value = "levenberg-marquardt")]
    pub method: MethodName,
    /// Start from the measurements along a spanning tree, not from the file's poses
    #[arg(long)]
    pub spanning_tree: bool,
}

/// Robust kernels by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum KernelName {
    /// Plain least squares.
    None,
    /// Huber.
    Huber,
    /// Cauchy.
    Cauchy,
    /// Dynamic covariance scaling.
    Dcs,
    /// Geman-McClure.
    GemanMcclure,
    /// Truncated least squares.
    Truncated,
}

/// Methods by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MethodName {
    /// Undamped.
    GaussNewton,
    /// Damped.
    LevenbergMarquardt,
}

/// Arguments of `render`.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "The ending of OUT decides: .png (annotated image), .pgm (with a .yaml beside it, for ROS \
    map_server), .svg (outlines).\n\n\
    Examples:\n  \
    manifoldslam render out/intel --resolution 0.01 --crop=-5,-5,15,10 -o corner.png\n  \
    manifoldslam render out/team --island 2 -o second.png\n  \
    manifoldslam render site.manifold --all-scans -o dense.png\n  \
    manifoldslam render intel.tum --log intel.clf.bz2 -o plan.svg"
)]
pub struct RenderArgs {
    /// A result folder, a manifold file, or a trajectory with one pose for every scan of --log
    #[arg(value_name = "RESULT|FILE|TUM")]
    pub source: PathBuf,
    /// The log of a trajectory
    #[arg(long, value_name = "LOG")]
    pub log: Vec<PathBuf>,
    /// Which of the maps to draw, largest first
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub island: u32,
    /// Draw only this level of the map, 0 the lowest
    #[arg(long, value_name = "K")]
    pub level: Option<usize>,
    /// Image to write; of several levels each is drawn, as OUT-level-0.png and so on, and OUT.png
    /// is a sheet of all
    #[arg(long, short, value_name = "OUT")]
    pub output: PathBuf,
    /// Side of a cell, metres [default: as configured]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    pub resolution: Option<f64>,
    /// Part of the map to draw, metres
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = crop, allow_hyphen_values = true)]
    pub crop: Option<Crop>,
    /// Draw walls only: no path, no scale bar
    #[arg(long)]
    pub bare: bool,
    /// Draw an arrow along map y
    #[arg(long)]
    pub north: bool,
    /// Use every scan, not only patches or scans a little apart
    #[arg(long)]
    pub all_scans: bool,
}

/// A rectangle of the map frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crop {
    /// Lower-left corner.
    pub min: (f64, f64),
    /// Upper-right corner.
    pub max: (f64, f64),
}

/// Arguments of `info`.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Works beside a program that is writing to the file. Exit code 1, with the reason, when the file is \
    damaged, newer than this program or something else.\n\n\
    Examples:\n  \
    manifoldslam info site.manifold\n  \
    manifoldslam info --relations site.manifold\n  \
    manifoldslam info --verify --json site.manifold"
)]
pub struct InfoArgs {
    /// Manifold file
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// List closures and merges with their numbers, for `edit`
    #[arg(long)]
    pub relations: bool,
    /// Also rebuild the map from its journal and compare it bit by bit; check the database itself
    #[arg(long)]
    pub verify: bool,
}

/// Arguments of `edit`.
#[derive(Debug, ClapArgs)]
#[command(
    group(clap::ArgGroup::new("edits").required(true).multiple(true)),
    after_help = "The map becomes what it would be without what is taken back; `info --relations` lists \
    what there is. What a user has split is not joined again by itself. Where FILE lies in a result folder, that is \
    brought up to date.\n\n\
    Examples:\n  \
    manifoldslam edit out/team/site.manifold --retract 1417\n  \
    manifoldslam edit out/team/site.manifold --split robot2\n  \
    manifoldslam edit out/team/site.manifold --leave-out robot3"
)]
pub struct EditArgs {
    /// Manifold file
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Take back a closure or a merge's relation
    #[arg(long, value_name = "ID", group = "edits")]
    pub retract: Vec<u32>,
    /// Make a provisional merge, or a relation that was taken back, part of the map
    #[arg(long, value_name = "ID", group = "edits")]
    pub confirm: Vec<u32>,
    /// Take back all that joins a robot to others; without a name, all that joins robots
    #[arg(long, value_name = "ROBOT", group = "edits", num_args = 0..=1, default_missing_value = "")]
    pub split: Vec<String>,
    /// Leave a robot's patches out of the map
    #[arg(long, value_name = "ROBOT", group = "edits")]
    pub leave_out: Vec<String>,
    /// Take a robot's patches in again
    #[arg(long, value_name = "ROBOT", group = "edits")]
    pub take_in: Vec<String>,
}

/// Arguments of `salvage`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "Exit code 3 when something was lost: what is printed.\n\n\
    Example:\n  manifoldslam salvage broken.manifold -o site.manifold")]
pub struct SalvageArgs {
    /// Damaged manifold file; it is not changed
    #[arg(value_name = "BROKEN")]
    pub broken: PathBuf,
    /// Manifold file to write; must not exist
    #[arg(long, short, value_name = "NEW")]
    pub output: PathBuf,
}

/// Commands of `eval`.
#[derive(Debug, Subcommand)]
pub enum EvalCommand {
    /// Score against true relative poses (Kuemmerle et al. 2009)
    Relations(RelationsArgs),
    /// Absolute trajectory error after the best rigid alignment in the plane
    Ate(AteArgs),
}

/// Arguments of `eval ate`.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Example:\n  manifoldslam eval ate --truth truth.tum --traj out/demo/demo.tum"
)]
pub struct AteArgs {
    /// True trajectory: TUM, or `t x y yaw`
    #[arg(long, value_name = "FILE")]
    pub truth: PathBuf,
    /// Estimated trajectory
    #[arg(long, value_name = "FILE")]
    pub traj: PathBuf,
}

/// Commands of `config`.
#[derive(Debug, Subcommand)]
pub enum ConfigCommand {
    /// Print the effective configuration as TOML
    #[command(
        after_help = "Example:\n  manifoldslam config show > my.toml; manifoldslam map --config my.toml ..."
    )]
    Show(ConfigArgs),
}

/// Arguments of `demo`.
#[derive(Debug, ClapArgs)]
pub struct DemoArgs {
    /// Result folder
    #[arg(long, short, value_name = "DIR", default_value = "out/demo")]
    pub output: PathBuf,
    /// Seed of the building's furniture and of all noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Where the configuration comes from.
    #[command(flatten)]
    pub config: ConfigArgs,
}

pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("must be a number above zero".into()),
    }
}

fn crop(text: &str) -> Result<Crop, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse())
        .collect::<Result<_, _>>()
        .map_err(|_| "must be four numbers X0,Y0,X1,Y1".to_owned())?;
    match numbers[..] {
        [x0, y0, x1, y1] if x0 < x1 && y0 < y1 => Ok(Crop { min: (x0, y0), max: (x1, y1) }),
        _ => Err("must be four numbers X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed() {
        Args::command().debug_assert();
    }

    #[test]
    fn crops_are_rectangles() {
        let expected = Crop { min: (-5.0, -5.0), max: (15.0, 10.5) };
        assert_eq!(crop("-5,-5, 15,10.5"), Ok(expected));
        for bad in ["", "1,2,3", "1,2,3,4,5", "a,b,c,d", "3,0,1,1", "0,0,nan,1"] {
            assert!(crop(bad).is_err(), "{bad}");
        }
    }
}
