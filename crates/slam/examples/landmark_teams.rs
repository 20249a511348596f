//! Two robots map one building; only landmarks that both saw may join their islands.
//!
//! `cargo run --release --locked -p manifoldslam-slam --example landmark_teams -- [FIRST COUNT]`;
//! see bench/landmarks/README.md.
//!
//! A robot reads each tag's id once and for all, one in ten as that of another tag. In two
//! buildings that look alike the same ids hang elsewhere: every merge is false. The error is
//! that between the robots' maps where the tags are: each robot's poses there are laid over the
//! true ones by themselves, and what the two say of the tags' middle is compared.

use geometry::{Pose2, Vector2};
use manifold::{Change, PatchId, Provenance};
use manifoldslam_slam::{Event, Mapper, MergeState, SlamConfig, Team};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use sensing::{LandmarkKind, RobotId};
use synthetic::{Landmark, LandmarkSensor, Meeting, RayCaster, Run, TwinFamily, misread, twins};

/// A merge farther off than this is a false one, metres and degrees.
const FALSE: (f64, f64) = (1.5, 10.0);
/// A relation between the robots farther off than this comes from a wrong id.
const WRONG_RELATION_M: f64 = 0.5;
/// Scans so near to a tag count, metres.
const NEAR_M: f64 = 10.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let numbers: Vec<u64> =
        std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let (first, count) = match numbers[..] {
        [] => (0, 100),
        [first, count] => (first, count),
        _ => return Err("arguments: [FIRST COUNT]".into()),
    };
    println!(
        "| scans matched | buildings | tags | wrong ids | cases | merged | provisional | false \
         | < 0.1 m, 1 deg | median, m | 95 %, m | 95 %, deg | after the refit: < 0.1 m, 1 deg \
         | 95 %, m | ids read wrong | relations between robots, wrong |"
    );
    println!("|{}", "---|".repeat(16));
    for match_scans in [false, true] {
        for (meeting, wrong) in
            [(Meeting::Together, 0.0), (Meeting::Together, 0.1), (Meeting::Apart, 0.0)]
        {
            // A single tag cannot be read as another one.
            for tags in [1, 2, 3, 10].into_iter().filter(|&tags| tags > 1 || wrong == 0.0) {
                let mut row = Row::of(match_scans, meeting, tags, wrong);
                (first..first + count).for_each(|seed| row.run(seed));
                row.print();
            }
        }
    }
    Ok(())
}

/// A robot's run, and the tags that hang where it drives.
type Robot = (Run, Vec<Landmark>);

/// Two robots in one building that come by the same tags, or in two buildings that look alike with
/// the same ids elsewhere; `None` where there are not so many places for tags.
fn world(meeting: Meeting, tags: usize, seed: u64) -> Option<[Robot; 2]> {
    let case = twins(TwinFamily::Corridors, seed, meeting);
    let [one, other, ..] = &case.runs[..] else { return None };
    let mut rng = StdRng::seed_from_u64(seed);
    Some(match meeting {
        Meeting::Together => {
            let tags = hung(&[one, other], tags, &mut rng)?;
            [(one.clone(), tags.clone()), (other.clone(), tags)]
        }
        Meeting::Apart => [
            (one.clone(), hung(&[one], tags, &mut rng)?),
            (other.clone(), hung(&[other], tags, &mut rng)?),
        ],
    })
}

/// Tags at places that each of the robots sees three times at least.
fn hung(runs: &[&Run], tags: usize, rng: &mut StdRng) -> Option<Vec<Landmark>> {
    let world = RayCaster::new(runs[0].plan.clone());
    let sensor = LandmarkSensor::default();
    let mut places: Vec<Vector2<f64>> = Vec::new();
    for _ in 0..2000 {
        let from = runs[0].truth[rng.random_range(0..runs[0].truth.len())];
        let ahead = Vector2::new(rng.random_range(1.0..4.0), rng.random_range(-1.0..1.0));
        let place = from.transform(ahead);
        let apart = places.iter().all(|other| (other - place).norm() > 2.0);
        let often_seen = |run: &&Run| {
            let looks = run.truth.iter().step_by(sensor.every);
            looks.filter(|pose| sensor.in_view(&world, pose, place).is_some()).count() >= 3
        };
        if apart && runs.iter().all(often_seen) {
            places.push(place);
        }
        if places.len() == tags {
            break;
        }
    }
    let landmark = |(i, place): (usize, &Vector2<f64>)| Landmark {
        kind: LandmarkKind::Tag,
        id: Some(format!("tag-{i}").into()),
        position: *place,
    };
    let all: Vec<_> = places.iter().enumerate().map(landmark).collect();
    (all.len() == tags).then_some(all)
}

/// The robots' team before anything is joined, and the scan of each of its patches.
fn mapped(runs: &[Run; 2], match_scans: bool) -> (Team, Vec<(usize, usize)>) {
    let mut config = SlamConfig::default();
    config.merging.landmarks.match_scans = match_scans;
    config.merging.geometry = false;
    let mut team = Team::new(config);
    let mut scans = Vec::new();
    for (number, run) in runs.iter().enumerate() {
        let robot = team.add_robot(&format!("robot-{number}"));
        let mut mapper = Mapper::new(config);
        for (k, observation) in run.observations.iter().enumerate() {
            let events = mapper.step(observation.clone());
            let changes: Vec<Change> = events.into_iter().filter_map(change).collect();
            let added = changes.iter().filter(|c| matches!(c, Change::PatchAdded(_))).count();
            scans.extend(std::iter::repeat_n((number, k), added));
            team.receive(robot, &changes);
        }
        mapper.conclude();
        team.join(robot, mapper);
    }
    (team, scans)
}

fn change(event: Event) -> Option<Change> {
    match event {
        Event::Map(change) => Some(change),
        Event::Localised(..) => None,
    }
}

/// How far apart the robots put the tags' middle, metres, and how their maps are turned against
/// each other, degrees.
fn disagreement(team: &Team, runs: &[Run; 2], tags: &[Landmark]) -> (f64, f64) {
    let near =
        |pose: &Pose2| tags.iter().any(|tag| (tag.position - pose.translation()).norm() < NEAR_M);
    let island_from_world = [0, 1].map(|k| {
        let found = team.trajectory(RobotId(k as u16));
        let pairs = runs[k].truth.iter().zip(&found).filter(|(truth, _)| near(truth));
        fitted(&pairs.map(|(t, f)| (f.translation(), t.translation())).collect::<Vec<_>>())
    });
    let middle = tags.iter().map(|tag| tag.position).sum::<Vector2<f64>>() / tags.len() as f64;
    let [one, other] = island_from_world;
    let apart = (one.transform(middle) - other.transform(middle)).norm();
    (apart, one.between(&other).yaw.abs().to_degrees())
}

/// The rigid motion that lays the second places over the first best (Umeyama 1991).
fn fitted(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Pose2 {
    let n = pairs.len() as f64;
    let to = pairs.iter().map(|p| p.0).sum::<Vector2<f64>>() / n;
    let from = pairs.iter().map(|p| p.1).sum::<Vector2<f64>>() / n;
    let (mut cos, mut sin) = (0.0, 0.0);
    for (a, b) in pairs {
        cos += (b - from).dot(&(a - to));
        sin += (b - from).perp(&(a - to));
    }
    let turn = Pose2::new(0.0, 0.0, f64::atan2(sin, cos));
    let shift = to - turn.transform(from);
    Pose2::new(shift.x, shift.y, turn.yaw)
}

struct Row {
    match_scans: bool,
    meeting: Meeting,
    tags: usize,
    wrong: f64,
    cases: usize,
    provisional: usize,
    wrong_ids: usize,
    relations: usize,
    wrong_relations: usize,
    /// Errors of each merge, metres and degrees, and after the refit.
    merged: Vec<(f64, f64)>,
    refitted: Vec<(f64, f64)>,
}

impl Row {
    fn of(match_scans: bool, meeting: Meeting, tags: usize, wrong: f64) -> Self {
        let (cases, provisional, wrong_ids, relations, wrong_relations) = (0, 0, 0, 0, 0);
        let (merged, refitted) = (Vec::new(), Vec::new());
        Row {
            match_scans,
            meeting,
            tags,
            wrong,
            cases,
            provisional,
            wrong_ids,
            relations,
            wrong_relations,
            merged,
            refitted,
        }
    }

    fn run(&mut self, seed: u64) {
        let Some([(mut one, hung), (mut other, elsewhere)]) = world(self.meeting, self.tags, seed)
        else {
            return;
        };
        self.cases += 1;
        for (k, run, tags) in [(0, &mut one, &hung), (1, &mut other, &elsewhere)] {
            let read = misread(tags, self.wrong, 1000 * seed + k);
            self.wrong_ids += read.iter().zip(tags).filter(|(r, t)| r.id != t.id).count();
            LandmarkSensor::default().see(run, &read, 1000 * seed + 10 + k);
        }
        let runs = [one, other];
        let (mut team, scans) = mapped(&runs, self.match_scans);
        team.merge();
        let proposed = team.merges().iter().any(|m| m.state == MergeState::Provisional);
        if team.manifold().islands().len() > 1 {
            self.provisional += usize::from(proposed);
            return;
        }
        self.merged.push(disagreement(&team, &runs, &hung));
        self.count_relations(&team, &runs, &scans);
        team.rebuild();
        self.refitted.push(disagreement(&team, &runs, &hung));
    }

    fn count_relations(&mut self, team: &Team, runs: &[Run; 2], scans: &[(usize, usize)]) {
        let pose = |patch: PatchId| {
            let (robot, scan) = scans[patch.index()];
            (robot, runs[robot].truth[scan])
        };
        for r in team.manifold().active_relations().filter(|r| r.provenance == Provenance::Landmark)
        {
            let ((one, from), (other, to)) = (pose(r.from), pose(r.to));
            let error = from.between(&to).distance(&r.from_from_to.mean);
            self.relations += usize::from(one != other);
            self.wrong_relations += usize::from(one != other && error > WRONG_RELATION_M);
        }
    }

    fn is_false(&self, error: &(f64, f64)) -> bool {
        self.meeting == Meeting::Apart || error.0 > FALSE.0 || error.1 > FALSE.1
    }

    fn print(&self) {
        let share = |n: usize, of: usize| 100.0 * n as f64 / of.max(1) as f64;
        let accurate = |all: &[(f64, f64)]| all.iter().filter(|e| e.0 < 0.1 && e.1 < 1.0).count();
        let merged = self.merged.len();
        println!(
            "| {} | {} | {} | {:.0} % | {} | {:.1} % | {:.1} % | {} | {:.1} % | {} | {} \
             | {} | {:.1} % | {} | {} | {}, {} |",
            if self.match_scans { "yes" } else { "no" },
            if self.meeting == Meeting::Together { "one" } else { "two" },
            self.tags,
            100.0 * self.wrong,
            self.cases,
            share(merged, self.cases),
            share(self.provisional, self.cases),
            self.merged.iter().filter(|e| self.is_false(e)).count(),
            share(accurate(&self.merged), merged),
            quantile(self.merged.iter().map(|e| e.0), 0.5),
            quantile(self.merged.iter().map(|e| e.0), 0.95),
            quantile(self.merged.iter().map(|e| e.1), 0.95),
            share(accurate(&self.refitted), merged),
            quantile(self.refitted.iter().map(|e| e.0), 0.95),
            self.wrong_ids,
            self.relations,
            self.wrong_relations,
        );
    }
}

/// A quantile with three decimals; a dash where there is none.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> String {
    let mut sorted: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let value = sorted.get((share * sorted.len() as f64) as usize);
    value.map_or("-".into(), |v| format!("{v:.3}"))
}
