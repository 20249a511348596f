//! The same observations give the same bytes: again, and on any number of threads.

use crate::runs::{Mapped, building, map, mapped_building};
use geometry::Pose2;
use manifoldslam_slam::SlamConfig;
use rayon::ThreadPoolBuilder;

fn bits(pose: &Pose2) -> [u64; 3] {
    [pose.x, pose.y, pose.yaw].map(f64::to_bits)
}

fn assert_same_bytes(a: &Mapped, b: &Mapped) {
    let trajectory = |m: &Mapped| m.trajectory.iter().map(bits).collect::<Vec<_>>();
    assert!(trajectory(a) == trajectory(b), "trajectories differ");
    let relations = |m: &Mapped| -> Vec<_> {
        m.manifold
            .relations()
            .iter()
            .map(|r| {
                let covariance: Vec<u64> =
                    r.from_from_to.covariance.iter().map(|v| v.to_bits()).collect();
                (r.from, r.to, bits(&r.from_from_to.mean), covariance, r.provenance, r.state)
            })
            .collect()
    };
    assert!(relations(a) == relations(b), "relations differ");
    assert_eq!(a.statistics, b.statistics);
    assert!(a.events == b.events, "events differ");
}

#[test]
fn one_thread_or_many_give_the_same_bytes() {
    for threads in [1, 2, 5] {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let mapped = pool.install(|| map(SlamConfig::default(), &building().observations));
        assert_same_bytes(&mapped, mapped_building());
    }
}
