use super::agenda::Agenda;
use super::by_geometry::GeometricMerging;
use super::{Merge, MergeState, Proposal, join};
use crate::SlamConfig;
use crate::map::Map;
use crate::refit::{doubt_relations, optimise_islands};
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
    /// Joins islands as long as the evidence suffices. Where nothing joins any more further places
    /// are compared.
    pub fn run(&mut self, map: &mut Map, config: &SlamConfig) {
        let mut geometry = GeometricMerging::new(map, config);
        let mut islands = map.manifold.component_map();
        let (mut agenda, mut unsure) = (Agenda::default(), Vec::new());
        while islands.members.len() > 1 && geometry.look(map, &islands, config) {
            self.join_all(map, &mut islands, &geometry, &mut agenda, &mut unsure, config);
        }
        self.tried += geometry.tried();
        self.put_on_record(map, &islands, &unsure);
        // A merge whose relations were all found wrong is none.
        let holds = |id: &RelationId| map.manifold.relation(*id).is_active();
        self.merges.retain(|m| m.state != MergeState::Merged || m.relations.iter().any(holds));
    }

    /// Joins islands by what was compared so far; what is likely but not sure enough is added to
    /// `unsure`.
    fn join_all(
        &mut self,
        map: &mut Map,
        islands: &mut Islands,
        geometry: &GeometricMerging,
        agenda: &mut Agenda,
        unsure: &mut Vec<Proposal>,
        config: &SlamConfig,
    ) {
        let mut new = BTreeSet::new();
        let mut looked = true;
        loop {
            let is_new = |island: usize| new.contains(&island);
            agenda.replace(geometry.pairs(map, islands, is_new, looked, config), islands);
            looked = false;
            let ends = loop {
                let pairs = agenda.next(islands, geometry.is_last());
                if pairs.is_empty() {
                    return;
                }
                let examined: BTreeSet<_> = pairs.iter().map(|pair| pair.ends(islands)).collect();
                unsure.retain(|p| p.ends(islands).is_some_and(|ends| !examined.contains(&ends)));
                let mut found = geometry.propose(map, islands, &pairs, config);
                found.retain(|p| !taken_back_by_user(map, islands, p));
                let is_sure = |p: &Proposal| p.false_bound <= config.merging.false_merges;
                let (sure, others): (Vec<_>, Vec<_>) = found.into_iter().partition(is_sure);
                unsure.extend(others);
                if !sure.is_empty() {
                    break self.join(map, islands, &sure, agenda);
                }
            };
            *islands = map.manifold.component_map();
            let which = ends.iter().map(|&patch| islands.of(patch)).collect();
            self.contradicted += optimise_islands(map, islands, &which, config).len();
            self.optimisations += 1;
            *islands = map.manifold.component_map();
            new = ends.iter().map(|&patch| islands.of(patch)).collect();
            let is_new = |island: usize| new.contains(&island);
            unsure.retain(|p| p.ends(islands).is_some_and(|(a, b)| !is_new(a) && !is_new(b)));
        }
    }

    /// Joins islands that are all different; returns patches of all of them.
    fn join(
        &mut self,
        map: &mut Map,
        islands: &Islands,
        proposals: &[Proposal],
        agenda: &mut Agenda,
    ) -> Vec<PatchId> {
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
            // Should it come apart again, it is not tried another time.
            agenda.refuse((target, source), islands);
            ends.extend([islands.members[target][0], islands.members[source][0]]);
            ends.extend(proposal.links.iter().flat_map(|link| [link.from, link.to]));
            self.note(map, islands, proposal, relations, MergeState::Merged);
        }
        ends
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
