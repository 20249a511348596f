//! Oracles for the geometry: group laws, numeric differentiation and Monte Carlo.

mod angle;
mod gaussian;
mod group;
