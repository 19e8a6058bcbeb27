//! Failures of what training depends on: image loaders, their threads, other workers.

use std::error::Error as StdError;

/// Why an image loader stopped early: a bug.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LoaderProblem {
    /// A panic while a batch was made.
    #[error("batch {batch}: {}", text.as_deref().unwrap_or("no message"))]
    Panicked {
        /// The batch, counted from 0.
        batch: usize,
        /// The panic's message, if it has one.
        text: Option<String>,
    },
    /// Its thread ended early.
    #[error("its thread ended before the last batch")]
    Ended,
    /// It returned no batch though it should never end.
    #[error("it has no more batches")]
    NoBatch,
}

/// Which threads could not be started.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ThreadsProblem {
    /// The threads that decode images.
    #[error("{0}")]
    Pool(#[source] rayon::ThreadPoolBuildError),
    /// The thread that makes the batches.
    #[error("{0}")]
    Thread(#[source] std::io::Error),
}

/// What went wrong between workers.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WorkersProblem {
    /// The connection between them failed ([`Workers::sum`](crate::Workers::sum)).
    #[error("{0}")]
    Unreachable(#[source] Box<dyn StdError + Send + Sync>),
    /// Their networks' weights differ.
    #[error("the workers start from different weights")]
    OtherWeights,
    /// Their samples differ.
    #[error("the workers have different samples")]
    OtherSamples,
    /// Their configurations differ.
    #[error("the workers have different settings")]
    OtherSettings,
    /// One of the others could not make its step.
    #[error("another worker has failed")]
    AnotherFailed,
}
