use crate::linear_system::LinearSystem;
use crate::structure::{HELD, Structure};
use crate::{OptimizerError, PoseGraph};
use geometry::Pose2;
use nalgebra::{Matrix2, Vector2};

/// Places the nodes of a planar graph by two linear problems, whatever their poses are: first the
/// headings, relaxed to plane vectors `h_j = R(measured yaw) h_i` and normalised afterwards, then
/// the positions with these headings.
///
/// The chordal relaxation of Martinec and Pajdla (2007), as compared by Carlone, Tron, Daniilidis
/// and Dellaert, "Initialization techniques for 3D SLAM" (2015). Fixed nodes keep their poses; a
/// component without one is placed around its first node. It needs measurements without gross
/// errors, and finds its way where a spanning tree has drifted beyond what the optimiser can mend.
///
/// # Errors
/// [`OptimizerError::Singular`] where the edges do not determine all poses.
pub fn initialize_chordal(graph: &mut PoseGraph<Pose2, 3>) -> Result<(), OptimizerError> {
    let fixed = graph.nodes().iter().map(|node| node.fixed).collect();
    let mut system = LinearSystem::<2>::new(Structure::analyse(graph.ends(), fixed)?)?;
    let turns: Vec<Relation> = graph
        .edges()
        .iter()
        .zip(graph.ends())
        .map(|(edge, &ends)| {
            let (sin, cos) = edge.from_from_to.yaw.sin_cos();
            let turn = Matrix2::new(cos, -sin, sin, cos);
            Relation { ends, turn, shift: Vector2::zeros(), weight: edge.information[(2, 2)] }
        })
        .collect();
    let mut headings: Vec<Vector2<f64>> = graph
        .nodes()
        .iter()
        .map(|node| node.pose.yaw.sin_cos())
        .map(|(s, c)| [c, s].into())
        .collect();
    solve(&mut system, &turns, &mut headings)?;
    for heading in &mut headings {
        *heading = heading.try_normalize(1e-9).unwrap_or(Vector2::x());
    }
    let steps: Vec<Relation> = graph
        .edges()
        .iter()
        .zip(graph.ends())
        .map(|(edge, &ends)| {
            let (h, step) = (headings[ends[0] as usize], edge.from_from_to.translation());
            let shift = Vector2::new(h.x * step.x - h.y * step.y, h.y * step.x + h.x * step.y);
            let weight = 0.5 * (edge.information[(0, 0)] + edge.information[(1, 1)]);
            Relation { ends, turn: Matrix2::identity(), shift, weight }
        })
        .collect();
    let mut positions: Vec<Vector2<f64>> =
        graph.nodes().iter().map(|node| node.pose.translation()).collect();
    solve(&mut system, &steps, &mut positions)?;
    let mut poses: Vec<Pose2> = graph.nodes().iter().map(|node| node.pose).collect();
    for &node in &system.structure.node_at {
        let (p, h) = (positions[node as usize], headings[node as usize]);
        poses[node as usize] = Pose2::new(p.x, p.y, h.y.atan2(h.x));
    }
    graph.set_poses(&poses);
    Ok(())
}

/// `x_to = turn x_from + shift`, with a weight.
struct Relation {
    ends: [u32; 2],
    turn: Matrix2<f64>,
    shift: Vector2<f64>,
    weight: f64,
}

/// Weighted linear least squares over `values`, held nodes keeping theirs.
fn solve(
    system: &mut LinearSystem<2>,
    relations: &[Relation],
    values: &mut [Vector2<f64>],
) -> Result<(), OptimizerError> {
    for &node in &system.structure.node_at {
        values[node as usize] = Vector2::zeros();
    }
    system.clear();
    let identity = Matrix2::identity();
    for (index, relation) in relations.iter().enumerate() {
        let Relation { ends: [from, to], turn, shift, weight } = relation;
        let [p, q] = [from, to].map(|&node| system.structure.position[node as usize]);
        let residual = values[*to as usize] - turn * values[*from as usize] - shift;
        // The turn is a rotation, so that its square is one.
        system.add_node(q, &(identity * *weight), &(residual * *weight));
        system.add_node(p, &(identity * *weight), &(-turn.transpose() * residual * *weight));
        if p != HELD && q != HELD {
            system.add_coupling(index, p < q, &(-turn.transpose() * *weight));
        }
    }
    system.finish();
    if !system.solve(0.0) {
        return Err(OptimizerError::Singular);
    }
    for (place, &node) in system.structure.node_at.iter().enumerate() {
        values[node as usize] = Vector2::from_column_slice(&system.step()[2 * place..][..2]);
    }
    Ok(())
}
