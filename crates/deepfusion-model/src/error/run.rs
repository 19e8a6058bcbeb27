//! Why a folder is no run's, or a checkpoint none to go on from.

/// The version of the checkpoint's layout; files of another version are refused.
pub const CHECKPOINT_VERSION: u32 = 1;

/// Why a folder is no run's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoRun {
    /// There is no such folder.
    #[error("no such run")]
    Missing,
    /// It has no configuration.
    #[error("this is no run: it has no config.toml")]
    NoConfig,
}

/// What a checkpoint lacks that training needs to go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointLacks {
    /// The optimiser's averages.
    #[error("it has no optimiser state to go on with")]
    OptimiserState,
    /// The decoder of the flow.
    #[error("it has no flow decoder, and this configuration trains one")]
    FlowDecoder,
}
