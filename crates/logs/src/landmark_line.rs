//! A landmark in a CARMEN log: a message of our own.

use crate::DropReason;
use crate::carmen_line::{Fault, Fields};
use geometry::{Matrix2, Pose2, Vector2};
use sensing::{LandmarkKind, Sighting, Stamp};
use std::sync::Arc;

/// Longest id, bytes.
const MAX_ID: usize = 64;
/// Nothing is seen from farther away, metres; nor is it known less well.
const MAX_RANGE_M: f64 = 1000.0;

/// A landmark as it was seen, and where the robot then was by its odometry.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SightingLine {
    pub sighting: Sighting,
    pub stamp: Stamp,
    pub odom_from_base: Pose2,
}

/// `LANDMARK kind id|- x y sxx sxy syy [yaw yaw_variance] odom_x odom_y odom_yaw stamp host
/// logger_stamp`, in the frame of the base.
pub(crate) fn landmark(mut fields: Fields, complete: bool) -> Result<SightingLine, Fault> {
    let with_yaw = match fields.clone().total() {
        13 => false,
        15 => true,
        0..15 => {
            let reason = if complete { DropReason::MissingField } else { DropReason::Truncated };
            return Err(Fault { field: None, reason });
        }
        _ => return Err(Fault { field: None, reason: DropReason::ExtraField }),
    };
    let kind = fields.required()?;
    let kind = kind_of(kind).ok_or_else(|| fields.fault(DropReason::UnknownLandmark))?;
    let id = fields.required()?;
    let id = id_of(kind, id).map_err(|reason| fields.fault(reason))?;
    let mut values = [0.0; 5];
    for value in &mut values {
        *value = fields.number()?;
    }
    let [x, y, xx, xy, yy] = values;
    let position = Vector2::new(x, y);
    let covariance = Matrix2::new(xx, xy, xy, yy);
    check(&position, &covariance).map_err(|reason| fields.fault(reason))?;
    let yaw = with_yaw.then(|| Ok((fields.number()?, fields.number()?))).transpose()?;
    check_yaw(yaw).map_err(|reason| fields.fault(reason))?;
    let odom_from_base = fields.pose()?;
    let (stamp, _) = fields.stamp(complete)?;
    let sighting = Sighting { kind, id, position, covariance, yaw };
    Ok(SightingLine { sighting, stamp, odom_from_base })
}

/// The kind of that name.
pub(crate) fn kind_of(text: &[u8]) -> Option<LandmarkKind> {
    match text {
        b"victim" => Some(LandmarkKind::Victim),
        b"tag" => Some(LandmarkKind::Tag),
        b"robot" => Some(LandmarkKind::Robot),
        _ => None,
    }
}

/// The id, `-` or nothing for none. Another robot has one: its name.
pub(crate) fn id_of(kind: LandmarkKind, text: &[u8]) -> Result<Option<Arc<str>>, DropReason> {
    if text.is_empty() || text == b"-" {
        return if kind == LandmarkKind::Robot { Err(DropReason::BadId) } else { Ok(None) };
    }
    let text = std::str::from_utf8(text).map_err(|_| DropReason::BadId)?;
    let plain = text.len() <= MAX_ID && !text.chars().any(char::is_control);
    if plain { Ok(Some(text.into())) } else { Err(DropReason::BadId) }
}

/// What a position and its covariance must be: finite, near, and positive definite.
pub(crate) fn check(position: &Vector2<f64>, covariance: &Matrix2<f64>) -> Result<(), DropReason> {
    let near = |v: &f64| v.abs() <= MAX_RANGE_M;
    if !position.iter().all(near) {
        return Err(DropReason::NotFinite);
    }
    let sane = covariance.iter().all(|v| v.abs() <= MAX_RANGE_M * MAX_RANGE_M);
    let positive = covariance[(0, 0)] > 0.0 && covariance[(1, 1)] > 0.0;
    if sane && positive && covariance.determinant() > 0.0 {
        Ok(())
    } else {
        Err(DropReason::BadCovariance)
    }
}

/// What a heading and its variance must be.
pub(crate) fn check_yaw(yaw: Option<(f64, f64)>) -> Result<(), DropReason> {
    match yaw {
        Some((yaw, _)) if !yaw.is_finite() || yaw.abs() > MAX_RANGE_M => Err(DropReason::NotFinite),
        Some((_, variance)) if !(variance > 0.0 && variance <= 100.0) => {
            Err(DropReason::BadCovariance)
        }
        _ => Ok(()),
    }
}
