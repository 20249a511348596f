/// What can be wrong with a graph, or with a question asked of it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptimizerError {
    /// A node id was added twice.
    #[error("node {id} exists already")]
    DuplicateNode {
        /// The id.
        id: u64,
    },
    /// A node id is not in the graph.
    #[error("node {id} is not in the graph")]
    UnknownNode {
        /// The id.
        id: u64,
    },
    /// An edge connects a node with itself.
    #[error("an edge connects node {id} with itself")]
    SelfEdge {
        /// The id.
        id: u64,
    },
    /// A pose holds a NaN or an infinity.
    #[error("the pose of node {id} is not finite")]
    PoseNotFinite {
        /// The id.
        id: u64,
    },
    /// A measured relative pose holds a NaN or an infinity.
    #[error("the measurement of edge {from} -> {to} is not finite")]
    MeasurementNotFinite {
        /// The edge's source node.
        from: u64,
        /// The edge's target node.
        to: u64,
    },
    /// An information matrix is not finite, symmetric and positive semi-definite.
    #[error(
        "the information of edge {from} -> {to} is not a finite, positive semi-definite matrix"
    )]
    BadInformation {
        /// The edge's source node.
        from: u64,
        /// The edge's target node.
        to: u64,
    },
    /// The linear system cannot be solved even with the strongest damping.
    #[error("the information matrix of the graph is singular")]
    Singular,
    /// More nodes or edges than 32-bit indices can name.
    #[error("the graph has too many nodes or edges")]
    TooLarge,
    /// Memory for the sparse factorisation could not be had.
    #[error("the sparse factorisation does not fit in memory")]
    OutOfMemory,
    /// A list of weights does not have one entry per edge.
    #[error("{given} weights were given for {edges} edges")]
    WeightCount {
        /// Weights given.
        given: usize,
        /// Edges in the graph.
        edges: usize,
    },
}
