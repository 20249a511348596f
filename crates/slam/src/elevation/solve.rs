use super::BIAS_STD_RAD;
use super::measured::Rise;
use manifold::{Elevation, PatchId};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

/// Rounds of weighing down what contradicts the rest.
const ROUNDS: usize = 6;
/// Doubtful rises this many standard deviations off count a quarter (Geman and McClure's kernel).
const KERNEL_SIGMAS: f64 = 2.0;
/// Conjugate gradients end at this share of the first residual, or after so many steps.
const TOLERANCE: f64 = 1e-10;
const MOST_STEPS: usize = 2000;
/// Holds the first patch of an island at zero, metres.
const ANCHOR_STD_M: f64 = 1e-3;

/// A patch reached by the best path so far; the least variance comes first, then the least index.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reached {
    variance_m2: f64,
    /// Variance but for what the bias of the unit adds: in proportion to the square of the way.
    noise_m2: f64,
    distance_m: f64,
    height_m: f64,
    patch: usize,
}

impl Eq for Reached {}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        other.variance_m2.total_cmp(&self.variance_m2).then(other.patch.cmp(&self.patch))
    }
}

/// Heights of an island's patches above the first of them: along the best paths, then by all that
/// is known. `rises` are those between its patches; other islands have no part in it.
pub(crate) fn heights_on(island: &[PatchId], rises: &[Rise]) -> Vec<(PatchId, Elevation)> {
    let number: BTreeMap<PatchId, usize> =
        island.iter().enumerate().map(|(i, &p)| (p, i)).collect();
    let robots: BTreeSet<usize> = rises.iter().map(|rise| rise.robot).collect();
    let robots: BTreeMap<usize, usize> =
        robots.into_iter().enumerate().map(|(i, r)| (r, i)).collect();
    let steps: Vec<Step> = rises
        .iter()
        .map(|rise| Step {
            from: number[&rise.from],
            to: number[&rise.to],
            robot: robots[&rise.robot],
            rise: *rise,
        })
        .collect();
    let mut heights = vec![None; island.len()];
    along_best_path(&steps, &mut heights);
    least_squares(&steps, robots.len(), &mut heights);
    island.iter().zip(heights).filter_map(|(&patch, height)| Some((patch, height?))).collect()
}

/// A rise by the numbers of its patches and its robot on the island.
#[derive(Clone, Copy, Debug)]
struct Step {
    from: usize,
    to: usize,
    robot: usize,
    rise: Rise,
}

/// Heights above the first patch along the paths with the least variance (Dijkstra).
fn along_best_path(steps: &[Step], heights: &mut [Option<Elevation>]) {
    let mut adjacent: Vec<Vec<(usize, f64)>> = vec![Vec::new(); heights.len()];
    for (index, step) in steps.iter().enumerate() {
        adjacent[step.from].push((index, 1.0));
        adjacent[step.to].push((index, -1.0));
    }
    let first =
        Reached { variance_m2: 0.0, noise_m2: 0.0, distance_m: 0.0, height_m: 0.0, patch: 0 };
    let mut queue = BinaryHeap::from([first]);
    while let Some(here) = queue.pop() {
        if heights[here.patch].is_some() {
            continue;
        }
        let (height_m, variance_m2) = (here.height_m, here.variance_m2);
        heights[here.patch] = Some(Elevation { height_m, variance_m2 });
        for &(index, sign) in &adjacent[here.patch] {
            let Step { from, to, rise, .. } = &steps[index];
            let patch = if sign > 0.0 { *to } else { *from };
            if heights[patch].is_none() {
                let noise_m2 = here.noise_m2 + rise.variance_m2;
                let distance_m = here.distance_m + sign * rise.distance_m;
                queue.push(Reached {
                    variance_m2: noise_m2 + (BIAS_STD_RAD * distance_m).powi(2),
                    noise_m2,
                    distance_m,
                    height_m: height_m + sign * rise.rise_m,
                    patch,
                });
            }
        }
    }
}

/// Improves heights by all that is known: least squares over the heights and what is left of every
/// unit's bias, doubtful rises weighed by how well they fit. Heights that are unknown stay so.
fn least_squares(steps: &[Step], robots: usize, heights: &mut [Option<Elevation>]) {
    let known = |s: &&Step| heights[s.from].is_some() && heights[s.to].is_some();
    let steps: Vec<Step> = steps.iter().filter(known).copied().collect();
    let mut values: Vec<f64> = heights.iter().map(|h| h.map_or(0.0, |h| h.height_m)).collect();
    values.resize(heights.len() + robots, 0.0);
    // Along best paths the first patch is exactly known.
    let anchored = |h: &Option<Elevation>| h.is_none_or(|h| h.variance_m2 == 0.0);
    let mut prior: Vec<f64> =
        heights.iter().map(|h| if anchored(h) { ANCHOR_STD_M.powi(-2) } else { 0.0 }).collect();
    prior.resize(values.len(), BIAS_STD_RAD.powi(-2));
    let bias_of = heights.len();
    for _ in 0..ROUNDS {
        let system = System { steps: &steps, prior: &prior, bias_of, weights: Vec::new() };
        let weights = steps.iter().map(|step| system.weight(step, &values)).collect();
        System { weights, ..system }.improve(&mut values);
    }
    for (height, value) in heights.iter_mut().zip(&values) {
        if let Some(height) = height {
            height.height_m = *value;
        }
    }
}

/// `min sum w (h[to] - h[from] - bias distance - rise)^2 + sum prior value^2`.
struct System<'a> {
    steps: &'a [Step],
    weights: Vec<f64>,
    prior: &'a [f64],
    /// Where the biases begin among the values.
    bias_of: usize,
}

impl System<'_> {
    /// What a rise leaves over, without its measurement.
    fn difference(&self, step: &Step, values: &[f64]) -> f64 {
        let bias = values[self.bias_of + step.robot];
        values[step.to] - values[step.from] - bias * step.rise.distance_m
    }

    fn weight(&self, step: &Step, values: &[f64]) -> f64 {
        let rise = &step.rise;
        if !rise.doubtful {
            return rise.variance_m2.recip();
        }
        let residual = self.difference(step, values) - rise.rise_m;
        let share = residual * residual / (rise.variance_m2 * KERNEL_SIGMAS * KERNEL_SIGMAS);
        rise.variance_m2.recip() / (1.0 + share).powi(2)
    }

    /// Adds `factor` times the derivative of a rise's difference.
    fn scatter(&self, step: &Step, factor: f64, to: &mut [f64]) {
        to[step.to] += factor;
        to[step.from] -= factor;
        to[self.bias_of + step.robot] -= factor * step.rise.distance_m;
    }

    /// The normal equations' matrix times a vector.
    fn product(&self, values: &[f64]) -> Vec<f64> {
        let mut result: Vec<f64> = self.prior.iter().zip(values).map(|(p, v)| p * v).collect();
        for (step, weight) in self.steps.iter().zip(&self.weights) {
            self.scatter(step, weight * self.difference(step, values), &mut result);
        }
        result
    }

    fn diagonal(&self) -> Vec<f64> {
        let mut diagonal = self.prior.to_vec();
        for (step, weight) in self.steps.iter().zip(&self.weights) {
            diagonal[step.to] += weight;
            diagonal[step.from] += weight;
            diagonal[self.bias_of + step.robot] += weight * step.rise.distance_m.powi(2);
        }
        diagonal
    }

    /// Conjugate gradients from the present values, scaled by the diagonal (Hestenes and Stiefel
    /// 1952).
    fn improve(&self, values: &mut [f64]) {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let inverse: Vec<f64> =
            self.diagonal().iter().map(|d| if *d > 0.0 { d.recip() } else { 0.0 }).collect();
        let scaled = |r: &[f64]| r.iter().zip(&inverse).map(|(r, i)| r * i).collect::<Vec<f64>>();
        let mut residual = self.product(values);
        residual.iter_mut().for_each(|r| *r = -*r);
        for (step, weight) in self.steps.iter().zip(&self.weights) {
            self.scatter(step, weight * step.rise.rise_m, &mut residual);
        }
        let mut along = scaled(&residual);
        let mut size = dot(&residual, &along);
        let enough = TOLERANCE * TOLERANCE * size;
        for _ in 0..MOST_STEPS {
            let image = self.product(&along);
            let curvature = dot(&along, &image);
            if size <= enough || curvature <= 0.0 {
                break;
            }
            let step = size / curvature;
            for i in 0..values.len() {
                values[i] += step * along[i];
                residual[i] -= step * image[i];
            }
            let preconditioned = scaled(&residual);
            let next = dot(&residual, &preconditioned);
            for (a, p) in along.iter_mut().zip(&preconditioned) {
                *a = p + next / size * *a;
            }
            size = next;
        }
    }
}
