use synthetic::{Ascent, Storeys};

/// A kind of building and drive.
pub struct Kind {
    pub name: &'static str,
    pub storeys: Storeys,
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// [`Storeys::default`], which is no constant.
const RAMP: Storeys = Storeys {
    storeys: 2,
    height_m: 3.0,
    slope_rad: 10.0 * DEGREE,
    ascent: Ascent::Straight,
    furnished_alike: true,
    from_the_top: false,
    pitching_rad: 0.0,
    laser_height_m: 0.3,
    unit: synthetic::InertialUnit {
        bias: sensing::Attitude { roll_rad: 0.0, pitch_rad: 0.0 },
        noise: 0.006,
        wander: 0.002,
        wander_secs: 20.0,
    },
    largest_bias_rad: 2.0 * DEGREE,
};

/// All kinds.
pub const ALL: &[Kind] = &[
    Kind { name: "ramp", storeys: RAMP },
    Kind { name: "shallow", storeys: Storeys { slope_rad: 6.0 * DEGREE, ..RAMP } },
    Kind { name: "steep", storeys: Storeys { slope_rad: 15.0 * DEGREE, ..RAMP } },
    Kind { name: "turning", storeys: Storeys { ascent: Ascent::Turning, ..RAMP } },
    Kind { name: "three", storeys: Storeys { storeys: 3, ..RAMP } },
    Kind { name: "upstairs", storeys: Storeys { from_the_top: true, ..RAMP } },
    Kind {
        name: "stairs",
        storeys: Storeys { slope_rad: 30.0 * DEGREE, pitching_rad: 2.0 * DEGREE, ..RAMP },
    },
    Kind { name: "high-laser", storeys: Storeys { laser_height_m: 0.5, ..RAMP } },
    Kind { name: "furnished", storeys: Storeys { furnished_alike: false, ..RAMP } },
    Kind { name: "flat", storeys: Storeys { storeys: 1, ..RAMP } },
];
