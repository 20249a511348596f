use crate::{
    BranchAndBoundMatcher, CorrelativeMatcher, FieldMatcher, Matcher, WsmMatcher, WsmSettings,
};

/// The names that [`matcher`] knows.
pub const MATCHER_NAMES: [&str; 5] =
    ["wsm", "wsm-thesis", "fast", "correlative", "branch-and-bound"];

/// A matcher with its default settings, by name; `None` for an unknown name.
pub fn matcher(name: &str) -> Option<Box<dyn Matcher>> {
    match name {
        "wsm" => Some(Box::new(WsmMatcher::default())),
        "wsm-thesis" => Some(Box::new(WsmMatcher { settings: WsmSettings::thesis() })),
        "fast" => Some(Box::new(FieldMatcher::default())),
        "correlative" => Some(Box::new(CorrelativeMatcher::default())),
        "branch-and-bound" => Some(Box::new(BranchAndBoundMatcher::default())),
        _ => None,
    }
}
