use crate::{LikelihoodPyramid, LikelihoodSettings, PointCloud, SearchWindow, SurfelField};
use geometry::{Pose2, Vector2};
use std::f64::consts::PI;

/// What a wide search looks things up in.
#[derive(Clone, Debug)]
pub(super) struct Tables {
    pub search: LikelihoodPyramid,
    /// Fine and without levels: tells whether a point lies on something.
    near: LikelihoodPyramid,
}

/// Windows farther than this to each side are searched with cells and blur larger by the factor:
/// what is lost by that, refinement makes good.
const WIDE_M: f64 = 5.0;
const WIDE_FACTOR: f64 = 2.0;
/// A point this near to a reference point lies on something, metres; and the table that tells so.
const NEAR_M: f64 = 0.1;
const NEAR_CELL_M: f64 = 0.05;
/// The likelihood at one standard deviation, of 255.
const ONE_SIGMA: u8 = 154;
/// Half the length of a surfel that hides what is behind it, in cells: openings must stay open.
const SURFEL_SHARE: f32 = 0.6;
/// What stands less than this before a point does not hide it, metres.
const CLOSE_BEHIND_M: f64 = 0.3;

impl Tables {
    /// Tables for windows of up to `half_m` to each side.
    pub fn new(reference: &PointCloud, half_m: f64, settings: &LikelihoodSettings) -> Self {
        let factor = if half_m > WIDE_M { WIDE_FACTOR } else { 1.0 };
        let (cell_m, sigma_m) = (factor * settings.cell_m, factor * settings.sigma_m);
        let window = SearchWindow {
            centre: Pose2::IDENTITY,
            half_x_m: half_m,
            half_y_m: half_m,
            half_yaw_rad: PI,
        };
        let levels = window.levels(cell_m);
        let search = LikelihoodSettings { cell_m, sigma_m, levels, ..*settings };
        let near =
            LikelihoodSettings { cell_m: NEAR_CELL_M, sigma_m: NEAR_M, levels: 0, ..*settings };
        Tables {
            search: LikelihoodPyramid::build(reference, &search),
            near: LikelihoodPyramid::build(reference, &near),
        }
    }

    /// Share of a scan's points that lie within [`NEAR_M`] of something at a pose, and in front of
    /// which nothing stands in the way.
    pub fn explained(&self, scan: &PointCloud, pose: &Pose2, field: Option<&SurfelField>) -> f64 {
        let as_f32 = |p: Vector2<f64>| (p.x as f32, p.y as f32);
        let explained = scan.points.iter().filter(|p| {
            let at = pose.transform(p.position);
            let (x, y) = self.near.cell_of(&at);
            let clear = (p.range - CLOSE_BEHIND_M).max(0.0);
            let laser = p.position - p.ray * p.range;
            let (from, to) = (pose.transform(laser), pose.transform(laser + p.ray * clear));
            self.near.value(0, x, y) >= ONE_SIGMA
                && field.is_none_or(|field| {
                    let half_m = SURFEL_SHARE * field.settings().cell_m;
                    !field.blocks(as_f32(from), as_f32(to), half_m)
                })
        });
        explained.count() as f64 / scan.len().max(1) as f64
    }
}
