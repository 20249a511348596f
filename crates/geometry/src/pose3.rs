use crate::LieGroup;
use nalgebra::{Matrix3, Matrix6, Quaternion, UnitQuaternion, Vector3, Vector6};
use std::ops::Mul;

/// A pose, or rigid transform, in space: an element of SE(3). Metres.
///
/// Tangent vectors are `(x, y, z, rx, ry, rz)`, the rotation as a rotation vector in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose3 {
    /// Translation in the target frame, in metres.
    pub translation: Vector3<f64>,
    /// Rotation from the source frame to the target frame.
    pub rotation: UnitQuaternion<f64>,
}

impl Pose3 {
    /// The neutral transform.
    pub fn identity() -> Self {
        Pose3 { translation: Vector3::zeros(), rotation: UnitQuaternion::identity() }
    }

    /// A pose from its parts.
    pub fn new(translation: Vector3<f64>, rotation: UnitQuaternion<f64>) -> Self {
        Pose3 { translation, rotation }
    }

    /// Maps a point from the source frame to the target frame.
    pub fn transform(&self, point: Vector3<f64>) -> Vector3<f64> {
        self.rotation * point + self.translation
    }
}

impl Default for Pose3 {
    fn default() -> Self {
        Pose3::identity()
    }
}

impl Mul for Pose3 {
    type Output = Pose3;
    fn mul(self, other: Pose3) -> Pose3 {
        Pose3 {
            translation: self.transform(other.translation),
            rotation: renormalized(*self.rotation.quaternion() * *other.rotation.quaternion()),
        }
    }
}

/// Keeps long products on the group: rounding would let the norm drift away from one.
fn renormalized(q: Quaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(q * (1.5 - 0.5 * q.norm_squared()))
}

/// The matrix of the cross product with `v`.
fn cross(v: &Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

/// The rotation vector of a unit quaternion, shorter than or equal to pi.
fn rotation_vector(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let sign = if rotation.w < 0.0 { -1.0 } else { 1.0 };
    let (v, w) = (rotation.imag() * sign, rotation.w * sign);
    let n = v.norm();
    let scale = if n < 1e-6 { 2.0 - n * n / 3.0 * 2.0 } else { 2.0 * n.atan2(w) / n };
    v * scale
}

/// The unit quaternion of a rotation vector.
fn quaternion(rotation_vector: &Vector3<f64>) -> UnitQuaternion<f64> {
    let angle = rotation_vector.norm();
    let half = 0.5 * angle;
    let scale = if angle < 1e-6 { 0.5 - angle * angle / 48.0 } else { half.sin() / angle };
    UnitQuaternion::new_normalize(Quaternion::from_parts(half.cos(), rotation_vector * scale))
}

/// `(1 - cos a)/a^2` and `(a - sin a)/a^3`: SO(3)'s left Jacobian is `I + c1 W + c2 W^2`.
fn jacobian_coefficients(angle: f64) -> (f64, f64) {
    let a2 = angle * angle;
    if angle < 1e-2 {
        (0.5 - a2 / 24.0, 1.0 / 6.0 - a2 / 120.0)
    } else {
        ((1.0 - angle.cos()) / a2, (angle - angle.sin()) / (a2 * angle))
    }
}

/// SO(3)'s inverse left Jacobian, `I - W/2 + k W^2` (Sola et al. 2018, eq. 146).
fn left_jacobian_inverse(w: &Vector3<f64>) -> Matrix3<f64> {
    let angle = w.norm();
    let k = if angle < 1e-2 {
        1.0 / 12.0 + angle * angle / 720.0
    } else {
        let half = 0.5 * angle;
        1.0 / (angle * angle) - half.cos() / (2.0 * angle * half.sin())
    };
    let wx = cross(w);
    Matrix3::identity() - wx * 0.5 + wx * wx * k
}

/// The coupling block `Q` of SE(3)'s left Jacobian (Barfoot 2017, eq. 7.86).
fn coupling(v: &Vector3<f64>, w: &Vector3<f64>) -> Matrix3<f64> {
    let angle = w.norm();
    let a2 = angle * angle;
    let (c1, c2, c3) = if angle < 0.1 {
        (
            1.0 / 6.0 - a2 / 120.0 + a2 * a2 / 5040.0,
            -1.0 / 24.0 + a2 / 720.0 - a2 * a2 / 40320.0,
            -1.0 / 120.0 + a2 / 5040.0 - a2 * a2 / 362_880.0,
        )
    } else {
        let (s, c) = angle.sin_cos();
        (
            (angle - s) / (a2 * angle),
            (1.0 - 0.5 * a2 - c) / (a2 * a2),
            (angle - s - a2 * angle / 6.0) / (a2 * a2 * angle),
        )
    };
    let (vx, wx) = (cross(v), cross(w));
    let wvw = wx * vx * wx;
    vx * 0.5 + (wx * vx + vx * wx + wvw) * c1
        - (wx * wx * vx + vx * wx * wx - wvw * 3.0) * c2
        - (wvw * wx + wx * wvw) * (0.5 * (c2 - 3.0 * c3))
}

fn parts(tangent: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (tangent.fixed_rows::<3>(0).into_owned(), tangent.fixed_rows::<3>(3).into_owned())
}

/// `[[a, b], [0, a]]`.
fn block_triangular(a: &Matrix3<f64>, b: &Matrix3<f64>) -> Matrix6<f64> {
    let mut matrix = Matrix6::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(a);
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(a);
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(b);
    matrix
}

impl LieGroup<6> for Pose3 {
    fn identity() -> Self {
        Pose3::identity()
    }

    fn compose(&self, other: &Self) -> Self {
        *self * *other
    }

    fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Pose3 { translation: -(rotation * self.translation), rotation }
    }

    fn exp(tangent: &Vector6<f64>) -> Self {
        let (v, w) = parts(tangent);
        let (c1, c2) = jacobian_coefficients(w.norm());
        let wv = w.cross(&v);
        Pose3 { translation: v + wv * c1 + w.cross(&wv) * c2, rotation: quaternion(&w) }
    }

    fn log(&self) -> Vector6<f64> {
        let w = rotation_vector(&self.rotation);
        let v = left_jacobian_inverse(&w) * self.translation;
        Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
    }

    /// Sola et al. 2018, eq. (175).
    fn adjoint(&self) -> Matrix6<f64> {
        let rotation = self.rotation.to_rotation_matrix().into_inner();
        block_triangular(&rotation, &(cross(&self.translation) * rotation))
    }

    /// `Jr^-1(v) = Jl^-1(-v)`, block-wise inverse of Barfoot 2017, eq. 7.85.
    fn right_jacobian_inverse(tangent: &Vector6<f64>) -> Matrix6<f64> {
        let (v, w) = parts(&-tangent);
        let inverse = left_jacobian_inverse(&w);
        block_triangular(&inverse, &(-inverse * coupling(&v, &w) * inverse))
    }

    fn is_finite(&self) -> bool {
        self.translation.iter().chain(self.rotation.coords.iter()).all(|x| x.is_finite())
    }
}
