use geometry::{Matrix3, Pose2, Vector2};
use matching::{CloudPoint, PointCloud, cramer_rao_bound, fisher_information};
use synthetic::{RayCaster, Scanner, TrueBeam};

/// A point counts as seen where a ray to it ends this near to it, metres.
const TOLERANCE_M: f64 = 0.01;

/// The Cramer-Rao bound of a scan at `world_from_scan` against a reference averaged from scans at
/// `others`: of its beams those count alone whose end one of the others sees.
///
/// Noise that is not Gaussian counts as Gaussian of the same variance. `None` where a direction is
/// open.
pub fn visible_bound(
    world: &RayCaster,
    scanner: &Scanner,
    world_from_scan: &Pose2,
    others: &[Pose2],
) -> Option<Matrix3<f64>> {
    let mut information = Matrix3::zeros();
    for beam in scanner.truth(world, world_from_scan).into_iter().flatten() {
        let point = point(&beam);
        let end = world_from_scan.transform(point.position);
        if others.iter().any(|other| sees(world, scanner, other, end)) {
            // Beam by beam, since the noise may depend on the range.
            let std = scanner.noise.range_std_at(beam.range);
            information += fisher_information(&PointCloud { points: vec![point] }, std, 0.0);
        }
    }
    cramer_rao_bound(&information, others.len())
}

fn point(beam: &TrueBeam) -> CloudPoint {
    let ray = Vector2::new(beam.bearing.cos(), beam.bearing.sin());
    CloudPoint::exact(ray, beam.range, beam.normal)
}

/// Does a scanner at a pose see a point of a surface?
fn sees(
    world: &RayCaster,
    scanner: &Scanner,
    world_from_base: &Pose2,
    point: Vector2<f64>,
) -> bool {
    let seen = world_from_base.inverse().transform(point);
    let (range, bearing) = (seen.norm(), seen.y.atan2(seen.x));
    let last = scanner.laser.bearing(scanner.laser.beams.saturating_sub(1) as usize);
    if range > scanner.max_range() || bearing < scanner.laser.angle_min_rad || bearing > last {
        return false;
    }
    let direction = world_from_base.rotate(seen / range.max(1e-9));
    world
        .cast(world_from_base.translation(), direction, range + TOLERANCE_M)
        .is_some_and(|hit| (hit.range - range).abs() < TOLERANCE_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use synthetic::{LaserNoise, noisy_room};

    #[test]
    fn from_the_same_place_everything_is_visible_and_from_afar_nothing() {
        let world = RayCaster::new(noisy_room(3));
        let scanner = Scanner::half_circle(181, LaserNoise::gaussian(0.01));
        let pose = Pose2::new(0.1, 0.2, 0.3);
        let points = scanner.truth(&world, &pose).iter().flatten().map(point).collect();
        let all = fisher_information(&PointCloud { points }, 0.01, 0.0);
        let expected = cramer_rao_bound(&all, 1).unwrap();
        let found = visible_bound(&world, &scanner, &pose, &[pose]).unwrap();
        assert!((found - expected).norm() < 1e-9 * expected.norm());
        let outside = Pose2::new(90.0, 90.0, 0.0);
        assert_eq!(visible_bound(&world, &scanner, &pose, &[outside]), None);
    }
}
