use thiserror::Error;

/// Why something could not be drawn.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum RenderError {
    /// The resolution is not a positive, finite number of metres.
    #[error("grid resolution must be positive and finite, not {resolution_m} m")]
    Resolution {
        /// The resolution asked for, metres.
        resolution_m: f64,
    },
    /// A corner of the area to draw, or a pose, is NaN or infinite.
    #[error("{what} is not finite")]
    NotFinite {
        /// What it is, with its index.
        what: String,
    },
    /// The grid would have more cells than [`crate::GridFrame::MAX_CELLS`].
    #[error(
        "{width} x {height} cells of {resolution_m} m are more than {limit}: \
         choose a coarser resolution or a smaller area"
    )]
    TooLarge {
        /// Columns asked for.
        width: f64,
        /// Rows asked for.
        height: f64,
        /// Cell size, metres.
        resolution_m: f64,
        /// The limit on the product.
        limit: usize,
    },
    /// There is no hit and no pose that says where the map lies.
    #[error("nothing to draw: no scan has a hit")]
    Empty,
    /// The PNG encoder refused the image.
    #[error("cannot encode the image: {0}")]
    Encode(String),
}
