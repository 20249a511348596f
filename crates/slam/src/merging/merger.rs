use super::agenda::{Agenda, firsts};
use super::by_geometry::{GeometricMerging, IslandPair};
use super::landmarks::propose_by_landmarks;
use super::together::together;
use super::{Merge, MergeState, Proposal, join};
use crate::SlamConfig;
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
/// Of a provisional merge so many relations are put on record.
const MOST_PROVISIONAL: usize = 10;

impl Merger {
    /// Joins islands as long as the evidence suffices. Where nothing joins any more further places
    /// are compared. `tracks` are the robots' scans, in the order of the robots.
    pub fn run(&mut self, map: &mut Map, tracks: &[&[ScanRecord]], config: &SlamConfig) {
        let mut geometry = config.merging.geometry.then(|| GeometricMerging::new(map, config));
        let mut islands = map.manifold.component_map();
        let (mut left, mut looked) = (Vec::new(), true);
        for pass in 0.. {
            looked &= geometry.as_mut().is_some_and(|g| g.look(map, &islands, config));
            // Landmarks are compared in any case.
            if islands.members.len() < 2 || pass > 0 && !looked {
                break;
            }
            left = self.join_all(map, &mut islands, geometry.as_ref(), tracks, config);
        }
        self.tried += geometry.map_or(0, |geometry| geometry.tried());
        self.put_on_record(map, &islands, &left);
        // A merge whose relations were all found wrong is none.
        let holds = |id: &RelationId| map.manifold.relation(*id).is_active();
        self.merges.retain(|m| m.state != MergeState::Merged || m.relations.iter().any(holds));
    }

    /// Joins islands by what was compared so far, and by landmarks; the proposals that are left.
    fn join_all(
        &mut self,
        map: &mut Map,
        islands: &mut Islands,
        geometry: Option<&GeometricMerging>,
        tracks: &[&[ScanRecord]],
        config: &SlamConfig,
    ) -> Vec<Proposal> {
        let mut agenda = Agenda::default();
        let (mut unsure, mut by_landmarks): (Vec<Proposal>, Vec<Proposal>) = Default::default();
        let mut new: BTreeSet<usize> = (0..islands.members.len()).collect();
        loop {
            let is_new = |island: usize| new.contains(&island);
            if !new.is_empty() {
                agenda.add(geometry.map_or(Vec::new(), |g| g.pairs(map, islands, is_new, config)));
                let mut found = propose_by_landmarks(map, islands, tracks, is_new, config);
                found.retain(|p| p.ends(islands).is_some_and(|e| !agenda.refuses(e, islands)));
                by_landmarks.extend(found);
                new.clear();
            }
            let pairs = agenda.next(islands);
            let landmarks = due(&mut by_landmarks, &pairs, islands);
            if pairs.is_empty() && landmarks.is_empty() {
                return unsure;
            }
            let found = geometry.map_or(Vec::new(), |g| g.propose(map, islands, &pairs, config));
            let mut found = together(map, islands, found, landmarks);
            found.retain(|p| !taken_back_by_user(map, islands, p));
            let (sure, others): (Vec<_>, Vec<_>) = found.into_iter().partition(Proposal::is_sure);
            unsure.extend(others);
            let sure = surest(sure, islands);
            if sure.is_empty() {
                continue;
            }
            let ends = self.join(map, islands, &sure);
            *islands = map.manifold.component_map();
            let which = ends.iter().map(|&patch| islands.of(patch)).collect();
            self.contradicted += optimise_islands(map, islands, &which, config).len();
            self.optimisations += 1;
            *islands = map.manifold.component_map();
            new = ends.iter().map(|&patch| islands.of(patch)).collect();
            let is_old = |(a, b): (usize, usize)| !new.contains(&a) && !new.contains(&b);
            unsure.retain(|p| p.ends(islands).is_some_and(is_old));
            by_landmarks.retain(|p| p.ends(islands).is_some_and(is_old));
            agenda.forget(|pair| !is_old(pair.ends(islands)));
            // What has come apart again is not tried another time.
            let apart = |p: &Proposal| {
                p.ends(islands).filter(|(a, b)| a != b).map(|ends| firsts(ends, islands))
            };
            agenda.refuse(sure.iter().filter_map(apart));
        }
    }

    /// Joins islands that are all different; returns patches of all of them.
    fn join(&mut self, map: &mut Map, islands: &Islands, proposals: &[Proposal]) -> Vec<PatchId> {
        let mut ends = Vec::new();
        for proposal in proposals {
            let Some((target, source)) = proposal.ends(islands) else { continue };
            let relations = join(map, islands, proposal);
            let mut island = [&islands.members[target][..], &islands.members[source]].concat();
            island.sort_unstable();
            for id in doubt_relations(map, &island, &relations) {
                map.manifold.retract(id, Retraction::Contradicted);
                self.contradicted += 1;
            }
            ends.extend([islands.members[target][0], islands.members[source][0]]);
            ends.extend(proposal.links.iter().flat_map(|link| [link.from, link.to]));
            self.note(map, islands, proposal, relations, MergeState::Merged);
        }
        ends
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

/// Takes out the proposals by landmarks for pairs of islands that are examined now; where no pair
/// is left to be examined, all of them.
fn due(by_landmarks: &mut Vec<Proposal>, pairs: &[IslandPair], islands: &Islands) -> Vec<Proposal> {
    if pairs.is_empty() {
        return std::mem::take(by_landmarks);
    }
    let ends: BTreeSet<_> = pairs.iter().map(|p| firsts(p.ends(islands), islands)).collect();
    let is_due = |p: &mut Proposal| {
        p.ends(islands).is_some_and(|found| ends.contains(&firsts(found, islands)))
    };
    by_landmarks.extract_if(.., is_due).collect()
}

/// The surest proposals of which no two are about the same island, in their order. Those left out
/// are about islands that join, and are looked for anew.
fn surest(proposals: Vec<Proposal>, islands: &Islands) -> Vec<Proposal> {
    let mut ranked: Vec<usize> = (0..proposals.len()).collect();
    ranked.sort_by(|&a, &b| proposals[a].false_bound.total_cmp(&proposals[b].false_bound));
    let (mut busy, mut chosen) = (BTreeSet::new(), BTreeSet::new());
    for i in ranked {
        let Some((target, source)) = proposals[i].ends(islands) else { continue };
        if !busy.contains(&target) && !busy.contains(&source) {
            busy.extend([target, source]);
            chosen.insert(i);
        }
    }
    let all = proposals.into_iter().enumerate();
    all.filter(|(i, _)| chosen.contains(i)).map(|(_, proposal)| proposal).collect()
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
