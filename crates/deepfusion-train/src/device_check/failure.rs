//! Why an operation did not run to its end.

use std::process::ExitStatus;
use std::time::Duration;

/// Why an operation did not run to its end on a device.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OperationFailure {
    /// It panicked, as drivers' errors do, with this message.
    #[error("{0}")]
    Panicked(String),
    /// The process that computed it ended.
    #[error("its process ended ({0})")]
    ProcessEnded(ExitStatus),
    /// The process that computed it did not say anything for so long.
    #[error("it did not answer within {} s", .0.as_secs())]
    Silent(Duration),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn why_an_operation_failed_is_said() {
        let panicked = OperationFailure::Panicked("out of memory".into());
        assert_eq!(panicked.to_string(), "out of memory");
        let ended = OperationFailure::ProcessEnded(ExitStatus::default());
        let status = ExitStatus::default();
        assert_eq!(ended.to_string(), format!("its process ended ({status})"));
        let silent = OperationFailure::Silent(Duration::from_secs(300));
        assert_eq!(silent.to_string(), "it did not answer within 300 s");
    }
}
