/// For every node the smallest node index of its connected component.
pub(crate) fn components(nodes: usize, ends: &[[u32; 2]]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..nodes as u32).collect();
    for &[a, b] in ends {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    }
    (0..nodes as u32).map(|node| root(&mut parent, node)).collect()
}

/// The representative of `node`, with path halving.
fn root(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        let above = parent[parent[node as usize] as usize];
        parent[node as usize] = above;
        node = above;
    }
    node
}

/// The nodes that hold the gauge: every fixed node, and the first node of each component that has
/// none.
pub(crate) fn anchored(nodes: usize, ends: &[[u32; 2]], fixed: &[bool]) -> Vec<bool> {
    let component = components(nodes, ends);
    let mut held = fixed.to_vec();
    let mut has_fixed = vec![false; nodes];
    for (node, _) in fixed.iter().enumerate().filter(|(_, f)| **f) {
        has_fixed[component[node] as usize] = true;
    }
    for node in 0..nodes {
        if component[node] as usize == node && !has_fixed[node] {
            held[node] = true;
        }
    }
    held
}
