//! Oracles for the optimiser: dense algebra, GTSAM's answers, planted wrong closures.

mod consistency;
mod fixtures;
mod marginals;
mod robust;
mod shared;
mod solver;
mod walks;
