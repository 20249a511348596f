use super::agenda::{Agenda, firsts};
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
/// Of a provisional merge so many relations are put on record.
const MOST_PROVISIONAL: usize = 10;

impl Merger {
    /// Joins islands as long as the evidence suffices. Where nothing joins any more further places
    /// are compared; landmarks are heard when all places were. `tracks` are the robots' scans, in
    /// the order of the robots.
    pub fn run(&mut self, map: &mut Map, tracks: &[&[ScanRecord]], config: &SlamConfig) {
        let mut geometry = config.merging.geometry.then(|| GeometricMerging::new(map, config));
        let mut islands = map.manifold.component_map();
        let mut left = Vec::new();
        let by_landmarks = |map: &Map, islands: &Islands, is_new: &dyn Fn(usize) -> bool| {
            propose_by_landmarks(map, islands, tracks, is_new, config)
        };
        if let Some(geometry) = &mut geometry {
            while islands.members.len() > 1 && geometry.look(map, &islands, config) {
                left =
                    self.join_all(map, &mut islands, Some(geometry), by_landmarks, false, config);
            }
        }
        if islands.members.len() > 1 && !map.manifold.sightings().is_empty() {
            let geometry = geometry.as_ref();
            left = self.join_all(map, &mut islands, geometry, by_landmarks, true, config);
        }
        self.tried += geometry.as_ref().map_or(0, GeometricMerging::tried);
        self.put_on_record(map, &islands, &left);
        // A merge whose relations were all found wrong is none.
        let holds = |id: &RelationId| map.manifold.relation(*id).is_active();
        self.merges.retain(|m| m.state != MergeState::Merged || m.relations.iter().any(holds));
    }

    /// Joins islands by what was compared so far together with what landmarks say, `alone` also by
    /// landmarks without any place; the proposals that are left.
    fn join_all(
        &mut self,
        map: &mut Map,
        islands: &mut Islands,
        geometry: Option<&GeometricMerging>,
        by_landmarks: impl Fn(&Map, &Islands, &dyn Fn(usize) -> bool) -> Vec<Proposal>,
        alone: bool,
        config: &SlamConfig,
    ) -> Vec<Proposal> {
        let look = |map: &Map, islands: &Islands, is_new: &dyn Fn(usize) -> bool| {
            geometry.map_or_else(Vec::new, |g| g.pairs(map, islands, is_new, config))
        };
        let mut agenda = Agenda::default();
        agenda.add(look(map, islands, &|_| true));
        let mut known = by_landmarks(map, islands, &|_| true);
        let mut unsure: Vec<Proposal> = Vec::new();
        loop {
            let pairs = agenda.next(islands);
            let is_heard = pairs.is_empty();
            let by_geometry = match geometry {
                _ if is_heard => unsure.clone(),
                Some(geometry) => geometry.propose(map, islands, &pairs, config),
                None => Vec::new(),
            };
            let mut landmarks = known.clone();
            if !(is_heard && alone) {
                landmarks.retain(|p| {
                    by_geometry.iter().any(|g| pair_of(g, islands) == pair_of(p, islands))
                });
            }
            let mut found = together(map, islands, by_geometry.clone(), landmarks);
            found.retain(|p| {
                !taken_back_by_user(map, islands, p) && !agenda.is_refused(p.ends(islands), islands)
            });
            let (sure, others): (Vec<_>, Vec<_>) = found.into_iter().partition(Proposal::is_sure);
            if sure.is_empty() && is_heard {
                return others;
            }
            if !is_heard {
                // Without what landmarks say: that is asked again.
                unsure.extend(by_geometry);
            }
            if sure.is_empty() {
                continue;
            }
            let sure = disjoint(sure, islands);
            let ends = self.join(map, islands, &sure);
            *islands = map.manifold.component_map();
            let which = ends.iter().map(|&patch| islands.of(patch)).collect();
            self.contradicted += optimise_islands(map, islands, &which, config).len();
            estimate_elevations(map);
            self.optimisations += 1;
            *islands = map.manifold.component_map();
            let new: BTreeSet<usize> = ends.iter().map(|&patch| islands.of(patch)).collect();
            let is_new = |island: usize| new.contains(&island);
            let is_old = |(a, b): (usize, usize)| !is_new(a) && !is_new(b);
            unsure.retain(|p| p.ends(islands).is_some_and(is_old));
            agenda.forget(|pair| !is_old(pair.ends(islands)));
            // What has come apart again is not tried another time.
            let apart = |p: &Proposal| {
                p.ends(islands).filter(|(a, b)| a != b).map(|ends| firsts(ends, islands))
            };
            agenda.refuse(sure.iter().filter_map(apart));
            agenda.add(look(map, islands, &is_new));
            known.retain(|p| p.ends(islands).is_some_and(is_old));
            known.extend(by_landmarks(map, islands, &is_new));
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

/// Of proposals those that each have their islands for themselves, the surest first.
fn disjoint(mut proposals: Vec<Proposal>, islands: &Islands) -> Vec<Proposal> {
    proposals.sort_by(|a, b| a.false_bound.total_cmp(&b.false_bound));
    let mut busy = BTreeSet::new();
    let mut is_free = |p: &Proposal| {
        p.ends(islands).is_some_and(|(a, b)| {
            let free = !busy.contains(&a) && !busy.contains(&b);
            if free {
                busy.extend([a, b]);
            }
            free
        })
    };
    proposals.retain(|p| is_free(p));
    proposals
}

/// The two islands of a proposal, in order.
fn pair_of(proposal: &Proposal, islands: &Islands) -> Option<(usize, usize)> {
    proposal.ends(islands).map(|(a, b)| (a.min(b), a.max(b)))
}
