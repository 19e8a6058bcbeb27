//! What is wrong with a database that is read as far as it goes.

use deepfusion_hint::count_of;
use std::sync::Arc;

/// What is wrong with a database that is read as far as it goes.
#[derive(Debug, Clone, thiserror::Error)]
#[error(
    "the database is damaged ({reason}); {} {} found",
    count_of(*messages, "message"),
    if *messages == 1 { "was" } else { "were" }
)]
pub struct DatabaseDamage {
    /// What SQLite said.
    pub reason: Arc<rusqlite::Error>,
    /// How many messages were found all the same.
    pub messages: usize,
}
