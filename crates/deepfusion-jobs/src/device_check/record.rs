//! What was found of a device, as a document for scripts.

use deepfusion_train::device_check::{DeviceCheck, TOLERANCE};
use serde::Serialize;

use crate::devices::ComputeDevice;

/// What was found of a device.
#[derive(Debug, Serialize)]
pub struct DeviceCheckRecord {
    /// The device.
    pub device: String,
    /// How far it may be from the processor, over the largest value.
    pub tolerance: f64,
    /// Whether the ResNet presets' depth is the processor's.
    pub predict: bool,
    /// Whether they learn from video as on the processor.
    pub train: bool,
    /// Operation by operation.
    pub operations: Vec<OperationRecord>,
}

/// An operation; errors over the largest value, `null` where that is infinite or NaN.
#[derive(Debug, Serialize)]
pub struct OperationRecord {
    /// What was computed.
    pub operation: &'static str,
    /// Whether it is the processor's, forward and backward.
    pub right: bool,
    /// How far its result is off.
    pub forward: Option<f64>,
    /// How far its gradients are off.
    pub backward: Option<f64>,
    /// Why it did not run to its end.
    pub failure: Option<String>,
}

impl DeviceCheckRecord {
    /// Of a device and what was found of it.
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
    fn what_is_infinite_is_null() {
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
