//! The result of a device check, as JSON for scripts.

use deepfusion_train::device_check::{DeviceCheck, TOLERANCE};
use serde::Serialize;

use crate::devices::ComputeDevice;

/// The result of a device check.
#[derive(Debug, Serialize)]
pub struct DeviceCheckRecord {
    /// Name of the device.
    pub device: String,
    /// Largest accepted difference from the processor, relative to the largest value.
    pub tolerance: f64,
    /// Whether the ResNet presets predict the same depth as on the processor.
    pub predict: bool,
    /// Whether they can be trained on video as on the processor.
    pub train: bool,
    /// The result of each operation.
    pub operations: Vec<OperationRecord>,
}

/// The result of an operation. Errors are relative to the largest value; `null` if that is infinite or NaN.
#[derive(Debug, Serialize)]
pub struct OperationRecord {
    /// Name of the operation.
    pub operation: &'static str,
    /// Whether result and gradients match the processor's.
    pub right: bool,
    /// Error of its result.
    pub forward: Option<f64>,
    /// Error of its gradients.
    pub backward: Option<f64>,
    /// Why it did not finish.
    pub failure: Option<String>,
}

impl DeviceCheckRecord {
    /// The record of a device's check.
    #[must_use]
    pub fn of(device: ComputeDevice, found: &DeviceCheck) -> Self {
        let operations = found.operations.iter().map(|check| OperationRecord {
            operation: check.operation,
            right: check.is_right(),
            forward: Some(check.forward).filter(|error| *error < f64::MAX),
            backward: check.backward.filter(|error| *error < f64::MAX),
            failure: check.failure.as_ref().map(ToString::to_string),
        });
        Self {
            device: device.to_string(),
            tolerance: TOLERANCE,
            predict: found.predicts(),
            train: found.trains(),
            operations: operations.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_train::device_check::{NeededBy, OperationCheck, OperationFailure};

    #[test]
    fn infinite_errors_are_null() {
        let failed = OperationCheck {
            operation: "any",
            needed_by: NeededBy::Flow,
            forward: f64::INFINITY,
            backward: None,
            failure: Some(OperationFailure::Panicked("out of memory".into())),
        };
        let found = DeviceCheck {
            operations: vec![failed],
        };
        let record = DeviceCheckRecord::of(ComputeDevice::default(), &found);
        assert_eq!(
            serde_json::to_string(&record).unwrap(),
            r#"{"device":"cpu","tolerance":0.001,"predict":true,"train":true,"operations":[{"operation":"any","right":false,"forward":null,"backward":null,"failure":"out of memory"}]}"#
        );
    }
}
