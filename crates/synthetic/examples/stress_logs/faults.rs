use geometry::Pose2;
use rand::{Rng, rngs::StdRng};

/// What goes wrong beside ordinary noise. Zero or false: nothing.
#[derive(Clone, Copy, Default)]
pub struct Faults {
    /// People walking about.
    pub people: usize,
    /// Wheels slip about this often.
    pub slips: usize,
    /// Odometry stands still for 12 scans, then catches up wrongly, about this often.
    pub freezes: usize,
    /// Odometry starts anew elsewhere about this often.
    pub jumps: usize,
    /// Nothing is logged for 3 to 8 seconds this often.
    pub gaps: usize,
    /// One stamp in 20 jumps back.
    pub stamps_back: bool,
    /// A scan only after 1 m or 20 degrees.
    pub sparse: bool,
}

/// Applies slips, freezes and jumps to ideal odometry poses.
pub fn disturb_odometry(poses: &mut [Pose2], faults: &Faults, rng: &mut StdRng) {
    let spots = |count: usize, rng: &mut StdRng| -> Vec<usize> {
        (0..count).map(|_| rng.random_range(40..poses.len().max(80) - 30)).collect()
    };
    let (slips, freezes, jumps) =
        (spots(faults.slips, rng), spots(faults.freezes, rng), spots(faults.jumps, rng));
    let mut steps: Vec<Pose2> = poses.windows(2).map(|w| w[0].between(&w[1])).collect();
    for at in slips {
        let turn = rng.random_range(-0.12..0.12);
        for step in &mut steps[at..at + 4] {
            *step = *step * Pose2::new(rng.random_range(0.0..0.12), 0.0, turn);
        }
    }
    for at in freezes {
        let moved = steps[at..at + 12].iter().fold(Pose2::IDENTITY, |sum, step| sum * *step);
        steps[at..at + 12].fill(Pose2::IDENTITY);
        let wrong = Pose2::new(1.2 * moved.x, 1.2 * moved.y, 1.25 * moved.yaw);
        steps[at + 12] = wrong * steps[at + 12];
    }
    for at in jumps {
        steps[at] = Pose2::new(
            rng.random_range(-4.0..4.0),
            rng.random_range(-4.0..4.0),
            rng.random_range(-2.0..2.0),
        );
    }
    for (i, step) in steps.into_iter().enumerate() {
        poses[i + 1] = poses[i] * step;
    }
}

/// Microseconds of every scan; no two are equal.
pub fn stamps(count: usize, rate: f64, back: bool, rng: &mut StdRng) -> Vec<i64> {
    (0..count)
        .map(|i| {
            let jump = back && rng.random::<f64>() < 0.05;
            let earlier = if jump { rng.random_range(0.15..0.6) } else { 0.0 };
            // A step of 1 ms that depends on the scan, so that jumps never meet another stamp.
            let salt = (i as i64 * 37 % 97) * 1000 + 200 * i64::from(jump);
            1_000_000_000 + ((i as f64 / rate - earlier) * 1e6).round() as i64 + salt
        })
        .collect()
}

/// Indices of the scans that are logged.
pub fn thin(truth: &[Pose2], sparse: bool) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::new();
    for (i, pose) in truth.iter().enumerate() {
        let far = kept.last().is_none_or(|&last| {
            let moved = truth[last].between(pose);
            moved.norm() > 1.0 || moved.yaw.abs() > 20f64.to_radians()
        });
        if far || !sparse {
            kept.push(i);
        }
    }
    kept
}

/// Leaves out what was not logged.
pub fn drop_gaps(kept: &[usize], rate: f64, gaps: usize, rng: &mut StdRng) -> Vec<usize> {
    let last = kept.last().copied().unwrap_or(0);
    let holes: Vec<(usize, usize)> = (0..gaps)
        .map(|_| {
            let start = rng.random_range(last / 20..last.max(20));
            (start, start + (rng.random_range(3.0..8.0) * rate) as usize)
        })
        .collect();
    let logged = |i: &usize| holes.iter().all(|&(from, to)| *i < from || *i >= to);
    kept.iter().copied().filter(logged).collect()
}
