use crate::buildings::{WallStyle, corridor_grid, office_wing};
use crate::faults::Faults;
use crate::recording::Scenario;
use geometry::Pose2;
use manifoldslam_synthetic::{
    Drive, FloorPlan, LaserNoise, Robot, Run, WheelNoise, hall, office, two_loop_building,
};
use rand::{SeedableRng, rngs::StdRng};

/// A scenario's name and how a variant of it is made: other buildings of the kind, other noise.
type Named = (&'static str, fn(u64) -> Scenario);

/// Every scenario by name.
pub const ALL: [Named; 17] = [
    ("killian", killian),
    ("bare", bare),
    ("fr079", fr079),
    ("fr101", fr101),
    ("hospital", hospital),
    ("hall", short_sighted_hall),
    ("escort", escort),
    ("people", people),
    ("crowd", crowd),
    ("ward", ward),
    ("reverse", reverse),
    ("slip", slip),
    ("gaps", gaps),
    ("coarse", coarse),
    ("sparse", sparse),
    ("fast", fast),
    ("seattle", seattle),
];

/// Variant 0 is the scenario's own seed.
fn seed(own: u64, variant: u64) -> u64 {
    own + 1000 * variant
}

/// One to two per cent of the way, and half a radian to the left after 250 m.
fn drifting() -> WheelNoise {
    WheelNoise { distance_scale: 0.015, yaw_drift: 0.002, ..WheelNoise::default() }
}

fn scenario(plan: FloorPlan, truth: Vec<Pose2>, scan_rate: f64, seed: u64) -> Scenario {
    Scenario {
        plan,
        glass: FloorPlan::new(),
        truth,
        scan_rate,
        beams: 180,
        noise: LaserNoise::default(),
        no_return: 81.91,
        base_from_laser: Pose2::IDENTITY,
        wheels: drifting(),
        faults: Faults::default(),
        robot_laser: false,
        seed,
    }
}

fn of_run(run: Run, drive: &Drive, seed: u64) -> Scenario {
    scenario(run.plan, run.truth, drive.scan_rate, seed)
}

/// A grid of corridors and the way along crossings given by their indices.
fn grid(
    seed: u64,
    (xs, ys, width): (&[f64], &[f64], f64),
    style: WallStyle,
    crossings: &[(usize, usize)],
    drive: &Drive,
) -> Scenario {
    let rng = &mut StdRng::seed_from_u64(seed);
    let plan = corridor_grid(rng, xs, ys, width, style);
    let way: Vec<_> = crossings.iter().map(|&(x, y)| (xs[x], ys[y])).collect();
    scenario(plan, drive.poses(&way), drive.scan_rate, seed)
}

/// Three big loops sharing sides, 220 x 160 m, 2.6 km of way, mostly featureless corridor.
fn killian(variant: u64) -> Scenario {
    let drive = Drive { speed: 0.7, turn_rate: 0.8, scan_rate: 4.5 };
    let style = WallStyle { spacing: 11.0, rooms: 0.12 };
    let way = [
        (0, 0),
        (1, 0),
        (1, 1),
        (0, 1),
        (0, 0),
        (1, 0),
        (2, 0),
        (2, 1),
        (1, 1),
        (1, 0),
        (2, 0),
        (3, 0),
        (3, 1),
        (2, 1),
        (2, 0),
        (1, 0),
        (0, 0),
        (0, 1),
        (1, 1),
        (2, 1),
        (3, 1),
        (3, 0),
        (2, 0),
    ];
    let mut s = grid(
        seed(11, variant),
        (&[0.0, 75.0, 140.0, 220.0], &[0.0, 160.0], 2.6),
        style,
        &way,
        &drive,
    );
    s.noise.max_range = 80.0;
    s
}

/// Two loops of corridor with something on the wall every 25 m, seen by a laser that reaches 30 m.
fn bare(variant: u64) -> Scenario {
    let drive = Drive { speed: 0.6, turn_rate: 0.8, scan_rate: 3.0 };
    let style = WallStyle { spacing: 25.0, rooms: 0.0 };
    let way =
        [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1), (0, 0)];
    let mut s =
        grid(seed(12, variant), (&[0.0, 60.0, 120.0], &[0.0, 70.0], 2.2), style, &way, &drive);
    s.noise.max_range = 30.0;
    s.no_return = 50.0;
    s
}

/// Look-alike rooms along one corridor, visited one after the other, and the corridor back.
fn fr079(variant: u64) -> Scenario {
    let drive = Drive { speed: 0.5, turn_rate: 0.9, scan_rate: 4.0 };
    let (plan, way) = office_wing(&mut StdRng::seed_from_u64(seed(13, variant)), 12);
    let mut s = scenario(plan, drive.poses(&way), drive.scan_rate, seed(13, variant));
    s.beams = 360;
    s.no_return = 81.83;
    s
}

/// Blocks of look-alike rooms between parallel corridors.
fn fr101(variant: u64) -> Scenario {
    let drive = Drive { speed: 0.6, turn_rate: 1.0, scan_rate: 2.5 };
    let robot = Robot { drive, ..Robot::default() };
    let mut s = of_run(office(seed(14, variant), 3, &robot), &drive, seed(14, variant));
    s.beams = 361;
    s.no_return = 50.0;
    s
}

/// Wide corridors with glass, the laser 0.6 m ahead of the base, new message format.
fn hospital(variant: u64) -> Scenario {
    let drive = Drive { speed: 0.8, turn_rate: 0.8, scan_rate: 5.0 };
    let style = WallStyle { spacing: 5.0, rooms: 0.4 };
    let way = [
        (0, 0),
        (1, 0),
        (2, 0),
        (2, 1),
        (1, 1),
        (1, 0),
        (0, 0),
        (0, 1),
        (1, 1),
        (2, 1),
        (2, 0),
        (1, 0),
    ];
    let mut s =
        grid(seed(15, variant), (&[0.0, 32.0, 70.0], &[0.0, 36.0], 3.2), style, &way, &drive);
    // Glass doors across the far ends and a glass front along a corridor.
    s.glass.wall((1.7, 1.61), (14.0, 1.61)).wall((40.0, -1.5), (60.0, -1.5));
    s.beams = 361;
    s.base_from_laser = Pose2::new(0.6, 0.02, 0.01);
    s.robot_laser = true;
    s
}

/// The hospital with somebody walking ahead and somebody coming by.
fn ward(variant: u64) -> Scenario {
    let mut s = hospital(variant);
    s.faults.people = 2;
    s
}

/// A hall of 60 x 40 m for a laser that sees 8 m.
fn short_sighted_hall(variant: u64) -> Scenario {
    let drive = Drive { speed: 0.6, turn_rate: 1.0, scan_rate: 3.0 };
    let robot = Robot { drive, ..Robot::default() };
    let mut s = of_run(hall(seed(16, variant), 60.0, 40.0, &robot), &drive, seed(16, variant));
    s.beams = 181;
    s.noise.max_range = 8.0;
    s.no_return = 8.0;
    s.base_from_laser = Pose2::new(0.3, 0.0, 0.0);
    s
}

/// The demo's building with `count` people about.
fn populated(count: usize, variant: u64) -> Scenario {
    let mut s = of_run(two_loop_building(seed(17, variant)), &Drive::default(), seed(17, variant));
    s.faults.people = count;
    s
}

/// Somebody walks ahead of the robot all the time.
fn escort(variant: u64) -> Scenario {
    populated(1, variant)
}

/// Two lead the robot, one comes by again and again.
fn people(variant: u64) -> Scenario {
    populated(3, variant)
}

/// Four lead the robot, four come by.
fn crowd(variant: u64) -> Scenario {
    populated(8, variant)
}

/// Around a ring and back the other way: every place seen twice, facing forth and back.
fn reverse(variant: u64) -> Scenario {
    let drive = Drive { speed: 0.6, turn_rate: 1.0, scan_rate: 4.0 };
    let style = WallStyle { spacing: 7.0, rooms: 0.3 };
    let way = [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (0, 1), (1, 1), (1, 0), (0, 0)];
    let mut s = grid(seed(18, variant), (&[0.0, 60.0], &[0.0, 40.0], 2.4), style, &way, &drive);
    s.base_from_laser = Pose2::new(0.2, 0.0, 0.0);
    s
}

/// Wheels that slip, freeze and jump.
fn slip(variant: u64) -> Scenario {
    let mut s = of_run(two_loop_building(seed(19, variant)), &Drive::default(), seed(19, variant));
    s.faults = Faults { slips: 12, freezes: 6, jumps: 3, ..Faults::default() };
    s
}

/// Seconds of silence, stamps that jump back.
fn gaps(variant: u64) -> Scenario {
    let drive = Drive { speed: 0.5, turn_rate: 0.8, scan_rate: 5.0 };
    let style = WallStyle { spacing: 4.0, rooms: 0.4 };
    let way = [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (1, 0)];
    let mut s =
        grid(seed(20, variant), (&[0.0, 24.0, 50.0], &[0.0, 20.0], 2.0), style, &way, &drive);
    s.faults = Faults { gaps: 10, stamps_back: true, ..Faults::default() };
    s
}

/// Ranges in steps of 5 cm, 3 cm of noise, one beam in twenty lost.
fn coarse(variant: u64) -> Scenario {
    let mut s = of_run(two_loop_building(seed(21, variant)), &Drive::default(), seed(21, variant));
    s.noise.range_std = 0.03;
    s.noise.quantisation = 0.05;
    s.noise.dropout = 0.05;
    s.noise.max_range = 32.0;
    s.no_return = 32.0;
    s.beams = 181;
    s
}

/// A scan every metre or 20 degrees.
fn sparse(variant: u64) -> Scenario {
    let drive = Drive { speed: 0.6, turn_rate: 1.0, scan_rate: 10.0 };
    let robot = Robot { drive, ..Robot::default() };
    let mut s = of_run(office(seed(22, variant), 2, &robot), &drive, seed(22, variant));
    s.faults.sparse = true;
    s.beams = 181;
    s
}

/// 1.2 m/s, 90 degrees a second, ten scans a second.
fn fast(variant: u64) -> Scenario {
    let drive = Drive { speed: 1.2, turn_rate: 1.57, scan_rate: 10.0 };
    let style = WallStyle { spacing: 5.0, rooms: 0.3 };
    let way =
        [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (1, 0), (0, 0)];
    let mut s =
        grid(seed(23, variant), (&[0.0, 30.0, 55.0], &[0.0, 25.0], 2.4), style, &way, &drive);
    s.beams = 361;
    s
}

/// One loop of wide corridor driven twice with a scan a second.
fn seattle(variant: u64) -> Scenario {
    let drive = Drive { speed: 0.5, turn_rate: 0.6, scan_rate: 1.0 };
    let style = WallStyle { spacing: 6.0, rooms: 0.25 };
    let way = [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (1, 0), (1, 1), (0, 1), (0, 0)];
    let mut s = grid(seed(24, variant), (&[0.0, 45.0], &[0.0, 18.0], 2.2), style, &way, &drive);
    s.wheels = WheelNoise::poor();
    s
}
