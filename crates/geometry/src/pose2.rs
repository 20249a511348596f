use crate::{LieGroup, wrap_angle};
use nalgebra::{Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use std::ops::Mul;

/// A pose, or rigid transform, in the plane: an element of SE(2).
///
/// Metres and radians; `yaw` is kept in `(-pi, pi]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose2 {
    /// Translation along the target frame's x axis, in metres.
    pub x: f64,
    /// Translation along the target frame's y axis, in metres.
    pub y: f64,
    /// Counter-clockwise rotation in radians, in `(-pi, pi]`.
    pub yaw: f64,
}

impl Pose2 {
    /// The neutral transform.
    pub const IDENTITY: Pose2 = Pose2 { x: 0.0, y: 0.0, yaw: 0.0 };

    /// A pose from its coordinates; `yaw` is wrapped.
    #[inline]
    pub fn new(x: f64, y: f64, yaw: f64) -> Self {
        Pose2 { x, y, yaw: wrap_angle(yaw) }
    }

    /// The translation part.
    #[inline]
    pub fn translation(&self) -> Vector2<f64> {
        Vector2::new(self.x, self.y)
    }

    /// Maps a point from the source frame to the target frame.
    #[inline]
    pub fn transform(&self, point: Vector2<f64>) -> Vector2<f64> {
        let (s, c) = self.yaw.sin_cos();
        Vector2::new(self.x + c * point.x - s * point.y, self.y + s * point.x + c * point.y)
    }

    /// Rotates a direction from the source frame to the target frame.
    #[inline]
    pub fn rotate(&self, direction: Vector2<f64>) -> Vector2<f64> {
        let (s, c) = self.yaw.sin_cos();
        Vector2::new(c * direction.x - s * direction.y, s * direction.x + c * direction.y)
    }

    /// The inverse transform.
    #[inline]
    pub fn inverse(&self) -> Self {
        let (s, c) = self.yaw.sin_cos();
        Pose2::new(-c * self.x - s * self.y, s * self.x - c * self.y, -self.yaw)
    }

    /// `self^-1 * other`: `other` seen from `self`.
    #[inline]
    pub fn between(&self, other: &Pose2) -> Pose2 {
        let (s, c) = self.yaw.sin_cos();
        let (dx, dy) = (other.x - self.x, other.y - self.y);
        Pose2::new(c * dx + s * dy, -s * dx + c * dy, other.yaw - self.yaw)
    }

    /// Distance between the origins of two poses in the same frame, in metres.
    #[inline]
    pub fn distance(&self, other: &Pose2) -> f64 {
        let (dx, dy) = (self.x - other.x, self.y - other.y);
        (dx * dx + dy * dy).sqrt()
    }

    /// Length of the translation, in metres.
    #[inline]
    pub fn norm(&self) -> f64 {
        (self.x * self.x + self.y * self.y).sqrt()
    }

    /// The coordinates as a vector `(x, y, yaw)`; not the logarithm.
    #[inline]
    pub fn coordinates(&self) -> Vector3<f64> {
        Vector3::new(self.x, self.y, self.yaw)
    }

    /// `c = (w/2) cot(w/2)` and `(1 - c) / w^2`.
    #[inline]
    fn half_cotangent(w: f64) -> (f64, f64) {
        let w2 = w * w;
        if w.abs() < 1e-2 {
            let k = 1.0 / 12.0 + w2 / 720.0 + w2 * w2 / 30240.0;
            (1.0 - k * w2, k)
        } else {
            let (s, c) = (0.5 * w).sin_cos();
            let cotangent = 0.5 * w * c / s;
            (cotangent, (1.0 - cotangent) / w2)
        }
    }

    /// The logarithm: the translation times the inverse of `V`, `[[c, w/2], [-w/2, c]]`.
    #[inline]
    fn log_from(&self, c: f64) -> Vector3<f64> {
        let h = 0.5 * self.yaw;
        Vector3::new(c * self.x + h * self.y, c * self.y - h * self.x, self.yaw)
    }

    #[inline]
    fn jacobian_from(tangent: &Vector3<f64>, k: f64) -> Matrix3<f64> {
        let (x, y, w) = (tangent.x, tangent.y, tangent.z);
        let (h, d) = (0.5 * w, 1.0 - k * w * w);
        Matrix3::new(d, -h, 0.5 * y + k * w * x, h, d, k * w * y - 0.5 * x, 0.0, 0.0, 1.0)
    }

    /// `sin(yaw)/yaw` and `(1 - cos(yaw))/yaw`, the entries of SE(2)'s `V` matrix.
    #[inline]
    fn v_entries(yaw: f64) -> (f64, f64) {
        if yaw.abs() < 1e-4 {
            let y2 = yaw * yaw;
            (1.0 - y2 / 6.0, yaw * (0.5 - y2 / 24.0))
        } else {
            (yaw.sin() / yaw, (1.0 - yaw.cos()) / yaw)
        }
    }
}

impl Mul for Pose2 {
    type Output = Pose2;
    // Composition adds the yaws.
    #[allow(clippy::suspicious_arithmetic_impl)]
    #[inline]
    fn mul(self, other: Pose2) -> Pose2 {
        let t = self.transform(other.translation());
        Pose2::new(t.x, t.y, self.yaw + other.yaw)
    }
}

impl LieGroup<3> for Pose2 {
    #[inline]
    fn identity() -> Self {
        Pose2::IDENTITY
    }

    #[inline]
    fn compose(&self, other: &Self) -> Self {
        *self * *other
    }

    #[inline]
    fn inverse(&self) -> Self {
        Pose2::inverse(self)
    }

    #[inline]
    fn exp(tangent: &Vector3<f64>) -> Self {
        let (a, b) = Self::v_entries(tangent.z);
        let (vx, vy) = (tangent.x, tangent.y);
        Pose2::new(a * vx - b * vy, b * vx + a * vy, tangent.z)
    }

    #[inline]
    fn log(&self) -> Vector3<f64> {
        self.log_from(Self::half_cotangent(self.yaw).0)
    }

    /// Sola et al. 2018, eq. (159).
    #[inline]
    fn adjoint(&self) -> Matrix3<f64> {
        let (s, c) = self.yaw.sin_cos();
        Matrix3::new(c, -s, self.y, s, c, -self.x, 0.0, 0.0, 1.0)
    }

    /// `Jr^-1(v) = I + ad(v)/2 + k ad(v)^2`, with `k = (1 - (w/2) cot(w/2)) / w^2`.
    #[inline]
    fn right_jacobian_inverse(tangent: &Vector3<f64>) -> Matrix3<f64> {
        Self::jacobian_from(tangent, Self::half_cotangent(tangent.z).1)
    }

    #[inline]
    fn log_with_jacobian(&self) -> (Vector3<f64>, Matrix3<f64>) {
        let (c, k) = Self::half_cotangent(self.yaw);
        let log = self.log_from(c);
        (log, Self::jacobian_from(&log, k))
    }

    #[inline]
    fn inverse_adjoint(&self) -> Matrix3<f64> {
        let (s, c) = self.yaw.sin_cos();
        let (x, y) = (self.x, self.y);
        Matrix3::new(c, s, s * x - c * y, -s, c, c * x + s * y, 0.0, 0.0, 1.0)
    }

    #[inline]
    fn is_finite(&self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.yaw.is_finite()
    }

    #[inline]
    fn between(&self, other: &Self) -> Self {
        Pose2::between(self, other)
    }
}
