use super::{BadStretch, Fault, IntegritySettings};
use crate::map::Map;
use crate::track::ScanRecord;
use geometry::Pose2;
use manifold::{PatchId, Relation, RelationId, Retraction};
use sensing::Scan;
use std::ops::Range;

/// The pieces of one robot's map: where its data went bad, the map was cut.
#[derive(Clone, Debug)]
pub(crate) struct Pieces {
    proven_m: f64,
    /// Number of patches before each scan was taken.
    patches_before: Vec<usize>,
    /// What was left out so far, in order.
    bad: Vec<BadStretch>,
    /// Since which scan data are bad.
    open: Option<(Fault, usize)>,
    /// First scan of the present piece, and the way driven on it.
    began: usize,
    way: Way,
    /// The present piece follows a cut.
    unproven: bool,
    /// It is left out for now.
    aside: bool,
}

/// Distance driven, metres, as far as scans show it.
#[derive(Clone, Debug, Default)]
struct Way {
    last: Option<(Pose2, Scan)>,
    driven_m: f64,
}

/// Steps of a way count from here on, metres.
const STEP_M: f64 = 0.1;
/// Ranges that differ by less are the same, metres and share of the range ...
const SAME_M: f64 = 0.1;
const SAME_SHARE: f64 = 0.02;
/// ... and scans of which so many beams are the same show no drive: wheels that turn in the air
/// count one all the same.
const SAME_BEAMS: f64 = 0.9;

impl Way {
    fn on(&mut self, pose: Pose2, scan: &Scan) {
        let Some((last, seen)) = &self.last else {
            self.last = Some((pose, scan.clone()));
            return;
        };
        let step = last.distance(&pose);
        if step >= STEP_M && !is_same(seen, scan) {
            self.driven_m += step.min(LONGEST_STEP_M);
            self.last = Some((pose, scan.clone()));
        }
    }
}

/// A scan that changes at last shows no longer a drive than this, metres.
const LONGEST_STEP_M: f64 = 1.0;

/// True for scans that show the same from the same place.
fn is_same(one: &Scan, other: &Scan) -> bool {
    let same = |beam: &usize| match (one.hit(*beam), other.hit(*beam)) {
        (Some(a), Some(b)) => f64::from((a - b).abs()) < SAME_M + SAME_SHARE * f64::from(a),
        (a, b) => a == b,
    };
    let beams = one.len();
    beams == other.len() && (0..beams).filter(same).count() as f64 >= SAME_BEAMS * beams as f64
}

impl Pieces {
    pub fn new(settings: IntegritySettings) -> Self {
        Pieces {
            proven_m: settings.proven_m,
            patches_before: Vec::new(),
            bad: Vec::new(),
            open: None,
            began: 0,
            way: Way::default(),
            unproven: false,
            aside: false,
        }
    }

    /// The scan since which the laser has been blind, if that is why data are bad.
    pub fn blind_since(&self) -> Option<usize> {
        let (fault, from) = self.open?;
        (fault == Fault::Blind).then_some(from)
    }

    /// Notes that a scan is about to be mapped.
    pub fn begin_scan(&mut self, map: &Map) {
        self.patches_before.push(map.manifold.patches().len());
    }

    /// Notes where the robot is on the present piece.
    pub fn drive(&mut self, pose: Pose2, scan: &Scan) {
        if self.is_unproven() {
            self.way.on(pose, scan);
        }
    }

    /// What is left out by now of `scans` scans.
    pub fn bad_stretches(&self, scans: usize) -> Vec<BadStretch> {
        let mut stretches = self.bad.clone();
        stretches.extend(self.open.map(|(fault, from)| stretch(fault, from..scans)));
        if let Some(last) = stretches.last_mut().filter(|_| self.aside) {
            last.scans.end = scans;
        }
        stretches
    }

    /// Cuts the map before scan `from`: everything since is left out, and with it a piece that has
    /// not proven itself.
    pub fn cut(&mut self, fault: Fault, from: usize, map: &mut Map, scans: &mut [ScanRecord]) {
        let (mut fault, mut from) = (fault, from);
        if self.is_unproven()
            && let Some(before) = self.bad.pop()
        {
            // One mishap, however many times the robot was lost in it.
            (fault, from) = (before.fault, before.scans.start);
        }
        self.open = Some((fault, from));
        let first = self.first_patch(from);
        scans.iter_mut().skip(from).for_each(|scan| scan.left_out = true);
        leave_out_since(first, map);
    }

    /// Data are good from scan `from` on; `bridged` where odometry tells how the new piece lies to
    /// the one before, which it then continues.
    pub fn resume(&mut self, from: usize, bridged: bool) {
        if let Some((fault, since)) = self.open.take() {
            self.bad.push(BadStretch { bridged, ..stretch(fault, since..from) });
            self.unproven = !bridged;
        }
        (self.began, self.way) = (from, Way::default());
    }

    /// Leaves a piece out that has not proven itself, at the end of the log.
    pub fn set_aside(&mut self, map: &mut Map, scans: &mut [ScanRecord]) {
        if self.is_unproven() && !self.aside {
            self.aside = true;
            self.leave_out_piece(map, scans, true);
        }
    }

    /// Takes it in again: the log goes on.
    pub fn take_up(&mut self, map: &mut Map, scans: &mut [ScanRecord]) {
        if std::mem::take(&mut self.aside) {
            self.leave_out_piece(map, scans, false);
        }
    }

    fn leave_out_piece(&self, map: &mut Map, scans: &mut [ScanRecord], left_out: bool) {
        let patches = map.manifold.patches().iter().skip(self.first_patch(self.began).index());
        let patches = patches.map(|p| p.id).collect();
        map.manifold.leave_out(patches, left_out);
        scans.iter_mut().skip(self.began).for_each(|scan| scan.left_out = left_out);
    }

    /// True on a piece that follows a cut, as long as the robot has not shown to drive on it.
    pub fn is_unproven(&self) -> bool {
        self.unproven && self.open.is_none() && self.way.driven_m < self.proven_m
    }

    /// The first patch made of a scan or of one after it.
    fn first_patch(&self, scan: usize) -> PatchId {
        PatchId(self.patches_before.get(scan).map_or(u32::MAX, |&patches| patches as u32))
    }
}

fn stretch(fault: Fault, scans: Range<usize>) -> BadStretch {
    BadStretch { fault, scans, bridged: false }
}

/// Leaves out all patches from `first` on, and takes back what relates them to others.
fn leave_out_since(first: PatchId, map: &mut Map) {
    let manifold = &mut map.manifold;
    let across = |r: &&Relation| (r.from < first) != (r.to < first);
    let relations: Vec<RelationId> =
        manifold.active_relations().filter(across).map(|r| r.id).collect();
    for id in relations {
        manifold.retract(id, Retraction::BadData);
    }
    let since = manifold.patches().iter().skip(first.index()).filter(|p| !p.left_out);
    let patches = since.map(|p| p.id).collect();
    manifold.leave_out(patches, true);
}
