use crate::error::StoreError;
use crate::site::{Site, Step};

/// Where a site is kept: every step is written whole or not at all, and what was written is there
/// after any crash.
pub trait Store {
    /// Everything that is kept, as of the last step.
    fn site(&self) -> &Site;

    /// Writes a step. It is on disk when this returns; an empty step writes nothing.
    ///
    /// # Errors
    /// [`StoreError`] says why not. The store then holds everything up to the step before, and
    /// takes no further steps: open it again.
    fn write(&mut self, step: &Step) -> Result<(), StoreError>;

    /// Gives the store back in good order.
    ///
    /// # Errors
    /// Those of the last writes; no step that was written is lost.
    fn close(self) -> Result<(), StoreError>
    where
        Self: Sized;
}
