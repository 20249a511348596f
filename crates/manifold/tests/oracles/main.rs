//! Oracles for the manifold: brute force, replay, retraction against never having been there.

mod graphs;
mod journal;
mod levels;
mod relations;
mod retraction;
mod submaps;
mod uncertainty;
