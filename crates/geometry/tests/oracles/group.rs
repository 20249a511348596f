//! The laws every group must keep, for SE(2) and SE(3) by the same code.

use manifoldslam_geometry::{LieGroup, Pose2, Pose3};
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

fn close<G: LieGroup<D>, const D: usize>(a: &G, b: &G, tolerance: f64) -> bool {
    a.between(b).log().norm() <= tolerance
}

fn laws<G: LieGroup<D>, const D: usize>(u: SVector<f64, D>, v: SVector<f64, D>) {
    let (a, b) = (G::exp(&u), G::exp(&v));
    let identity = G::identity();
    assert!(close(&a.compose(&a.inverse()), &identity, 1e-9));
    assert!(close(&a.inverse().compose(&a), &identity, 1e-9));
    assert!(close(&a.compose(&identity), &a, 1e-12));
    let c = a.compose(&b);
    assert!(close(&c.compose(&b).compose(&a), &c.compose(&b.compose(&a)), 1e-9));
    assert!(close(&a.between(&b), &a.inverse().compose(&b), 1e-9));
    assert!((a.log() - u).norm() < 1e-9 * (1.0 + u.norm()), "log exp {u} {}", a.log());
    assert!(close(&a.retract(&v), &a.compose(&b), 1e-9));
    // a exp(v) = exp(Ad v) a
    let moved = G::exp(&(a.adjoint() * v)).compose(&a);
    assert!(close(&a.compose(&b), &moved, 1e-8 * (1.0 + u.norm() * v.norm())));
    let together = a.log_with_jacobian();
    assert!((together.0 - a.log()).norm() < 1e-12);
    assert!((together.1 - G::right_jacobian_inverse(&a.log())).norm() < 1e-9);
    assert!((a.inverse_adjoint() * a.adjoint() - SMatrix::identity()).norm() < 1e-9);
    jacobian(u);
}

/// `log(exp(u) exp(d)) = u + Jr^-1(u) d`, column by column with central differences.
fn jacobian_of<G: LieGroup<D>, const D: usize>(u: SVector<f64, D>) -> f64 {
    let h = 1e-5;
    let mut numeric = SMatrix::<f64, D, D>::zeros();
    for k in 0..D {
        let mut d = SVector::<f64, D>::zeros();
        d[k] = h;
        let plus = G::exp(&u).compose(&G::exp(&d)).log();
        let minus = G::exp(&u).compose(&G::exp(&-d)).log();
        numeric.set_column(k, &((plus - minus) / (2.0 * h)));
    }
    (numeric - G::right_jacobian_inverse(&u)).norm()
}

fn jacobian<const D: usize>(u: SVector<f64, D>) {
    let error = match D {
        3 => jacobian_of::<Pose2, 3>(SVector::from_column_slice(u.as_slice())),
        _ => jacobian_of::<Pose3, 6>(SVector::from_column_slice(u.as_slice())),
    };
    assert!(error < 1e-6 * (1.0 + u.norm()), "Jacobian off by {error} at {u}");
}

/// Translations of metres; rotations tiny, small and large, short of a half turn.
fn scale() -> impl Strategy<Value = f64> {
    prop_oneof![Just(1e-9), Just(1e-4), Just(0.02), Just(0.3), Just(2.9)]
}

proptest! {
    #[test]
    fn plane(t in prop::array::uniform4(-5.0..5.0_f64), s in scale(), r in scale(),
             angles in prop::array::uniform2(-1.0..1.0_f64)) {
        laws::<Pose2, 3>(
            SVector::from([t[0], t[1], s * angles[0]]),
            SVector::from([t[2], t[3], r * angles[1]]),
        );
    }

    #[test]
    fn space(t in prop::array::uniform6(-5.0..5.0_f64), s in scale(), r in scale(),
             w in prop::array::uniform6(-1.0..1.0_f64)) {
        let turn = |k: usize, size: f64| {
            SVector::<f64, 3>::from([w[k], w[k + 1], w[k + 2]]) * (size / 3.0_f64.sqrt())
        };
        let (a, b) = (turn(0, s), turn(3, r));
        laws::<Pose3, 6>(
            SVector::from([t[0], t[1], t[2], a.x, a.y, a.z]),
            SVector::from([t[3], t[4], t[5], b.x, b.y, b.z]),
        );
    }
}

#[test]
fn plane_and_space_agree_in_the_plane() {
    let (u, v) = ([1.0, -2.0, 2.5], [0.3, 4.0, -1.2]);
    let lift = |u: [f64; 3]| SVector::from([u[0], u[1], 0.0, 0.0, 0.0, u[2]]);
    let plane = Pose2::exp(&u.into()) * Pose2::exp(&v.into());
    let space = Pose3::exp(&lift(u)) * Pose3::exp(&lift(v));
    let (flat, log) = (plane.log(), space.log());
    assert!((log - lift([flat.x, flat.y, flat.z])).norm() < 1e-12);
}

#[test]
fn long_products_stay_on_the_group() {
    let step = Pose3::exp(&SVector::from([0.1, 0.0, 0.02, 0.3, -0.1, 0.2]));
    let product = (0..100_000).fold(Pose3::identity(), |pose, _| pose * step);
    assert!((product.rotation.norm() - 1.0).abs() < 1e-14);
}
