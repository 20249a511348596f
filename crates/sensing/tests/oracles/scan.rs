use manifoldslam_sensing::{BeamClass, LaserModel, Scan};

#[test]
fn readings_are_classified_after_rep_117() {
    let laser = LaserModel::half_circle(10);
    let (inf, nan) = (f32::INFINITY, f32::NAN);
    let readings = [1.0, 0.01, 0.0, -0.0, -1.0, nan, inf, -inf, 81.83, 39.99];
    let scan = Scan::classify(laser, &readings);
    use BeamClass::{Hit, Invalid, NoReturn, TooClose};
    let expected =
        [Hit, TooClose, TooClose, TooClose, Invalid, Invalid, NoReturn, TooClose, NoReturn, Hit];
    let classes: Vec<_> = (0..10).map(|i| scan.class(i)).collect();
    assert_eq!(classes, expected);
    assert!((0..10).all(|i| scan.range(i).is_finite()));
    assert_eq!(scan.hit_count(), 2);
    assert_eq!((scan.hit(0), scan.hit(8), scan.range(8)), (Some(1.0), None, 40.0));
}

#[test]
fn half_circles_span_what_carmen_means() {
    for (beams, step_deg, last_deg) in
        [(180, 1.0, 89.0), (181, 1.0, 90.0), (360, 0.5, 89.5), (361, 0.5, 90.0)]
    {
        let laser = LaserModel::half_circle(beams);
        assert!((laser.angle_increment_rad.to_degrees() - step_deg).abs() < 1e-9);
        assert!((laser.bearing(beams as usize - 1).to_degrees() - last_deg).abs() < 1e-9);
        assert!((laser.bearing(0).to_degrees() + 90.0).abs() < 1e-9);
    }
}
