//! Oracles of the rendering crate: exact rooms, laws of counting, files read back.

mod casting;
mod exports;
mod images;
mod occupancy;
mod worlds;
