use crate::linear_system::LinearSystem;
use crate::structure::{HELD, Structure};
use crate::{EdgeKind, Kernel, Method, OptimizerError, PoseGraph, Report, RobustScope};
use crate::{Settings, Status};
use geometry::LieGroup;
use nalgebra::{SMatrix, SVector};

/// Damping tried first after a step failed, relative to the diagonal of the information matrix.
const FIRST_DAMPING: f64 = 1e-4;
/// Damping beyond which a step would be too short to matter.
const LAST_DAMPING: f64 = 1e12;

/// Optimises a graph from where its nodes stand.
pub fn optimize<G: LieGroup<D>, const D: usize>(
    graph: &mut PoseGraph<G, D>,
    settings: &Settings,
) -> Result<Report, OptimizerError> {
    Optimizer::new().optimize(graph, settings)
}

/// A pose-graph optimiser that keeps the symbolic analysis and all memory between calls.
///
/// As long as the edges' ends and the fixed nodes of the graph stay the same, a call costs only
/// its numeric iterations; otherwise the structure is analysed anew, by itself.
#[derive(Debug)]
pub struct Optimizer<G, const D: usize> {
    system: Option<LinearSystem<D>>,
    poses: Vec<G>,
    trial: Vec<G>,
    edges: Vec<Term<G, D>>,
}

/// An edge as the inner loop wants it.
#[derive(Clone, Copy, Debug)]
struct Term<G, const D: usize> {
    ends: [u32; 2],
    positions: [u32; 2],
    to_from_from: G,
    information: SMatrix<f64, D, D>,
    weight: f64,
    kernel: Kernel,
}

impl<G: LieGroup<D>, const D: usize> Default for Optimizer<G, D> {
    fn default() -> Self {
        Self::new()
    }
}

impl<G: LieGroup<D>, const D: usize> Optimizer<G, D> {
    /// An optimiser that knows no graph yet.
    pub fn new() -> Self {
        Optimizer { system: None, poses: vec![], trial: vec![], edges: vec![] }
    }

    /// Minimises the (robust) sum of squared residuals from where the nodes stand.
    ///
    /// The nodes are left at the best poses found: never at a higher cost, never non-finite.
    pub fn optimize(
        &mut self,
        graph: &mut PoseGraph<G, D>,
        settings: &Settings,
    ) -> Result<Report, OptimizerError> {
        self.run(graph, settings, None)
    }

    /// The same with a factor per edge on its information, in the order of the edges.
    pub fn optimize_weighted(
        &mut self,
        graph: &mut PoseGraph<G, D>,
        settings: &Settings,
        weights: &[f64],
    ) -> Result<Report, OptimizerError> {
        let (given, edges) = (weights.len(), graph.edges().len());
        if given != edges {
            return Err(OptimizerError::WeightCount { given, edges });
        }
        self.run(graph, settings, Some(weights))
    }

    fn run(
        &mut self,
        graph: &mut PoseGraph<G, D>,
        settings: &Settings,
        weights: Option<&[f64]>,
    ) -> Result<Report, OptimizerError> {
        let analysed = self.prepare(graph, settings, weights)?;
        let (initial_cost, final_cost, iterations, status) = self.descend(settings);
        graph.set_poses(&self.poses);
        let weights = self.edges.iter().map(|term| term.total_weight(&self.poses)).collect();
        Ok(Report { status, iterations, initial_cost, final_cost, weights, analysed })
    }

    /// Copies the graph in and analyses its structure if that is new.
    pub(crate) fn prepare(
        &mut self,
        graph: &PoseGraph<G, D>,
        settings: &Settings,
        weights: Option<&[f64]>,
    ) -> Result<bool, OptimizerError> {
        let fixed = graph.nodes().iter().map(|node| node.fixed);
        let known = self.system.as_ref().map(|system| &system.structure);
        let analysed = !known.is_some_and(|known| known.fits(graph.ends(), fixed.clone()));
        if analysed {
            let structure = Structure::analyse(graph.ends(), fixed.collect())?;
            self.system = Some(LinearSystem::new(structure)?);
        }
        self.poses.clear();
        self.poses.extend(graph.nodes().iter().map(|node| node.pose));
        self.trial.clone_from(&self.poses);
        let Some(system) = &self.system else { return Ok(analysed) };
        let position = &system.structure.position;
        self.edges.clear();
        self.edges.extend(graph.edges().iter().zip(graph.ends()).enumerate().map(
            |(k, (edge, &ends))| Term {
                ends,
                positions: ends.map(|node| position[node as usize]),
                to_from_from: edge.from_from_to.inverse(),
                information: edge.information,
                weight: weights.map_or(1.0, |weights| weights[k]),
                kernel: kernel_of(edge.kind, settings),
            },
        ));
        Ok(analysed)
    }

    /// The iterations: `(initial cost, final cost, iterations, status)`.
    fn descend(&mut self, settings: &Settings) -> (f64, f64, usize, Status) {
        let Some(system) = &mut self.system else { return (0.0, 0.0, 0, Status::Converged) };
        let initial = linearize(system, &self.edges, &self.poses);
        let (mut cost, mut damping) = (initial, 0.0);
        if system.structure.columns() == 0 || !initial.is_finite() {
            let done = if initial.is_finite() { Status::Converged } else { Status::Stalled };
            return (initial, initial, 0, done);
        }
        for iteration in 1..=settings.max_iterations {
            if !system.solve(damping) {
                match stronger(damping, settings.method) {
                    Some(next) => damping = next,
                    None => return (initial, cost, iteration, Status::Stalled),
                }
                continue;
            }
            retract(&system.structure, system.step(), &self.poses, &mut self.trial);
            let predicted = system.predicted_decrease(damping);
            let small = settings.absolute_tolerance.max(settings.relative_tolerance * cost);
            let last = predicted <= small;
            let trial_cost = if last {
                total_cost(&self.edges, &self.trial)
            } else {
                linearize(system, &self.edges, &self.trial)
            };
            let better = trial_cost <= cost && self.trial.iter().all(G::is_finite);
            if better {
                std::mem::swap(&mut self.poses, &mut self.trial);
                cost = trial_cost;
                damping = if damping <= FIRST_DAMPING { 0.0 } else { 0.1 * damping };
            }
            if last {
                return (initial, cost, iteration, Status::Converged);
            }
            if !better {
                match stronger(damping, settings.method) {
                    Some(next) => damping = next,
                    None => return (initial, cost, iteration, Status::Stalled),
                }
                linearize(system, &self.edges, &self.poses);
            }
        }
        (initial, cost, settings.max_iterations, Status::IterationLimit)
    }

    /// The linearised system at the poses last prepared or reached, factorised without damping.
    pub(crate) fn factorized(&mut self) -> Result<&mut LinearSystem<D>, OptimizerError> {
        let system = self.system.as_mut().ok_or(OptimizerError::Singular)?;
        linearize(system, &self.edges, &self.poses);
        if system.factorize(0.0) { Ok(system) } else { Err(OptimizerError::Singular) }
    }
}

fn kernel_of(kind: EdgeKind, settings: &Settings) -> Kernel {
    match settings.scope {
        RobustScope::All => settings.kernel,
        RobustScope::Closures if kind == EdgeKind::Closure => settings.kernel,
        RobustScope::Closures => Kernel::Quadratic,
    }
}

/// The next damping to try; `None` when there is none.
fn stronger(damping: f64, method: Method) -> Option<f64> {
    let next = if damping == 0.0 { FIRST_DAMPING } else { 10.0 * damping };
    (method == Method::LevenbergMarquardt && next <= LAST_DAMPING).then_some(next)
}

impl<G: LieGroup<D>, const D: usize> Term<G, D> {
    fn squared_error(&self, poses: &[G]) -> f64 {
        let [from, to] = self.ends;
        let estimated = poses[from as usize].between(&poses[to as usize]);
        let error = self.to_from_from.compose(&estimated).log();
        (self.information * error).dot(&error)
    }

    fn total_weight(&self, poses: &[G]) -> f64 {
        match self.kernel {
            Kernel::Quadratic => self.weight,
            kernel => self.weight * kernel.weight(self.squared_error(poses)),
        }
    }
}

fn total_cost<G: LieGroup<D>, const D: usize>(terms: &[Term<G, D>], poses: &[G]) -> f64 {
    terms.iter().map(|term| term.weight * term.kernel.cost(term.squared_error(poses))).sum()
}

/// Assembles the normal equations at `poses` and returns the cost there.
///
/// With `E = measured^-1 from^-1 to`, `e = log E` and right perturbations, `de/dto = Jr^-1(e)` and
/// `de/dfrom = -Jr^-1(e) Ad(to_from_from)` (docs/math/pose-graph.md).
fn linearize<G: LieGroup<D>, const D: usize>(
    system: &mut LinearSystem<D>,
    terms: &[Term<G, D>],
    poses: &[G],
) -> f64 {
    system.clear();
    let mut cost = 0.0;
    for (index, term) in terms.iter().enumerate() {
        let [from, to] = term.ends;
        let estimated = poses[from as usize].between(&poses[to as usize]);
        let (error, jacobian) = term.to_from_from.compose(&estimated).log_with_jacobian();
        let squared = (term.information * error).dot(&error);
        cost += term.weight * term.kernel.cost(squared);
        let weight = term.weight * term.kernel.weight(squared);
        if weight == 0.0 {
            continue;
        }
        let weighted = jacobian.transpose() * (term.information * weight);
        let (h_to, g_to) = (weighted * jacobian, weighted * error);
        let minus_adjoint = -estimated.inverse_adjoint();
        let h_from_to = minus_adjoint.transpose() * h_to;
        let [p, q] = term.positions;
        system.add_node(q, &h_to, &g_to);
        system.add_node(p, &(h_from_to * minus_adjoint), &(minus_adjoint.transpose() * g_to));
        if p != HELD && q != HELD {
            system.add_coupling(index, p < q, &h_from_to);
        }
    }
    system.finish();
    cost
}

/// `trial = poses * exp(step)` for the free nodes.
fn retract<G: LieGroup<D>, const D: usize>(
    structure: &Structure,
    step: &[f64],
    poses: &[G],
    trial: &mut [G],
) {
    for (position, &node) in structure.node_at.iter().enumerate() {
        let tangent = SVector::<f64, D>::from_column_slice(&step[position * D..][..D]);
        trial[node as usize] = poses[node as usize].retract(&tangent);
    }
}
