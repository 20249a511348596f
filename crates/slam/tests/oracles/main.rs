//! Oracles for the pipeline: maps of known buildings against the truth, runs against runs.

mod accuracy;
mod bad_data;
mod bad_input;
mod corridors;
mod determinism;
mod faults;
mod landmarks;
mod replay;
mod runs;
mod standing_still;
mod storeys;
mod team;
