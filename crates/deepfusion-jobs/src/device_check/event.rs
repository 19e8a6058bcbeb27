//! What happens while a device is checked.

use deepfusion_train::device_check::OperationCheck;

/// What happens while a device is checked.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum DeviceCheckEvent {
    /// A process begins: the first one, or one that goes on where another ended or was silent.
    Started {
        /// The operation that it begins with.
        operation: &'static str,
    },
    /// An operation is done, or failed.
    Checked(OperationCheck),
}
