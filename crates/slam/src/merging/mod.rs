//! Joining islands where evidence says how they lie to each other (thesis 5.4.4).

mod agenda;
mod by_geometry;
mod common_ground;
mod estimate;
mod evidence;
mod landmarks;
mod merger;
mod pieces;
mod places;
mod recognition;
mod sets;
mod surroundings;
mod together;
mod usual;

pub(crate) use landmarks::{GATE_CHI2, carried, places_of, point_jacobian, revisit, turned};
pub use landmarks::{
    IslandLandmark, IslandLandmarks, LandmarkAlignment, LandmarkRefit, LandmarkSettings,
    compare_landmarks,
};
pub(crate) use merger::Merger;

use crate::map::Map;
use geometry::{GaussianPose2, Pose2};
use manifold::{Elevation, Islands, PatchId, Provenance, RelationId};
use serde::{Deserialize, Serialize};
use std::ops::Add;

/// Joining islands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MergingSettings {
    /// Look for merges.
    pub enabled: bool,
    /// Look for them by geometry: places that look alike.
    pub geometry: bool,
    /// Islands are joined only when the chance that this is wrong is bounded by so much; what falls
    /// short is put on record as provisional. The default lets four places that fit pass, if more
    /// is confirmed than a copy of a part of the building could hold.
    pub false_merges: f64,
    /// Places of an island that are compared with others lie so far apart, metres.
    pub spacing_m: f64,
    /// Places of other islands that each is compared with, those that look most like it.
    pub candidates: usize,
    /// Of one island they lie at least so far apart, metres.
    pub apart_m: f64,
    /// Each is looked for so far around them along either axis, metres.
    pub window_m: f64,
    /// A place's own surroundings reach this far, metres ...
    pub query_distance_m: f64,
    /// ... over at most this many patches.
    pub query_patches: usize,
    /// Share of them that must fit.
    pub share: f64,
    /// Matches that must agree before a merge is looked into.
    pub least_agreeing: usize,
    /// Joining them by landmarks, and closing loops by them.
    pub landmarks: LandmarkSettings,
}

impl Default for MergingSettings {
    fn default() -> Self {
        MergingSettings {
            enabled: true,
            geometry: true,
            false_merges: 1.1e-4,
            spacing_m: 2.0,
            candidates: 10,
            apart_m: 3.0,
            window_m: 3.0,
            query_distance_m: 5.0,
            query_patches: 8,
            share: 0.6,
            least_agreeing: 3,
            landmarks: LandmarkSettings::default(),
        }
    }
}

/// A way in which two islands may lie to each other, with what speaks for it.
#[derive(Clone, Debug)]
pub(crate) struct Proposal {
    /// The source island's frame seen from the target's.
    pub target_from_source: Pose2,
    /// What speaks for it and against it, counted.
    pub evidence: EvidenceCounts,
    /// Relations from patches of the target to patches of the source; never empty.
    pub links: Vec<Link>,
    /// Bound on the chance that the proposal is wrong.
    pub false_bound: f64,
    /// With evidence of this kind that may be so much.
    pub most_false: f64,
}

/// What speaks for and against a merge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct EvidenceCounts {
    /// Matches that agree pairwise about how the islands lie to each other.
    pub matches: usize,
    /// Independent places, or landmarks, that fit.
    pub agreeing: usize,
    /// Independent places where one island sees through the other's walls, or landmarks that do
    /// not fit.
    pub contradicting: usize,
    /// Places of the overlap that were looked at.
    pub places: usize,
    /// Those of them that fit.
    pub fitting: usize,
    /// Mean share of sight lines through the other island's walls, per mille.
    pub seen_through_per_mille: u32,
    /// Surface that both islands know something of, metres.
    pub compared_m: u32,
    /// That of it which a copy of a part of the building, 20 m long and wide, cannot hold, metres.
    pub beyond_m: u32,
    /// That of it where one island looks through what the other has, centimetres.
    pub contradicted_cm: u32,
    /// Pieces of contradicted surface: what hangs together, at most a metre each.
    pub pieces: usize,
    /// Squares of five metres in which the surfaces of both agree and tell where they are.
    pub squares: usize,
    /// Those of them that such a copy cannot hold.
    pub beyond: usize,
}

impl Add for EvidenceCounts {
    type Output = Self;

    /// The counts of two kinds of evidence for the same.
    fn add(self, other: Self) -> Self {
        EvidenceCounts {
            matches: self.matches + other.matches,
            agreeing: self.agreeing + other.agreeing,
            contradicting: self.contradicting + other.contradicting,
            places: self.places + other.places,
            fitting: self.fitting + other.fitting,
            seen_through_per_mille: self.seen_through_per_mille.max(other.seen_through_per_mille),
            compared_m: self.compared_m + other.compared_m,
            beyond_m: self.beyond_m + other.beyond_m,
            pieces: self.pieces + other.pieces,
            contradicted_cm: self.contradicted_cm + other.contradicted_cm,
            squares: self.squares + other.squares,
            beyond: self.beyond + other.beyond,
        }
    }
}

/// What became of a proposal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MergeState {
    /// The islands were joined.
    Merged,
    /// The evidence is not enough; the relations are on record as provisional.
    Provisional,
}

/// A merge that was made or considered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Merge {
    /// Names of the robots on the two islands, as they were then.
    pub robots: [Vec<String>; 2],
    /// What became of it.
    pub state: MergeState,
    /// Kind of the evidence.
    pub provenance: Provenance,
    /// The relations it made or proposes.
    pub relations: Vec<RelationId>,
    /// What speaks for and against it.
    pub evidence: EvidenceCounts,
    /// Bound on the chance that it is wrong.
    pub false_bound: f64,
}

/// A relation between two islands that is not made yet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    /// Patch of the target island.
    pub from: PatchId,
    /// Patch of the source island.
    pub to: PatchId,
    pub from_from_to: GaussianPose2,
    pub provenance: Provenance,
}

impl Link {
    /// The frame of the island of `to` seen from that of `from`, as the link has it.
    pub fn target_from_source(&self, map: &Map) -> Pose2 {
        map.pose(self.from) * self.from_from_to.mean * map.pose(self.to).inverse()
    }

    /// Height of the island of `to` above that of `from`, as the link has it: both ends stand on
    /// the same floor. `None` where nothing tells.
    pub fn rise(&self, map: &Map) -> Option<Elevation> {
        let [from, to] = [self.from, self.to].map(|end| map.manifold.patch(end).elevation);
        let (from, to) = from.zip(to)?;
        let variance_m2 = from.variance_m2 + to.variance_m2;
        Some(Elevation { height_m: from.height_m - to.height_m, variance_m2 })
    }

    /// False when two links of the same islands say that they lie at different heights.
    pub fn agrees_in_height(&self, other: &Link, map: &Map) -> bool {
        let rises = self.rise(map).zip(other.rise(map));
        rises.is_none_or(|(a, b)| !a.is_apart_from(&b))
    }
}

/// Two alignments of the same islands nearer than this at their links are the same one, metres and
/// radians: islands are bent.
const SAME_M: f64 = 1.5;
const SAME_RAD: f64 = 0.15;

/// True when two sets of links say the same: most of the second lie where the nearest of the first
/// has them, and at that height. They may differ by so much more per metre between them.
fn say_the_same(map: &Map, links: &[Link], others: &[Link], bent_per_m: f64) -> bool {
    let agrees = |other: &&Link| {
        let place = map.pose(other.to);
        let distance = |link: &&Link| map.pose(link.to).distance(&place);
        let nearest = links.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.is_some_and(|near| {
            let here = near.target_from_source(map) * place;
            let apart = here.between(&(other.target_from_source(map) * place));
            let is_near = apart.norm() < SAME_M + bent_per_m * distance(&near);
            is_near && apart.yaw.abs() < SAME_RAD && near.agrees_in_height(other, map)
        })
    };
    2 * others.iter().filter(agrees).count() > others.len()
}

impl Proposal {
    /// True when the evidence suffices to join the islands.
    pub fn is_sure(&self) -> bool {
        self.false_bound <= self.most_false
    }

    /// The indices of the two islands, target first.
    pub fn ends(&self, islands: &Islands) -> Option<(usize, usize)> {
        let link = self.links.first()?;
        Some((islands.of(link.from), islands.of(link.to)))
    }
}

/// Joins two islands: the source is moved as a rigid body into the target's frame and the links
/// become relations. The poses are not optimised yet.
fn join(map: &mut Map, islands: &Islands, proposal: &Proposal) -> Vec<RelationId> {
    let Some((target, source)) = proposal.ends(islands) else { return Vec::new() };
    if target != source {
        let moved = |&patch: &PatchId| (patch, proposal.target_from_source * map.pose(patch));
        let poses = islands.members[source].iter().map(moved).collect();
        map.manifold.refit(poses);
    }
    let relate = |l: &Link| map.manifold.relate(l.from, l.to, l.from_from_to, l.provenance);
    proposal.links.iter().map(relate).collect()
}
