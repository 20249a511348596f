//! Oracles for the geometry: group laws, numeric differentiation and Monte Carlo.

// A test that cannot unwrap has failed.
#![allow(clippy::unwrap_used)]

mod angle;
mod gaussian;
mod group;
