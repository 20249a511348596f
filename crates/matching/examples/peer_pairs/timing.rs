use crate::clock::{REPEATS, fastest};
use crate::pair::Pair;
use geometry::Pose2;
use manifoldslam_matching::{
    BeamNoise, FastMatcher, FieldSettings, LineExtractor, LineFitSettings, LinePoint,
    MATCHER_NAMES, MatchResult, Matcher, PointCloud, PointCloudSettings, Prior, SurfelField,
    matcher,
};
use sensing::Scan;

/// The production path: the fast matcher on a field that is kept.
const FAST_ON_FIELD: &str = "fast-field";
/// Half the side of the field, metres: rooms are smaller.
const HALF_FIELD_M: f64 = 12.0;

/// Outcome of one pair; CPU times in microseconds.
pub struct Timing {
    /// What was found, unless the matcher itself says that it failed.
    pub pose: Option<Pose2>,
    /// The match.
    pub align_us: f64,
    /// From readings to all that the match is given.
    pub build_us: f64,
    /// Adding the reference's last scan to a kept reference of the others.
    pub update_us: f64,
}

/// Matches a pair and says how long it took.
pub type Contestant = Box<dyn FnMut(&Pair) -> Timing>;

/// Everything that can be timed.
pub fn names() -> Vec<&'static str> {
    [FAST_ON_FIELD].into_iter().chain(MATCHER_NAMES).collect()
}

/// The contestant of this name; `None` for an unknown one.
pub fn contestant(name: &str) -> Option<Contestant> {
    if name == FAST_ON_FIELD {
        let mut extractor = LineExtractor::new(BeamNoise::default(), LineFitSettings::default());
        return Some(Box::new(move |pair| fast_on_field(pair, &mut extractor)));
    }
    let matcher = matcher(name)?;
    Some(Box::new(move |pair| registered(pair, matcher.as_ref())))
}

/// A matcher from the registry. What it builds from the clouds is part of its match; the clouds
/// with their surface normals are not.
fn registered(pair: &Pair, matcher: &dyn Matcher) -> Timing {
    let settings = PointCloudSettings::default();
    let cloud = |scan: &Scan| PointCloud::from_scan(scan, &Pose2::IDENTITY, &settings);
    let ((reference, scan), build_us) = fastest(|| {
        let mut reference = PointCloud::default();
        for (scan, pose) in &pair.reference {
            reference.extend(&cloud(scan).transformed(pose));
        }
        (reference, cloud(&pair.scan))
    });
    let prior = Prior::guess(pair.guess);
    let (found, align_us) = fastest(|| matcher.align(&reference, &scan, &prior));
    Timing { pose: usable(&found), align_us, build_us, update_us: f64::NAN }
}

fn fast_on_field(pair: &Pair, extractor: &mut LineExtractor) -> Timing {
    let mut lines = |scan: &Scan| extractor.extract(scan, &Pose2::IDENTITY);
    let ((field, scan), build_us) = fastest(|| {
        let mut field = empty_field();
        for (scan, pose) in &pair.reference {
            field.insert(&lines(scan), pose);
        }
        (field, lines(&pair.scan))
    });
    let prior = Prior::guess(pair.guess);
    let matcher = FastMatcher::default();
    let (found, align_us) = fastest(|| matcher.align(&field, &scan, &prior));
    let reference: Vec<(Vec<LinePoint>, Pose2)> =
        pair.reference.iter().map(|(scan, pose)| (lines(scan), *pose)).collect();
    Timing { pose: usable(&found), align_us, build_us, update_us: update(&reference) }
}

/// Time to add the last scan's points to a field of the others, that field's copying taken out.
fn update(reference: &[(Vec<LinePoint>, Pose2)]) -> f64 {
    let Some(((points, pose), others)) = reference.split_last() else { return f64::NAN };
    let mut before = empty_field();
    others.iter().for_each(|(points, pose)| before.insert(points, pose));
    // Dropping a clone would be timed as well: each run has one of its own, made before.
    let mut copies = vec![before; REPEATS].into_iter();
    let (_, spent) = fastest(|| {
        let field = copies.next();
        field.map(|mut field| {
            field.insert(points, pose);
            field
        })
    });
    spent
}

fn empty_field() -> SurfelField {
    let half = HALF_FIELD_M;
    SurfelField::new(FieldSettings::default(), (-half, -half), (half, half))
}

fn usable(found: &MatchResult) -> Option<Pose2> {
    found.status.is_usable().then_some(found.pose)
}
