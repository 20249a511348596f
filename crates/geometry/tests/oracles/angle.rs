//! Wrapping against its definition.

use manifoldslam_geometry::wrap_angle;
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

proptest! {
    #[test]
    fn wrapping_lands_in_range_on_the_same_direction(angle in -1e4..1e4_f64) {
        let wrapped = wrap_angle(angle);
        prop_assert!(wrapped > -PI && wrapped <= PI);
        let turns = (angle - wrapped) / TAU;
        prop_assert!((turns - turns.round()).abs() < 1e-10);
        prop_assert_eq!(wrap_angle(wrapped).to_bits(), wrapped.to_bits());
    }
}

#[test]
fn the_ends_of_the_range() {
    assert_eq!(wrap_angle(PI), PI);
    assert_eq!(wrap_angle(-PI), PI);
    assert!(wrap_angle(f64::NAN).is_nan());
}
