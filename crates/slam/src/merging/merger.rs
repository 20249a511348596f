use super::agenda::Agenda;
use super::by_geometry::GeometricMerging;
use super::landmarks::propose_by_landmarks;
use super::together::together;
use super::{Merge, MergeState, Proposal, join};
use crate::SlamConfig;
use crate::elevation::estimate_elevations;
use crate::map::Map;
use crate::refit::{doubt_relations, optimise_islands};
use crate::track::ScanRecord;
use manifold::{Islands, PatchId, Provenance, RelationId, RelationState, Retraction};
use std::collections::BTreeSet;

/// Joins a team's islands.
#[derive(Clone, Debug, Default)]
pub(crate) struct Merger {
    /// What was merged, and what may be.
    pub merges: Vec<Merge>,
    /// Places compared.
    pub tried: usize,
    /// Optimisations of all relations.
    pub optimisations: usize,
    /// Relations found to contradict the rest.
    pub contradicted: usize,
}

/// Provisional merges less likely than this are not worth telling.
const WORTH_TELLING: f64 = 0.1;
/// Passes of comparisons before the loops between joined islands are closed; most of what can be
/// joined is by then.
const FIRST_PASSES: usize = 1;
/// Of a provisional merge so many relations are put on record.
const MOST_PROVISIONAL: usize = 10;

/// How far merging has come.
struct State {
    islands: Islands,
    /// Pairs of islands whose places are to be examined.
    agenda: Agenda,
    /// What places say of islands that they were not enough to join.
    by_places: Vec<Proposal>,
    /// What landmarks say of islands that are apart.
    by_landmarks: Vec<Proposal>,
    /// Islands that have grown since their pairs were last put on the agenda.
    new: BTreeSet<usize>,
}

impl Merger {
    /// Joins islands by the places that look most alike, as long as the evidence suffices: what
    /// can be joined before the loops between the joined islands' robots are closed. What falls
    /// short is not told yet.
    pub fn begin(&mut self, map: &mut Map, tracks: &[&[ScanRecord]], config: &SlamConfig) {
        if config.merging.geometry {
            let mut geometry = GeometricMerging::new(map, config);
            let mut state = State::new(map, tracks, config);
            self.look(map, tracks, &mut state, &mut geometry, FIRST_PASSES, config);
            self.conclude(map, Some(&geometry));
        }
    }

    /// Joins islands as long as the evidence suffices. Where nothing joins any more further places
    /// are compared; landmarks decide alone when all places were heard. `tracks` are the robots'
    /// scans, in the order of the robots.
    pub fn run(&mut self, map: &mut Map, tracks: &[&[ScanRecord]], config: &SlamConfig) {
        let mut geometry = config.merging.geometry.then(|| GeometricMerging::new(map, config));
        let mut state = State::new(map, tracks, config);
        if let Some(geometry) = &mut geometry {
            self.look(map, tracks, &mut state, geometry, usize::MAX, config);
        }
        let left = loop {
            let State { by_places, by_landmarks, .. } = &state;
            let found = together(map, &state.islands, by_places.clone(), by_landmarks.clone());
            let (sure, others) = state.decide(map, found);
            if sure.is_empty() {
                break others;
            }
            self.join(map, tracks, &mut state, &sure, config);
            if let Some(geometry) = &geometry {
                self.join_by_places(map, tracks, &mut state, geometry, false, config);
            }
        };
        self.put_on_record(map, &state.islands, &left);
        self.conclude(map, geometry.as_ref());
    }

    /// Compares places in `passes` at most, and joins islands after each.
    fn look(
        &mut self,
        map: &mut Map,
        tracks: &[&[ScanRecord]],
        state: &mut State,
        geometry: &mut GeometricMerging,
        passes: usize,
        config: &SlamConfig,
    ) {
        for _ in 0..passes {
            if state.islands.members.len() < 2 || !geometry.look(map, &state.islands, config) {
                break;
            }
            self.join_by_places(map, tracks, state, geometry, true, config);
        }
    }

    fn conclude(&mut self, map: &Map, geometry: Option<&GeometricMerging>) {
        self.tried += geometry.map_or(0, GeometricMerging::tried);
        // A merge whose relations were all found wrong is none.
        let holds = |id: &RelationId| map.manifold.relation(*id).is_active();
        self.merges.retain(|m| m.state != MergeState::Merged || m.relations.iter().any(holds));
    }

    /// Joins islands by what was compared so far, with landmarks that say the same or something
    /// else.
    fn join_by_places(
        &mut self,
        map: &mut Map,
        tracks: &[&[ScanRecord]],
        state: &mut State,
        geometry: &GeometricMerging,
        mut looked: bool,
        config: &SlamConfig,
    ) {
        loop {
            let is_new = |island: usize| state.new.contains(&island);
            let pairs = geometry.pairs(map, &state.islands, is_new, looked, config);
            state.agenda.replace(pairs, &state.islands);
            state.new.clear();
            looked = false;
            let sure = loop {
                let pairs = state.agenda.next(&state.islands, geometry.is_last());
                if pairs.is_empty() {
                    return;
                }
                let examined: BTreeSet<_> =
                    pairs.iter().map(|pair| in_order(pair.ends(&state.islands))).collect();
                let is_examined = |p: &Proposal| {
                    p.ends(&state.islands).is_some_and(|ends| examined.contains(&in_order(ends)))
                };
                state.by_places.retain(|p| !is_examined(p));
                let by_places = geometry.propose(map, &state.islands, &pairs, config);
                let known =
                    |p: &&Proposal| by_places.iter().any(|q| same_pair(q, p, &state.islands));
                let landmarks = state.by_landmarks.iter().filter(known).cloned().collect();
                let found = together(map, &state.islands, by_places.clone(), landmarks);
                // Landmarks are asked again when all places were heard.
                state.by_places.extend(by_places);
                let (sure, _) = state.decide(map, found);
                if !sure.is_empty() {
                    break sure;
                }
            };
            self.join(map, tracks, state, &sure, config);
        }
    }

    /// Joins islands that are all different.
    fn join(
        &mut self,
        map: &mut Map,
        tracks: &[&[ScanRecord]],
        state: &mut State,
        proposals: &[Proposal],
        config: &SlamConfig,
    ) {
        let mut ends = Vec::new();
        let islands = &state.islands;
        for proposal in proposals {
            let Some((target, source)) = proposal.ends(islands) else { continue };
            let relations = join(map, islands, proposal);
            let mut island = [&islands.members[target][..], &islands.members[source]].concat();
            island.sort_unstable();
            for id in doubt_relations(map, &island, &relations) {
                map.manifold.retract(id, Retraction::Contradicted);
                self.contradicted += 1;
            }
            // Should it come apart again, it is not tried another time.
            state.agenda.refuse((target, source), islands);
            ends.extend([islands.members[target][0], islands.members[source][0]]);
            ends.extend(proposal.links.iter().flat_map(|link| [link.from, link.to]));
            self.note(map, islands, proposal, relations, MergeState::Merged);
        }
        let islands = map.manifold.component_map();
        let which = ends.iter().map(|&patch| islands.of(patch)).collect();
        self.contradicted += optimise_islands(map, &islands, &which, config).len();
        estimate_elevations(map);
        self.optimisations += 1;
        state.renew(map, &ends, tracks, config);
    }

    /// Notes what is likely but not sure enough.
    fn put_on_record(&mut self, map: &mut Map, islands: &Islands, proposals: &[Proposal]) {
        for proposal in proposals.iter().filter(|p| p.false_bound < WORTH_TELLING) {
            let propose = |l: &super::Link| match on_record(map, l) {
                Some(id) => id,
                None => map.manifold.propose(l.from, l.to, l.from_from_to, l.provenance),
            };
            let relations = proposal.links.iter().take(MOST_PROVISIONAL).map(propose).collect();
            self.note(map, islands, proposal, relations, MergeState::Provisional);
        }
    }

    fn note(
        &mut self,
        map: &Map,
        islands: &Islands,
        proposal: &Proposal,
        relations: Vec<RelationId>,
        state: MergeState,
    ) {
        let Some((target, source)) = proposal.ends(islands) else { return };
        let provenance = proposal.links.first().map_or(Provenance::Merge, |l| l.provenance);
        self.merges.push(Merge {
            robots: [target, source].map(|island| names(map, &islands.members[island])),
            state,
            provenance,
            relations,
            evidence: proposal.evidence,
            false_bound: proposal.false_bound,
        });
    }
}

/// The relation of a link that was proposed already.
fn on_record(map: &Map, link: &super::Link) -> Option<RelationId> {
    let same = |r: &&manifold::Relation| {
        (r.from, r.to, r.provenance, r.state)
            == (link.from, link.to, link.provenance, RelationState::Provisional)
    };
    map.manifold.relations().iter().find(same).map(|r| r.id)
}

/// The robots of some patches, by name.
fn names(map: &Map, patches: &[PatchId]) -> Vec<String> {
    let ids: BTreeSet<_> = patches.iter().map(|&p| map.manifold.patch(p).robot).collect();
    let robots = map.manifold.robots().iter().filter(|r| ids.contains(&r.id));
    robots.map(|r| r.name.to_string()).collect()
}

/// True when the user has taken back a merge of two of the islands' robots: it is not proposed
/// again.
fn taken_back_by_user(map: &Map, islands: &Islands, proposal: &Proposal) -> bool {
    let robot = |patch: PatchId| map.manifold.patch(patch).robot;
    let Some(ends) = proposal.ends(islands) else { return false };
    map.manifold.relations().iter().any(|r| {
        let across = (islands.of(r.from), islands.of(r.to));
        r.state == RelationState::Retracted(Retraction::ByUser)
            && robot(r.from) != robot(r.to)
            && (across == ends || across == (ends.1, ends.0))
    })
}

impl State {
    fn new(map: &Map, tracks: &[&[ScanRecord]], config: &SlamConfig) -> Self {
        let islands = map.manifold.component_map();
        let by_landmarks = propose_by_landmarks(map, &islands, tracks, |_| true, config);
        let (agenda, by_places, new) = (Agenda::default(), Vec::new(), BTreeSet::new());
        State { islands, agenda, by_places, by_landmarks, new }
    }

    /// Those of proposals that are sure enough, the surest first and no island in two of them, and
    /// those that are not sure enough.
    fn decide(&self, map: &Map, mut found: Vec<Proposal>) -> (Vec<Proposal>, Vec<Proposal>) {
        let islands = &self.islands;
        found.retain(|p| {
            p.ends(islands).is_some_and(|ends| !self.agenda.is_refused(ends, islands))
                && !taken_back_by_user(map, islands, p)
        });
        let (mut sure, others): (Vec<_>, Vec<_>) = found.into_iter().partition(Proposal::is_sure);
        sure.sort_by(|a, b| a.false_bound.total_cmp(&b.false_bound));
        let mut busy = BTreeSet::new();
        sure.retain(|p| {
            p.ends(islands).is_some_and(|(a, b)| {
                let is_free = !busy.contains(&a) && !busy.contains(&b);
                if is_free {
                    busy.extend([a, b]);
                }
                is_free
            })
        });
        (sure, others)
    }

    /// Forgets what was said of islands that have joined, at some of their patches.
    fn renew(
        &mut self,
        map: &Map,
        joined: &[PatchId],
        tracks: &[&[ScanRecord]],
        config: &SlamConfig,
    ) {
        let islands = map.manifold.component_map();
        let new: BTreeSet<usize> = joined.iter().map(|&patch| islands.of(patch)).collect();
        let is_new = |island: usize| new.contains(&island);
        let is_old = |p: &Proposal| p.ends(&islands).is_some_and(|(a, b)| !is_new(a) && !is_new(b));
        self.by_places.retain(is_old);
        self.by_landmarks.retain(is_old);
        self.by_landmarks.extend(propose_by_landmarks(map, &islands, tracks, is_new, config));
        (self.islands, self.new) = (islands, new);
    }
}

fn in_order((a, b): (usize, usize)) -> (usize, usize) {
    (a.min(b), a.max(b))
}

/// True for proposals about the same two islands.
fn same_pair(one: &Proposal, other: &Proposal, islands: &Islands) -> bool {
    one.ends(islands).map(in_order) == other.ends(islands).map(in_order)
}
