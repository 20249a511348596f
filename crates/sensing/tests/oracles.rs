//! Laws of scans, limits, decimation and de-skewing.

#[path = "oracles/decimation.rs"]
mod decimation;
#[path = "oracles/deskew.rs"]
mod deskew;
#[path = "oracles/levelling.rs"]
mod levelling;
#[path = "oracles/limits.rs"]
mod limits;
#[path = "oracles/scan.rs"]
mod scan;
