//! What ends training from outside of it: a loader's threads, other workers.

use std::error::Error as StdError;

/// What a loader of images died of: a fault of the program.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LoaderProblem {
    /// A panic while a batch was made.
    #[error("batch {batch}: {}", text.as_deref().unwrap_or("it does not say why"))]
    Panicked {
        /// The batch, counted from 0.
        batch: usize,
        /// The panic's message, where it has one.
        text: Option<String>,
    },
    /// Its thread is gone.
    #[error("its thread has ended before the last batch")]
    Ended,
    /// It has ended, and should have gone on.
    #[error("it has no further batch")]
    NoBatch,
}

/// Which threads the system does not give.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ThreadsProblem {
    /// Those that decode images.
    #[error("{0}")]
    Pool(#[source] rayon::ThreadPoolBuildError),
    /// The one that has batches made.
    #[error("{0}")]
    Thread(#[source] std::io::Error),
}

/// What went wrong between workers.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WorkersProblem {
    /// What connects them says so ([`Workers::sum`](crate::Workers::sum)).
    #[error("{0}")]
    Unreachable(#[source] Box<dyn StdError + Send + Sync>),
    /// Their networks differ.
    #[error("they begin from other weights")]
    OtherWeights,
    /// Their recordings differ.
    #[error("they have other samples")]
    OtherSamples,
    /// Their configurations differ.
    #[error("they have other settings")]
    OtherSettings,
    /// One of the others could not make its step.
    #[error("another worker has failed")]
    AnotherFailed,
}
