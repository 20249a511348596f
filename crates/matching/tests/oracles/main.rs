//! Oracles for the matchers: laws, brute force, known truth.

mod bound;
mod calibration;
mod laws;
mod rooms;
mod search;
