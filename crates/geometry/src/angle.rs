use std::f64::consts::{PI, TAU};

/// The angle `radians` brought into `(-pi, pi]`.
///
/// Angles already in range are returned unchanged, bit for bit.
#[inline]
pub fn wrap_angle(radians: f64) -> f64 {
    if radians > -PI && radians <= PI {
        return radians;
    }
    let wrapped = radians - TAU * (radians / TAU).round();
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}
