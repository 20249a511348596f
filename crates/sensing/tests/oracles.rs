//! Laws of scans, limits, decimation and de-skewing.

#[path = "oracles/decimation.rs"]
mod decimation;
#[path = "oracles/deskew.rs"]
mod deskew;
#[path = "oracles/limits.rs"]
mod limits;
#[path = "oracles/scan.rs"]
mod scan;
