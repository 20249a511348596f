//! Oracles for the matchers: laws, brute force, known truth.

mod bound;
mod calibration;
mod combined;
mod edge_cases;
mod field;
mod laws;
mod lines;
mod ndt;
mod perturbed;
mod rooms;
mod search;
