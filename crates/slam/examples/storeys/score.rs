use manifold::{GroundKind, Provenance};
use manifoldslam_slam::Mapper;
use synthetic::{StoreysRun, trajectory_error};

/// A map of storeys against the truth.
pub struct Score {
    levels: usize,
    islands: usize,
    /// Shares of the patches on floors, and of all patches, that are on the right level.
    floors_right: f64,
    all_right: f64,
    closures: usize,
    crossing: usize,
    ate_m: f64,
    height_rms_m: f64,
    height_worst_m: f64,
    ramps: usize,
    tipped: usize,
}

impl Score {
    pub const HEADER: &str = "kind        seed levels islands floors% all%  closures crossing  ate m \
                              height rms, worst m  ramp patches tipped";

    pub fn new(driven: &StoreysRun, mapper: &Mapper, patch_scans: &[usize]) -> Score {
        let manifold = mapper.manifold();
        let islands = manifold.islands();
        let levels = manifold.levels(&islands[0]);
        let storey = |patch: manifold::PatchId| driven.storey(patch_scans[patch.index()]);
        let right = |m: &&manifold::LevelMember| m.level == storey(m.patch);
        let floors = || {
            let members = levels.members.iter();
            members.filter(|m| driven.on_floor(patch_scans[m.patch.index()]))
        };
        let closures =
            || manifold.active_relations().filter(|r| r.provenance != Provenance::Sequential);
        let off = |m: &manifold::LevelMember| {
            let first = driven.heights_m[0];
            let height = manifold.patch(m.patch).elevation.map_or(0.0, |e| e.height_m);
            height - (driven.heights_m[patch_scans[m.patch.index()]] - first)
        };
        let share = |part: usize, all: usize| part as f64 / all.max(1) as f64;
        let members = levels.members.len();
        let squares: f64 = levels.members.iter().map(|m| off(m).powi(2)).sum();
        Score {
            levels: levels.heights_m.len(),
            islands: islands.len(),
            floors_right: share(floors().filter(right).count(), floors().count()),
            all_right: share(levels.members.iter().filter(right).count(), members),
            closures: closures().count(),
            crossing: closures()
                .filter(|r| {
                    let height = |p: manifold::PatchId| driven.heights_m[patch_scans[p.index()]];
                    (height(r.from) - height(r.to)).abs() > 1.0
                })
                .count(),
            ate_m: trajectory_error(&driven.run.truth, &mapper.trajectory()),
            height_rms_m: (squares / members.max(1) as f64).sqrt(),
            height_worst_m: levels.members.iter().map(|m| off(m).abs()).fold(0.0, f64::max),
            ramps: levels.members.iter().filter(|m| m.ground == GroundKind::Ramp).count(),
            tipped: mapper.statistics().tipped,
        }
    }

    /// The bar of issue 4: all levels found, 99 % of the patches right, nothing closed across
    /// levels, 5 cm.
    pub fn passes(&self, storeys: usize) -> bool {
        self.levels == storeys
            && self.islands == 1
            && self.floors_right >= 0.99
            && self.crossing == 0
            && self.ate_m <= 0.05
    }

    pub fn row(&self, kind: &str, seed: u64) -> String {
        format!(
            "{kind:<11} {seed:>4} {:>6} {:>7} {:>7.2} {:>6.2} {:>8} {:>8} {:>6.3} {:>8.3} {:>7.3} \
             {:>10} {:>6}",
            self.levels,
            self.islands,
            100.0 * self.floors_right,
            100.0 * self.all_right,
            self.closures,
            self.crossing,
            self.ate_m,
            self.height_rms_m,
            self.height_worst_m,
            self.ramps,
            self.tipped,
        )
    }
}
