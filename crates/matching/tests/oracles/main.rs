//! Oracles for the matchers: laws, brute force, known truth.

mod bound;
mod calibration;
mod field;
mod laws;
mod lines;
mod perturbed;
mod rooms;
mod search;
