use sensing::RobotId;
use std::sync::Arc;

/// A robot of the team: the one that recorded a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Robot {
    /// Its index in the order of joining.
    pub id: RobotId,
    /// Its name, distinct from all others': the log's, without folders and endings.
    pub name: Arc<str>,
}
