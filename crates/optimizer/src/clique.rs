//! Maximum cliques on bit sets, exact within a budget of steps and greedy beyond it.

/// An undirected graph as an adjacency matrix of bits.
#[derive(Clone, Debug)]
pub(crate) struct BitGraph {
    words: usize,
    rows: Vec<u64>,
    nodes: usize,
}

impl BitGraph {
    /// A graph of `nodes` nodes without edges.
    pub fn new(nodes: usize) -> Self {
        let words = nodes.div_ceil(64);
        BitGraph { words, rows: vec![0; words * nodes], nodes }
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Connects two different nodes.
    pub fn connect(&mut self, a: usize, b: usize) {
        self.rows[a * self.words + b / 64] |= 1 << (b % 64);
        self.rows[b * self.words + a / 64] |= 1 << (a % 64);
    }

    /// True when two nodes are connected.
    pub fn connected(&self, a: usize, b: usize) -> bool {
        self.rows[a * self.words + b / 64] >> (b % 64) & 1 == 1
    }

    /// How many of `others` a node is connected with.
    pub fn common(&self, node: usize, others: &[usize]) -> usize {
        others.iter().filter(|&&other| self.connected(node, other)).count()
    }

    /// The graph of some of the nodes; node `k` is the old node `chosen[k]`.
    pub fn induced(&self, chosen: &[usize]) -> BitGraph {
        let mut graph = BitGraph::new(chosen.len());
        for (b, &second) in chosen.iter().enumerate() {
            for (a, _) in
                chosen[..b].iter().enumerate().filter(|(_, a)| self.connected(**a, second))
            {
                graph.connect(a, b);
            }
        }
        graph
    }

    /// The neighbours of a node, one bit each.
    fn row(&self, node: usize) -> &[u64] {
        &self.rows[node * self.words..(node + 1) * self.words]
    }

    fn degree(&self, node: usize) -> usize {
        self.row(node).iter().map(|word| word.count_ones() as usize).sum()
    }

    /// The graph with node `k` being the old node `order[k]`.
    fn renumbered(&self, order: &[usize]) -> BitGraph {
        let mut rank = vec![0; self.nodes];
        for (new, &old) in order.iter().enumerate() {
            rank[old] = new;
        }
        let mut graph = BitGraph::new(self.nodes);
        for (new, &old) in order.iter().enumerate() {
            for other in ones(self.row(old)) {
                let place = rank[other];
                graph.rows[new * graph.words + place / 64] |= 1 << (place % 64);
            }
        }
        graph
    }
}

/// The positions of the bits set.
fn ones(set: &[u64]) -> impl Iterator<Item = usize> + '_ {
    set.iter().enumerate().flat_map(|(index, &word)| {
        let mut rest = word;
        std::iter::from_fn(move || {
            let bit = (rest != 0).then(|| rest.trailing_zeros() as usize)?;
            rest &= rest - 1;
            Some(64 * index + bit)
        })
    })
}

/// A largest clique, sorted, and whether it is certain that none is larger.
///
/// Branch and bound with a greedy colouring as the bound (Tomita and Kameda 2007; on bit sets as in
/// San Segundo et al. 2011), starting from a greedy clique. `budget` bounds the number of branches,
/// so the answer depends on the graph alone and never on time.
pub(crate) fn maximum_clique(graph: &BitGraph, budget: u64) -> (Vec<usize>, bool) {
    let mut order: Vec<usize> = (0..graph.nodes).collect();
    // Nodes of high degree get the first colours; the last coloured are branched on first.
    order.sort_by_key(|&node| (std::cmp::Reverse(graph.degree(node)), node));
    let sorted = graph.renumbered(&order);
    let mut search = Search { graph: &sorted, best: greedy(&sorted), current: vec![], budget };
    let mut all = vec![0; sorted.words];
    for node in 0..sorted.nodes {
        all[node / 64] |= 1 << (node % 64);
    }
    search.expand(&all);
    let exact = search.budget > 0;
    let mut clique: Vec<usize> = search.best.iter().map(|&node| order[node]).collect();
    clique.sort_unstable();
    (clique, exact)
}

/// The best of a few greedy cliques, each grown from one of the nodes of highest degree by the
/// neighbour that leaves most choice.
fn greedy(graph: &BitGraph) -> Vec<usize> {
    const STARTS: usize = 16;
    let mut best = vec![];
    for start in 0..graph.nodes.min(STARTS) {
        let (mut clique, mut choice) = (vec![start], graph.row(start).to_vec());
        while let Some(next) = ones(&choice)
            .max_by_key(|&node| (overlap(&choice, graph.row(node)), std::cmp::Reverse(node)))
        {
            clique.push(next);
            intersect(&mut choice, graph.row(next));
        }
        if clique.len() > best.len() {
            best = clique;
        }
    }
    best
}

fn overlap(a: &[u64], b: &[u64]) -> u32 {
    a.iter().zip(b).map(|(x, y)| (x & y).count_ones()).sum()
}

fn intersect(a: &mut [u64], b: &[u64]) {
    for (x, y) in a.iter_mut().zip(b) {
        *x &= y;
    }
}

struct Search<'a> {
    graph: &'a BitGraph,
    best: Vec<usize>,
    current: Vec<usize>,
    budget: u64,
}

impl Search<'_> {
    /// Tries to grow the current clique by nodes of `candidates`.
    fn expand(&mut self, candidates: &[u64]) {
        let (nodes, colours) = self.colour(candidates);
        let mut candidates = candidates.to_vec();
        for (&node, &colour) in nodes.iter().zip(&colours).rev() {
            if self.current.len() + colour <= self.best.len() {
                return;
            }
            if self.budget == 0 {
                return;
            }
            self.budget -= 1;
            self.current.push(node);
            let mut next = candidates.clone();
            intersect(&mut next, self.graph.row(node));
            if next.iter().any(|&word| word != 0) {
                self.expand(&next);
            } else if self.current.len() > self.best.len() {
                self.best.clone_from(&self.current);
            }
            self.current.pop();
            candidates[node / 64] &= !(1 << (node % 64));
        }
    }

    /// Nodes by ascending colour, and their colours from 1: a clique within the first nodes up to
    /// one of colour `k` has at most `k` members.
    fn colour(&self, candidates: &[u64]) -> (Vec<usize>, Vec<usize>) {
        let (mut nodes, mut colours, mut colour) = (vec![], vec![], 0);
        let mut left = candidates.to_vec();
        while left.iter().any(|&word| word != 0) {
            colour += 1;
            let mut class = left.clone();
            loop {
                let first = ones(&class).next();
                let Some(node) = first else { break };
                class[node / 64] &= !(1 << (node % 64));
                left[node / 64] &= !(1 << (node % 64));
                for (x, y) in class.iter_mut().zip(self.graph.row(node)) {
                    *x &= !y;
                }
                nodes.push(node);
                colours.push(colour);
            }
        }
        (nodes, colours)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng, rngs::StdRng};

    fn is_clique(graph: &BitGraph, set: &[usize]) -> bool {
        set.iter()
            .enumerate()
            .all(|(k, &a)| set[k + 1..].iter().all(|&b| graph.row(a)[b / 64] >> (b % 64) & 1 == 1))
    }

    fn random(nodes: usize, density: f64, rng: &mut StdRng) -> BitGraph {
        let mut graph = BitGraph::new(nodes);
        for a in 0..nodes {
            for b in 0..a {
                if rng.random_bool(density) {
                    graph.connect(a, b);
                }
            }
        }
        graph
    }

    #[test]
    fn as_large_as_brute_force() {
        let mut rng = StdRng::seed_from_u64(1);
        for round in 0..60 {
            let graph = random(1 + round % 14, 0.2 + 0.6 * rng.random::<f64>(), &mut rng);
            let members = |set: u32| (0..graph.nodes).filter(move |k| set >> k & 1 == 1);
            let largest = (0..1_u32 << graph.nodes)
                .filter(|&set| is_clique(&graph, &members(set).collect::<Vec<_>>()))
                .map(u32::count_ones)
                .max();
            let (clique, exact) = maximum_clique(&graph, 1 << 20);
            assert!(exact && is_clique(&graph, &clique));
            assert_eq!(Some(clique.len() as u32), largest);
        }
    }

    #[test]
    fn a_planted_clique_among_thousands_is_found() {
        let mut rng = StdRng::seed_from_u64(2);
        let mut graph = random(3000, 0.02, &mut rng);
        let planted: Vec<usize> = (0..60).map(|k| 7 + 49 * k).collect();
        for &a in &planted {
            for &b in planted.iter().filter(|&&b| b < a) {
                graph.connect(a, b);
            }
        }
        let (clique, exact) = maximum_clique(&graph, 1 << 20);
        assert!(exact);
        assert_eq!(clique, planted);
    }

    #[test]
    fn beyond_the_budget_there_is_still_a_clique() {
        let mut rng = StdRng::seed_from_u64(3);
        let graph = random(400, 0.9, &mut rng);
        let (clique, exact) = maximum_clique(&graph, 100);
        assert!(!exact && clique.len() > 20 && is_clique(&graph, &clique));
        assert_eq!(maximum_clique(&BitGraph::new(0), 10).0, [] as [usize; 0]);
    }
}
