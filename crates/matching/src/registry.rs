use crate::{
    BranchAndBoundMatcher, CombinedMatcher, CorrelativeMatcher, FieldMatcher, GicpMatcher,
    IcpMatcher, IdcMatcher, Matcher, MbIcpMatcher, NdtD2dMatcher, NdtMatcher, PlIcpMatcher,
    VgicpMatcher, WsmMatcher, WsmSettings,
};
use serde::{Deserialize, Serialize};

/// Every matcher there is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MatcherKind {
    /// Plain point-to-point ICP.
    Icp,
    /// Iterative Dual Correspondence.
    Idc,
    /// ICP in the metric of motions.
    #[serde(rename = "mbicp")]
    MbIcp,
    /// The Normal Distributions Transform.
    Ndt,
    /// The Normal Distributions Transform, distributions to distributions.
    NdtD2d,
    /// ICP across the reference's lines.
    #[serde(rename = "plicp")]
    PlIcp,
    /// Generalised ICP, plane to plane.
    Gicp,
    /// Generalised ICP against averages in voxels.
    Vgicp,
    /// The Weighted Scan Matcher with a calibrated covariance.
    Wsm,
    /// The Weighted Scan Matcher as the thesis has it.
    WsmThesis,
    /// Weighted point-to-line on a surfel field: the production matcher.
    #[default]
    Fast,
    /// Olson's correlative search.
    Correlative,
    /// Wide search by branch and bound.
    BranchAndBound,
    /// A wide search where the guess is weak, then the fast matcher.
    Combined,
}

/// The names that [`matcher`] knows.
pub const MATCHER_NAMES: [&str; 14] = [
    MatcherKind::Icp.name(),
    MatcherKind::Idc.name(),
    MatcherKind::MbIcp.name(),
    MatcherKind::Ndt.name(),
    MatcherKind::NdtD2d.name(),
    MatcherKind::PlIcp.name(),
    MatcherKind::Gicp.name(),
    MatcherKind::Vgicp.name(),
    MatcherKind::Wsm.name(),
    MatcherKind::WsmThesis.name(),
    MatcherKind::Fast.name(),
    MatcherKind::Correlative.name(),
    MatcherKind::BranchAndBound.name(),
    MatcherKind::Combined.name(),
];

impl MatcherKind {
    /// All of them, in the order of [`MATCHER_NAMES`].
    pub const ALL: [MatcherKind; MATCHER_NAMES.len()] = [
        MatcherKind::Icp,
        MatcherKind::Idc,
        MatcherKind::MbIcp,
        MatcherKind::Ndt,
        MatcherKind::NdtD2d,
        MatcherKind::PlIcp,
        MatcherKind::Gicp,
        MatcherKind::Vgicp,
        MatcherKind::Wsm,
        MatcherKind::WsmThesis,
        MatcherKind::Fast,
        MatcherKind::Correlative,
        MatcherKind::BranchAndBound,
        MatcherKind::Combined,
    ];

    /// The name on the command line and in the configuration.
    pub const fn name(self) -> &'static str {
        match self {
            MatcherKind::Icp => "icp",
            MatcherKind::Idc => "idc",
            MatcherKind::MbIcp => "mbicp",
            MatcherKind::Ndt => "ndt",
            MatcherKind::NdtD2d => "ndt-d2d",
            MatcherKind::PlIcp => "plicp",
            MatcherKind::Gicp => "gicp",
            MatcherKind::Vgicp => "vgicp",
            MatcherKind::Wsm => "wsm",
            MatcherKind::WsmThesis => "wsm-thesis",
            MatcherKind::Fast => "fast",
            MatcherKind::Correlative => "correlative",
            MatcherKind::BranchAndBound => "branch-and-bound",
            MatcherKind::Combined => "combined",
        }
    }

    /// The matcher of this name; `None` for an unknown one.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The matcher with its default settings.
    pub fn build(self) -> Box<dyn Matcher> {
        match self {
            MatcherKind::Icp => Box::new(IcpMatcher::default()),
            MatcherKind::Idc => Box::new(IdcMatcher::default()),
            MatcherKind::MbIcp => Box::new(MbIcpMatcher::default()),
            MatcherKind::Ndt => Box::new(NdtMatcher::default()),
            MatcherKind::NdtD2d => Box::new(NdtD2dMatcher::default()),
            MatcherKind::PlIcp => Box::new(PlIcpMatcher::default()),
            MatcherKind::Gicp => Box::new(GicpMatcher::default()),
            MatcherKind::Vgicp => Box::new(VgicpMatcher::default()),
            MatcherKind::Wsm => Box::new(WsmMatcher::default()),
            MatcherKind::WsmThesis => Box::new(WsmMatcher { settings: WsmSettings::thesis() }),
            MatcherKind::Fast => Box::new(FieldMatcher::default()),
            MatcherKind::Correlative => Box::new(CorrelativeMatcher::default()),
            MatcherKind::BranchAndBound => Box::new(BranchAndBoundMatcher::default()),
            MatcherKind::Combined => Box::new(CombinedMatcher::default()),
        }
    }
}

/// A matcher with its default settings, by name; `None` for an unknown name.
pub fn matcher(name: &str) -> Option<Box<dyn Matcher>> {
    MatcherKind::named(name).map(MatcherKind::build)
}
