//! What a folder of results holds.

/// What a folder of results holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FolderKind {
    /// The output of `predict` or `perceive`.
    #[error("predictions")]
    Predictions,
    /// A training run without predictions: its learning curve and panels.
    #[error("a training run")]
    Training,
}
