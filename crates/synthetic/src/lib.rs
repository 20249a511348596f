//! Placeholder crate doc; written with the crate.
