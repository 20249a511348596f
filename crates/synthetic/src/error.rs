use thiserror::Error;

/// Why a synthetic log could not be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SyntheticError {
    /// The underlying writer failed.
    #[error("cannot write the synthetic log: {0}")]
    Write(#[from] std::io::Error),
}
