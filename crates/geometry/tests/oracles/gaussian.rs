//! Propagated covariances against those of sampled poses.

use manifoldslam_geometry::{Gaussian, GaussianPose2, LieGroup, Matrix3, Pose2, Pose3};
use nalgebra::{SMatrix, SVector};

/// A linear congruential generator (Knuth's MMIX constants), and Gaussians by the sum of twelve.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vector<const D: usize>(&mut self) -> SVector<f64, D> {
        SVector::from_fn(|_, _| (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0)
    }

    fn sample<G: LieGroup<D>, const D: usize>(&mut self, gaussian: &Gaussian<G, D>) -> G {
        let root = nalgebra::Cholesky::new(gaussian.covariance).unwrap().l();
        gaussian.mean.retract(&(root * self.vector::<D>()))
    }
}

/// Relative difference between a propagated covariance and that of many samples.
fn difference<G: LieGroup<D>, const D: usize>(
    propagated: &Gaussian<G, D>,
    mut sample: impl FnMut() -> G,
) -> f64 {
    let count = 40_000;
    let mut covariance = SMatrix::<f64, D, D>::zeros();
    for _ in 0..count {
        let delta = propagated.mean.between(&sample()).log();
        covariance += delta * delta.transpose() / f64::from(count);
    }
    (covariance - propagated.covariance).norm() / propagated.covariance.norm()
}

#[test]
fn composition_and_inverse_in_the_plane() {
    let mut noise = Noise(7);
    let a = GaussianPose2 {
        mean: Pose2::new(2.0, -1.0, 1.1),
        covariance: Matrix3::new(4.0, 1.0, 0.1, 1.0, 2.0, -0.2, 0.1, -0.2, 0.5) * 1e-4,
    };
    let b = GaussianPose2 {
        mean: Pose2::new(-3.0, 4.0, -2.0),
        covariance: Matrix3::new(1.0, 0.0, -0.3, 0.0, 3.0, 0.2, -0.3, 0.2, 0.4) * 1e-4,
    };
    let composed = difference(&a.compose(&b), || noise.sample(&a) * noise.sample(&b));
    let inverted = difference(&a.inverse(), || noise.sample(&a).inverse());
    assert!(composed < 0.03, "{composed}");
    assert!(inverted < 0.03, "{inverted}");
}

#[test]
fn composition_and_inverse_in_space() {
    let mut noise = Noise(8);
    let root =
        SMatrix::<f64, 6, 6>::from_fn(|r, c| if r >= c { 0.01 / (1 + r + c) as f64 } else { 0.0 });
    let covariance = root * root.transpose();
    let a = Gaussian::<Pose3, 6> {
        mean: Pose3::exp(&SVector::from([1.0, 2.0, -1.0, 0.5, -0.9, 1.3])),
        covariance,
    };
    let b = Gaussian::<Pose3, 6> {
        mean: Pose3::exp(&SVector::from([-2.0, 0.5, 1.0, -1.5, 0.2, 0.3])),
        covariance: covariance * 2.0,
    };
    let composed = difference(&a.compose(&b), || noise.sample(&a) * noise.sample(&b));
    let inverted = difference(&a.inverse(), || noise.sample(&a).inverse());
    assert!(composed < 0.03, "{composed}");
    assert!(inverted < 0.03, "{inverted}");
}

#[test]
fn mahalanobis_distance_of_a_pose_one_sigma_away() {
    let gaussian = GaussianPose2 {
        mean: Pose2::new(5.0, 1.0, 2.0),
        covariance: Matrix3::from_diagonal(&[0.04, 0.09, 0.01].into()),
    };
    let pose = gaussian.mean.retract(&[0.2, 0.0, 0.0].into());
    assert!((gaussian.mahalanobis_squared(&pose).unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(GaussianPose2::exact(pose).mahalanobis_squared(&pose), None);
}
