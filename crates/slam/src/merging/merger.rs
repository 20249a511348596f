use super::by_geometry::GeometricMerging;
use super::{Merge, MergeState, Proposal, join};
use crate::SlamConfig;
use crate::elevation::estimate_elevations;
use crate::map::Map;
use crate::refit::{doubt_relations, optimise_relations};
use manifold::{Islands, PatchId, Provenance, RelationId, Retraction};
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
    /// Joins islands as long as the evidence suffices. In every round each island takes part in one
    /// merge at most, the surest first; what joined is looked at anew, as one island has more to
    /// compare than its parts.
    pub fn run(&mut self, map: &mut Map, config: &SlamConfig) {
        let geometry = GeometricMerging::new(map, config);
        self.tried += geometry.tried;
        loop {
            let islands = map.manifold.component_map();
            let mut proposals = geometry.propose(map, &islands, config);
            proposals.retain(|p| !taken_back_by_user(map, &islands, p));
            proposals.sort_by(|a, b| a.false_bound.total_cmp(&b.false_bound));
            if !self.join_surest(map, &islands, &proposals, config) {
                self.put_on_record(map, &islands, &proposals);
                break;
            }
            self.contradicted += optimise_relations(map, config).len();
            estimate_elevations(map);
            self.optimisations += 1;
            // Where all that was joined has come apart again, nothing new is to be learnt.
            if map.manifold.component_map().members.len() == islands.members.len() {
                break;
            }
        }
        // A merge whose relations were all found wrong is none.
        let holds = |id: &RelationId| map.manifold.relation(*id).is_active();
        self.merges.retain(|m| m.state != MergeState::Merged || m.relations.iter().any(holds));
    }

    /// Joins islands whose proposals are sure enough; true if any were.
    fn join_surest(
        &mut self,
        map: &mut Map,
        islands: &Islands,
        proposals: &[Proposal],
        config: &SlamConfig,
    ) -> bool {
        let mut busy = BTreeSet::new();
        let sure = proposals.iter().filter(|p| p.false_bound <= config.merging.false_merges);
        let mut any = false;
        for proposal in sure {
            let Some((target, source)) = proposal.ends(islands) else { continue };
            if busy.contains(&target) || busy.contains(&source) {
                continue;
            }
            busy.extend([target, source]);
            let relations = join(map, islands, proposal);
            for id in doubt_relations(map, &relations) {
                map.manifold.retract(id, Retraction::Contradicted);
                self.contradicted += 1;
            }
            any |= relations.iter().any(|&id| map.manifold.relation(id).is_active());
            self.note(map, islands, proposal, relations, MergeState::Merged);
        }
        any
    }

    /// Notes what is likely but not sure enough.
    fn put_on_record(&mut self, map: &mut Map, islands: &Islands, proposals: &[Proposal]) {
        for proposal in proposals.iter().filter(|p| p.false_bound < WORTH_TELLING) {
            let propose =
                |l: &super::Link| map.manifold.propose(l.from, l.to, l.from_from_to, l.provenance);
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
        r.state == manifold::RelationState::Retracted(Retraction::ByUser)
            && robot(r.from) != robot(r.to)
            && (across == ends || across == (ends.1, ends.0))
    })
}
