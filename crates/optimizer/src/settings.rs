use crate::Kernel;

/// How the optimiser steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Undamped steps; stops at the first step that does not lower the cost.
    GaussNewton,
    /// Undamped steps while they work, Levenberg-Marquardt damping where they do not.
    #[default]
    LevenbergMarquardt,
}

/// Which edges a robust kernel applies to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RobustScope {
    /// Edges of kind `Closure`.
    #[default]
    Closures,
    /// Every edge.
    All,
}

/// Settings of [`crate::Optimizer::optimize`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How to step.
    pub method: Method,
    /// Most factorisations before giving up.
    pub max_iterations: usize,
    /// Converged when a step is predicted to lower the cost by less than this fraction of it.
    ///
    /// That last step is still taken, so the cost reached is closer to the optimum than this.
    pub relative_tolerance: f64,
    /// Converged when a step is predicted to lower the cost by less than this.
    pub absolute_tolerance: f64,
    /// The robust kernel.
    pub kernel: Kernel,
    /// The edges `kernel` applies to.
    pub scope: RobustScope,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            method: Method::default(),
            max_iterations: 100,
            relative_tolerance: 1e-6,
            absolute_tolerance: 1e-9,
            kernel: Kernel::Quadratic,
            scope: RobustScope::Closures,
        }
    }
}

/// Why the optimiser stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The cost cannot be lowered noticeably.
    Converged,
    /// The limit on iterations was reached; the poses are the best found.
    IterationLimit,
    /// No step lowered the cost, however strongly damped; the poses are the best found.
    Stalled,
}

/// What an optimisation did.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Why it stopped.
    pub status: Status,
    /// Factorisations made.
    pub iterations: usize,
    /// Sum over edges of the (robust) squared Mahalanobis residuals, before.
    pub initial_cost: f64,
    /// The same, after; never above `initial_cost`.
    pub final_cost: f64,
    /// Final weight of every edge: 1 for a fully trusted one, 0 for one that was rejected.
    pub weights: Vec<f64>,
    /// True when the structure of the graph was new and had to be analysed.
    pub analysed: bool,
}
