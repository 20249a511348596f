use crate::{LaserModel, Scan};
use geometry::Vector2;

impl Scan {
    /// Every `step`-th beam, beginning with the first; a step of 0 counts as 1.
    pub fn every(&self, step: usize) -> Scan {
        let step = step.max(1);
        let ranges: Vec<f32> = (0..self.len()).step_by(step).map(|i| self.range(i)).collect();
        let classes = (0..self.len()).step_by(step).map(|i| self.class(i)).collect();
        let laser = LaserModel {
            beams: ranges.len() as u32,
            angle_increment_rad: self.laser().angle_increment_rad * step as f64,
            ..*self.laser()
        };
        Scan::from_parts(laser, ranges.into(), classes)
    }

    /// Indices of hits so that, along the scan, each endpoint kept lies at least `spacing_m` from
    /// the one kept before: near surfaces are thinned out, far ones stay.
    pub fn spaced_hits(&self, spacing_m: f64) -> Vec<usize> {
        let mut kept = Vec::new();
        let mut last: Option<Vector2<f64>> = None;
        for i in 0..self.len() {
            let Some(range) = self.hit(i) else { continue };
            let (sin, cos) = self.laser().bearing(i).sin_cos();
            let endpoint = Vector2::new(cos, sin) * f64::from(range);
            if last.is_none_or(|last| (endpoint - last).norm() >= spacing_m) {
                kept.push(i);
                last = Some(endpoint);
            }
        }
        kept
    }
}
