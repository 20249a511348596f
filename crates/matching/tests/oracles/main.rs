//! Oracles for the matchers: laws, brute force, known truth.

mod rooms;
mod search;
