//! Oracles for the optimiser: dense algebra, GTSAM's answers, planted wrong closures.

// A test that cannot unwrap has failed.
#![allow(clippy::unwrap_used)]

mod consistency;
mod fixtures;
mod marginals;
mod robust;
mod shared;
mod solver;
mod team;
mod walks;
