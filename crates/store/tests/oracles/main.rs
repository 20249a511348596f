//! Oracles for the manifold file: what is written comes back bit by bit, after closing, killing,
//! and damage of every kind; and what cannot come back is told.

// A test that cannot unwrap has failed.
#![allow(clippy::unwrap_used)]

mod crash;
mod damage;
mod killing;
mod round_trip;
mod sites;
mod versions;
