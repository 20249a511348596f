//! Pose graphs as g2o text: `VERTEX_SE2`, `EDGE_SE2`, `VERTEX_SE3:QUAT`, `EDGE_SE3:QUAT`, `FIX`.
//!
//! Vertices may come after the edges that use them, or not at all: missing ones are placed along a
//! spanning tree of the measurements, odometry first. The first edge between consecutive ids is
//! taken for odometry ([`EdgeKind::Sequential`]), every other one for a closure.
//! The rotation part of an SE(3) information matrix is taken per radian of rotation vector.
//!
//! Numbers are written in the shortest form that reads back as the same number.
//!
//! ```
//! use manifoldslam_logs::g2o::{Graph, read_g2o, write_g2o};
//! let text = "EDGE_SE2 0 1 1 0 0.5 10 0 0 10 0 100\nLANDMARK 7\n";
//! let file = read_g2o(text.as_bytes(), "graph.g2o".as_ref());
//! let Graph::Plane(graph) = &file.graph else { panic!("an SE(2) file") };
//! assert_eq!(graph.pose(1).map(|pose| pose.yaw), Some(0.5));
//! assert_eq!(file.dropped_count, 1);
//! let mut out = Vec::new();
//! write_g2o(&mut out, graph)?;
//! assert!(out.starts_with(b"VERTEX_SE2 0 0.0 0.0 0.0\n"));
//! # Ok::<(), std::io::Error>(())
//! ```

use crate::lines::{LineEnd, LineReader};
use crate::number::{parse_f64, parse_u64};
use crate::{DropReason, DroppedLine, LogError, LogFile};
use geometry::{LieGroup, Pose2, Pose3};
use nalgebra::{Quaternion, SMatrix, UnitQuaternion, Vector3};
use optimizer::{Edge, EdgeKind, PoseGraph, initialize_spanning_tree};
use std::collections::HashSet;
use std::io::{self, BufRead, Write};
use std::path::Path;

/// Longest line, bytes; an SE(3) edge with all digits is about 800.
const LINE_LIMIT: usize = 4096;
/// Dropped lines that are kept one by one; beyond this they are counted only.
const MAX_LISTED: usize = 100;
/// Measured coordinates beyond this, in metres, are refused.
const MAX_MEASURED: f64 = 1e9;
/// Coordinates of vertices beyond this, in metres, are refused; wider than the other, so that a
/// graph whose vertices were placed along its measurements can be written and read again.
const MAX_COORDINATE: f64 = 1e15;
/// An SE(3) edge: name, two ids, seven numbers of the pose and 21 of the information.
const MAX_FIELDS: usize = 31;

/// A graph in the plane or in space.
#[derive(Clone, Debug)]
pub enum Graph {
    /// SE(2).
    Plane(PoseGraph<Pose2, 3>),
    /// SE(3).
    Space(PoseGraph<Pose3, 6>),
}

/// What could be read of a g2o file.
#[derive(Debug)]
pub struct G2oFile {
    /// The graph.
    pub graph: Graph,
    /// Nodes the file gives no pose for; they were placed along a spanning tree.
    pub unplaced: usize,
    /// The first dropped lines with their reasons.
    pub dropped: Vec<DroppedLine>,
    /// All dropped lines, the listed ones included.
    pub dropped_count: u64,
    /// Set when reading stopped before the end of the file.
    pub failure: Option<LogError>,
}

impl G2oFile {
    /// True when something in the file was lost: the run must not end with exit code 0.
    pub fn is_lossy(&self) -> bool {
        self.dropped_count > 0 || self.failure.is_some()
    }
}

/// A pose that g2o has elements for.
pub trait G2oPose<const D: usize>: LieGroup<D> {
    /// Name of the vertex element.
    const VERTEX: &'static str;
    /// Name of the edge element.
    const EDGE: &'static str;
    /// Numbers of a pose.
    const NUMBERS: usize;
    /// A pose from its numbers; `None` if they are none.
    fn from_numbers(numbers: &[f64]) -> Option<Self>;
    /// The numbers of a pose.
    fn numbers(&self) -> Vec<f64>;
}

impl G2oPose<3> for Pose2 {
    const VERTEX: &'static str = "VERTEX_SE2";
    const EDGE: &'static str = "EDGE_SE2";
    const NUMBERS: usize = 3;

    fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let &[x, y, yaw] = numbers else { return None };
        Some(Pose2::new(x, y, yaw))
    }

    fn numbers(&self) -> Vec<f64> {
        vec![self.x, self.y, self.yaw]
    }
}

impl G2oPose<6> for Pose3 {
    const VERTEX: &'static str = "VERTEX_SE3:QUAT";
    const EDGE: &'static str = "EDGE_SE3:QUAT";
    const NUMBERS: usize = 7;

    fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let &[x, y, z, qx, qy, qz, qw] = numbers else { return None };
        let quaternion = Quaternion::new(qw, qx, qy, qz);
        let norm = quaternion.norm();
        // One that is a unit already stays as it is, so that what is written reads back the same.
        let rotation = if (norm - 1.0).abs() < 1e-12 {
            UnitQuaternion::new_unchecked(quaternion)
        } else if norm > 1e-6 {
            UnitQuaternion::new_normalize(quaternion)
        } else {
            return None;
        };
        Some(Pose3::new(Vector3::new(x, y, z), rotation))
    }

    fn numbers(&self) -> Vec<f64> {
        let (t, q) = (&self.translation, &self.rotation);
        vec![t.x, t.y, t.z, q.i, q.j, q.k, q.w]
    }
}

/// Reads a graph; `file` is its name for messages.
///
/// Never fails as a whole: lines that cannot be used are listed, a failure of `input` is kept in
/// the answer. The kind of the first element decides between the plane and space.
pub fn read_g2o(input: impl BufRead, file: &Path) -> G2oFile {
    let mut parser = Parser::default();
    let mut lines = LineReader::new(input, LINE_LIMIT);
    let failure = loop {
        let number = lines.number();
        match lines.advance() {
            Ok(None) => break None,
            Ok(Some(end)) => parser.take_line(lines.number(), lines.line(), end),
            Err(source) => break Some(LogError::read(file, number, source)),
        }
    };
    parser.finish(failure)
}

/// Reads a graph from a file, which may be compressed.
///
/// # Errors
/// [`LogError::Open`] when the file cannot be opened.
pub fn open_g2o(path: &Path) -> Result<G2oFile, LogError> {
    Ok(read_g2o(LogFile::open(path)?.input, path))
}

/// Writes a graph: vertices, fixed nodes, edges.
///
/// # Errors
/// Those of `output`.
pub fn write_g2o<G: G2oPose<D>, const D: usize>(
    mut output: impl Write,
    graph: &PoseGraph<G, D>,
) -> io::Result<()> {
    for node in graph.nodes() {
        write!(output, "{} {}", G::VERTEX, node.id)?;
        write_numbers(&mut output, node.pose.numbers())?;
    }
    for node in graph.nodes().iter().filter(|node| node.fixed) {
        writeln!(output, "FIX {}", node.id)?;
    }
    for edge in graph.edges() {
        write!(output, "{} {} {}", G::EDGE, edge.from, edge.to)?;
        let mut numbers = edge.from_from_to.numbers();
        numbers.extend((0..D).flat_map(|r| (r..D).map(move |c| edge.information[(r, c)])));
        write_numbers(&mut output, numbers)?;
    }
    output.flush()
}

fn write_numbers(output: &mut impl Write, numbers: Vec<f64>) -> io::Result<()> {
    for number in numbers {
        // Adding zero turns -0.0 into 0.0.
        write!(output, " {:?}", number + 0.0)?;
    }
    writeln!(output)
}

type Refusal = (Option<usize>, DropReason);

/// What has been read so far.
#[derive(Default)]
struct Parser {
    plane: Elements<Pose2, 3>,
    space: Elements<Pose3, 6>,
    fixed: Vec<(u64, u64)>,
    dropped: Vec<DroppedLine>,
    dropped_count: u64,
}

impl Parser {
    fn take_line(&mut self, number: u64, line: &[u8], end: LineEnd) {
        let outcome = match end {
            LineEnd::TooLong => Err((None, DropReason::TooLong { limit: LINE_LIMIT })),
            _ => self.take_element(number, line),
        };
        if let Err((field, reason)) = outcome {
            self.refuse(number, field, reason);
        }
    }

    fn take_element(&mut self, number: u64, line: &[u8]) -> Result<(), Refusal> {
        let content = line.split(|&b| b == b'#').next().unwrap_or_default();
        let fields: Vec<&[u8]> = content
            .split(|b| matches!(b, b' ' | b'\t' | b'\r'))
            .filter(|field| !field.is_empty())
            .take(MAX_FIELDS + 1)
            .collect();
        let Some((&name, rest)) = fields.split_first() else { return Ok(()) };
        let (in_plane, in_space) = (self.space.is_empty(), self.plane.is_empty());
        match name {
            b"VERTEX_SE2" if in_plane => self.plane.vertex(number, rest),
            b"EDGE_SE2" if in_plane => self.plane.edge(number, rest),
            b"VERTEX_SE3:QUAT" if in_space => self.space.vertex(number, rest),
            b"EDGE_SE3:QUAT" if in_space => self.space.edge(number, rest),
            b"FIX" => {
                for (k, field) in rest.iter().enumerate() {
                    self.fixed.push((number, id(field, k + 2)?));
                }
                if rest.is_empty() { Err((Some(2), DropReason::MissingField)) } else { Ok(()) }
            }
            _ => Err((Some(1), DropReason::UnknownElement)),
        }
    }

    fn refuse(&mut self, line: u64, field: Option<usize>, reason: DropReason) {
        self.dropped_count += 1;
        if self.dropped.len() < MAX_LISTED {
            self.dropped.push(DroppedLine { line, field, reason });
        }
    }

    fn finish(mut self, failure: Option<LogError>) -> G2oFile {
        let (graph, unplaced) = if self.space.is_empty() {
            let elements = std::mem::take(&mut self.plane);
            let (graph, unplaced) = self.assemble(elements);
            (Graph::Plane(graph), unplaced)
        } else {
            let elements = std::mem::take(&mut self.space);
            let (graph, unplaced) = self.assemble(elements);
            (Graph::Space(graph), unplaced)
        };
        self.dropped.sort_by_key(|dropped| dropped.line);
        let Parser { dropped, dropped_count, .. } = self;
        G2oFile { graph, unplaced, dropped, dropped_count, failure }
    }

    /// The graph, and how many of its nodes had no vertex line.
    fn assemble<G: G2oPose<D>, const D: usize>(
        &mut self,
        elements: Elements<G, D>,
    ) -> (PoseGraph<G, D>, usize) {
        let mut graph = PoseGraph::new();
        for (line, id, pose) in elements.vertices {
            if let Err(error) = graph.add_node(id, pose) {
                self.refuse(line, Some(2), error.into());
            }
        }
        let placed = graph.nodes().len();
        let mut consecutive = HashSet::new();
        for (line, mut edge) in elements.edges {
            for id in [edge.from, edge.to] {
                // Refused for nodes that exist, which is fine.
                let _ = graph.add_node(id, G::identity());
            }
            let pair = (edge.from.min(edge.to), edge.from.max(edge.to));
            let odometry = pair.1 - pair.0 == 1 && consecutive.insert(pair);
            edge.kind = if odometry { EdgeKind::Sequential } else { EdgeKind::Closure };
            if let Err(error) = graph.add_edge(edge) {
                self.refuse(line, None, error.into());
            }
        }
        for (line, id) in std::mem::take(&mut self.fixed) {
            if let Err(error) = graph.set_fixed(id, true) {
                self.refuse(line, Some(2), error.into());
            }
        }
        let unplaced = graph.nodes().len() - placed;
        if unplaced > 0 {
            initialize_spanning_tree(&mut graph, |node| node < placed);
        }
        (graph, unplaced)
    }
}

/// Vertices and edges of one group, with their lines.
struct Elements<G, const D: usize> {
    vertices: Vec<(u64, u64, G)>,
    edges: Vec<(u64, Edge<G, D>)>,
}

impl<G, const D: usize> Default for Elements<G, D> {
    fn default() -> Self {
        Elements { vertices: vec![], edges: vec![] }
    }
}

impl<G: G2oPose<D>, const D: usize> Elements<G, D> {
    fn is_empty(&self) -> bool {
        self.vertices.is_empty() && self.edges.is_empty()
    }

    /// `id pose`.
    fn vertex(&mut self, line: u64, fields: &[&[u8]]) -> Result<(), Refusal> {
        count(fields, 1 + G::NUMBERS)?;
        self.vertices.push((line, id(fields[0], 2)?, pose(&fields[1..], 3, MAX_COORDINATE)?));
        Ok(())
    }

    /// `from to pose information`, the information's upper triangle row by row.
    fn edge(&mut self, line: u64, fields: &[&[u8]]) -> Result<(), Refusal> {
        let first = 2 + G::NUMBERS;
        count(fields, first + D * (D + 1) / 2)?;
        let (from, to) = (id(fields[0], 2)?, id(fields[1], 3)?);
        let from_from_to = pose(&fields[2..first], 4, MAX_MEASURED)?;
        let mut information = SMatrix::zeros();
        let mut at = first;
        for r in 0..D {
            for c in r..D {
                let value = finite(fields[at], at + 2, f64::MAX)?;
                information[(r, c)] = value;
                information[(c, r)] = value;
                at += 1;
            }
        }
        self.edges.push((line, Edge::new(from, to, from_from_to, information, EdgeKind::Closure)));
        Ok(())
    }
}

/// Checks the number of fields behind the element's name.
fn count(fields: &[&[u8]], expected: usize) -> Result<(), Refusal> {
    match fields.len() {
        n if n < expected => Err((Some(n + 2), DropReason::MissingField)),
        n if n > expected => Err((Some(expected + 2), DropReason::ExtraField)),
        _ => Ok(()),
    }
}

fn id(field: &[u8], at: usize) -> Result<u64, Refusal> {
    parse_u64(field).ok_or((Some(at), DropReason::NotANumber))
}

fn finite(field: &[u8], at: usize, limit: f64) -> Result<f64, Refusal> {
    let value = parse_f64(field).ok_or((Some(at), DropReason::NotANumber))?;
    if value.abs() <= limit { Ok(value + 0.0) } else { Err((Some(at), DropReason::NotFinite)) }
}

fn pose<G: G2oPose<D>, const D: usize>(
    fields: &[&[u8]],
    at: usize,
    limit: f64,
) -> Result<G, Refusal> {
    let mut numbers = Vec::with_capacity(fields.len());
    for (k, field) in fields.iter().enumerate() {
        numbers.push(finite(field, at + k, limit)?);
    }
    G::from_numbers(&numbers).ok_or((Some(at), DropReason::NotFinite))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plane(text: &str) -> (PoseGraph<Pose2, 3>, G2oFile) {
        let file = read_g2o(text.as_bytes(), Path::new("test.g2o"));
        let Graph::Plane(graph) = file.graph.clone() else { panic!("a graph in the plane") };
        (graph, file)
    }

    fn written<G: G2oPose<D>, const D: usize>(graph: &PoseGraph<G, D>) -> String {
        let mut text = Vec::new();
        write_g2o(&mut text, graph).unwrap();
        String::from_utf8(text).unwrap()
    }

    const EDGE: &str = "EDGE_SE2 0 1 1 0 0.5 10 0 0 10 0 100";

    #[test]
    fn vertices_may_come_late_or_never() {
        let (graph, file) = plane(&format!(
            "EDGE_SE2 2 1 -1 0 0 1 0 0 1 0 1\n{EDGE}\nVERTEX_SE2 0 5 6 0\nFIX 0\n# done\n\n"
        ));
        assert_eq!((file.unplaced, file.dropped_count), (2, 0));
        assert_eq!(graph.pose(0), Some(&Pose2::new(5.0, 6.0, 0.0)));
        assert_eq!(graph.pose(1), Some(&Pose2::new(6.0, 6.0, 0.5)));
        let expected = Pose2::new(6.0, 6.0, 0.5) * Pose2::new(1.0, 0.0, 0.0);
        assert!(graph.pose(2).unwrap().between(&expected).norm() < 1e-12);
        assert!(graph.nodes().iter().all(|node| node.fixed == (node.id == 0)));
    }

    #[test]
    fn the_first_edge_between_consecutive_ids_is_odometry() {
        let (graph, _) = plane(&format!("{EDGE}\n{EDGE}\nEDGE_SE2 0 2 1 0 0 1 0 0 1 0 1\n"));
        let kinds: Vec<EdgeKind> = graph.edges().iter().map(|edge| edge.kind).collect();
        assert_eq!(kinds, [EdgeKind::Sequential, EdgeKind::Closure, EdgeKind::Closure]);
    }

    #[test]
    fn what_cannot_be_used_is_dropped_with_line_and_field() {
        for (line, field, reason) in [
            ("EDGE_XY 0 1 2", Some(1), "not a graph element this reader knows"),
            ("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1", Some(1), "not a graph element this reader knows"),
            ("VERTEX_SE2 7 0 nan 0", Some(4), "not finite or absurdly large"),
            ("VERTEX_SE2 7 0 1e300 0", Some(4), "not finite or absurdly large"),
            ("VERTEX_SE2 -7 0 0 0", Some(2), "not a number"),
            ("VERTEX_SE2 7 0 0", Some(5), "too few fields"),
            ("VERTEX_SE2 7 0 0 0 0", Some(6), "too many fields"),
            ("VERTEX_SE2 0 0 0 0", Some(2), "node 0 exists already"),
            ("EDGE_SE2 0 1 1 0 0.5 10 0 inf 10 0 100", Some(9), "not finite or absurdly large"),
            ("EDGE_SE2 0 1 1 0 0.5 10 0 x 10 0 100", Some(9), "not a number"),
            ("EDGE_SE2 1 1 1 0 0.5 10 0 0 10 0 100", None, "an edge connects node 1 with itself"),
            (
                "EDGE_SE2 0 1 1 0 0.5 -10 0 0 10 0 100",
                None,
                "the information of edge 0 -> 1 is not a finite, positive semi-definite matrix",
            ),
            ("FIX", Some(2), "too few fields"),
            ("FIX 99", Some(2), "node 99 is not in the graph"),
        ] {
            let (graph, file) = plane(&format!("VERTEX_SE2 0 0 0 0\n{line}\n{EDGE}\n"));
            assert_eq!(graph.edges().len(), 1, "{line}");
            assert_eq!(file.dropped_count, 1, "{line}");
            let dropped = &file.dropped[0];
            assert_eq!((dropped.line, dropped.field), (2, field), "{line}");
            assert_eq!(dropped.reason.to_string(), reason, "{line}");
        }
        let (_, file) = plane(&format!("VERTEX_SE2 0 {} 0 0\n", "1".repeat(5000)));
        assert_eq!(file.dropped[0].reason, DropReason::TooLong { limit: LINE_LIMIT });
    }

    #[test]
    fn a_graph_in_space_comes_back_as_it_was() {
        let text = "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 5 1 2 3 0.1 0.2 0.3 0.9\n\
            EDGE_SE3:QUAT 0 5 1 0.5 0 0 0 2 2 \
            1 0.5 0 0 0 0 2 0 0 0 0 3 0 0 0 4 0 0 5 0 6.25\n";
        let file = read_g2o(text.as_bytes(), Path::new("space.g2o"));
        let Graph::Space(graph) = &file.graph else { panic!("a graph in space") };
        assert!(!file.is_lossy());
        assert_eq!(graph.edges()[0].information[(1, 0)], 0.5);
        assert_eq!(graph.edges()[0].information[(5, 5)], 6.25);
        assert!((graph.pose(5).unwrap().rotation.norm() - 1.0).abs() < 1e-15);
        let once = written(graph);
        let Graph::Space(again) = read_g2o(once.as_bytes(), Path::new("again")).graph else {
            panic!("a graph in space")
        };
        assert_eq!((again.nodes(), again.edges()), (graph.nodes(), graph.edges()));
        assert_eq!(written(&again), once);
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back_bit_by_bit(
            poses in prop::collection::vec((-1e6..1e6_f64, -1e-3..1e-3_f64, -4.0..4.0_f64), 2..20),
            scale in 1e-9..1e9_f64,
        ) {
            let mut graph = PoseGraph::<Pose2, 3>::new();
            let mut last = None;
            for (k, &(x, y, yaw)) in poses.iter().enumerate() {
                let (id, pose) = (3 * k as u64 / 2, Pose2::new(x, y, yaw));
                graph.add_node(id, pose).unwrap();
                if let Some(before) = last {
                    let information = SMatrix::<f64, 3, 3>::identity() * scale;
                    let kind = if id - before == 1 { EdgeKind::Sequential } else { EdgeKind::Closure };
                    graph.add_edge(Edge::new(before, id, pose, information, kind)).unwrap();
                }
                last = Some(id);
            }
            graph.set_fixed(0, true).unwrap();
            let text = written(&graph);
            let (again, file) = plane(&text);
            prop_assert!(!file.is_lossy() && file.unplaced == 0);
            prop_assert_eq!(again.nodes(), graph.nodes());
            prop_assert_eq!(again.edges(), graph.edges());
            prop_assert_eq!(written(&again), text);
        }

        #[test]
        fn any_text_is_survived(
            first in "(VERTEX_SE2|EDGE_SE2|FIX|EDGE_SE3:QUAT|#|\\PC{0,5})( [-0-9e.]{1,5}){0,12}\n",
            edges in "(EDGE_SE2( [0-3]){11}\n){0,5}",
        ) {
            let text = first + &edges;
            let file = read_g2o(text.as_bytes(), Path::new("any"));
            if let Graph::Plane(graph) = &file.graph {
                let (again, _) = plane(&written(graph));
                prop_assert_eq!(again.nodes(), graph.nodes());
            }
        }
    }
}
