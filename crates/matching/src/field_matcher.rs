use crate::likelihood::within_extent;
use crate::wsm::error_model::weighted_points;
use crate::{
    FastMatcher, FieldSettings, LinePoint, MatchResult, MatchStatus, Matcher, PointCloud, Prior,
    SurfelField, WsmSettings,
};
use geometry::{Pose2, Vector2};

/// The fast matcher behind the common trait: builds the surfel field anew for every match.
///
/// For comparisons and tests. The pipeline keeps its field incrementally and calls [`FastMatcher`]
/// itself, which is what makes it fast.
#[derive(Clone, Copy, Debug, Default)]
pub struct FieldMatcher {
    /// The fast matcher's settings.
    pub matcher: FastMatcher,
    /// The field's settings.
    pub field: FieldSettings,
    /// The error model of the points.
    pub error: WsmSettings,
}

impl FieldMatcher {
    /// Fields are not larger than this, metres; farther reference points are left out.
    const EXTENT: f64 = 120.0;

    /// The points that lie on lines, with the variances of the error model.
    pub(crate) fn line_points(&self, cloud: &PointCloud) -> Vec<LinePoint> {
        let points = weighted_points(&cloud.in_order(), &self.error);
        let lines = points.iter().filter_map(|p| {
            let surface = p.surface?;
            let normal = surface.normal;
            Some(LinePoint {
                x: p.position.x as f32,
                y: p.position.y as f32,
                nx: normal.x as f32,
                ny: normal.y as f32,
                variance: normal.dot(&(p.noise * normal)).max(1e-6) as f32,
                normal_variance: surface.variance as f32,
            })
        });
        lines.collect()
    }

    /// The field of a reference; `None` where nothing of it lies on a line.
    pub(crate) fn field_of(&self, reference: &PointCloud) -> Option<SurfelField> {
        let reference = self.line_points(reference);
        let positions = reference.iter().map(|p| Vector2::new(p.x, p.y).cast::<f64>());
        let positions = within_extent(positions, Self::EXTENT);
        let first = *positions.first()?;
        let (lo, hi) = positions.iter().fold((first, first), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
        let margin = f64::from(self.field.reach_m + self.field.cell_m);
        let (lo, hi) = (lo.add_scalar(-margin), hi.add_scalar(margin));
        let mut field = SurfelField::new(self.field, (lo.x, lo.y), (hi.x, hi.y));
        field.insert(&reference, &Pose2::IDENTITY);
        Some(field)
    }

    /// Matches points with a field from a starting point; what fits no better than chance has
    /// diverged.
    pub(crate) fn align_with(
        &self,
        field: &SurfelField,
        scan: &[LinePoint],
        start: &Pose2,
        prior: &Prior,
    ) -> MatchResult {
        let result = self.matcher.align_from(field, scan, start, prior);
        if result.status.is_usable() && result.inlier_ratio < self.error.min_inlier_ratio {
            return MatchResult { status: MatchStatus::Diverged, ..result };
        }
        result
    }
}

impl Matcher for FieldMatcher {
    fn name(&self) -> &'static str {
        "fast"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let scan = self.line_points(scan);
        match self.field_of(reference).filter(|_| !scan.is_empty()) {
            Some(field) => self.align_with(&field, &scan, &prior.pose, prior),
            None => MatchResult::failed(prior.pose, 0, MatchStatus::TooFewPoints),
        }
    }
}
