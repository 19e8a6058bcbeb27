//! Checks whether a device computes the same as this machine's processor, forward and backward. So users can check a GPU that we never
//! tested.

mod cases;
mod inputs;
mod summary;

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitStatus;
use std::time::Duration;

use burn::tensor::Device;
use inputs::{Inputs, Outcome};

pub use summary::{DeviceCheck, DeviceUse};

/// Largest difference between device and processor, relative to the largest value: both round in single precision, in different orders.
pub const TOLERANCE: f64 = 1e-3;

/// What an operation is needed for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NeededBy {
    /// The ResNet presets.
    Network,
    /// Lite-Mono alone.
    LiteMono,
    /// R-MSFM alone.
    RMsfm,
    /// DispNet alone.
    DispNet,
    /// Learning from video.
    Views,
    /// Learning from known depth.
    Depth,
    /// `loss.flow`.
    Flow,
    /// `loss.affine`.
    Affine,
    /// Learning anything.
    Learning,
    /// Learning with `precision = "bf16"`.
    MixedPrecision,
}

/// An operation on a device, compared with the processor.
#[derive(Debug, Clone, PartialEq)]
pub struct OperationCheck {
    /// The operation's name.
    pub operation: &'static str,
    /// What it is needed for.
    pub needed_by: NeededBy,
    /// Largest difference from the processor's result, relative to the largest value there; infinite where one is finite and the other is
    /// not.
    pub forward: f64,
    /// The same for its gradients; `None` for an operation without gradients.
    pub backward: Option<f64>,
    /// Why it did not finish on the device; `None` if it did.
    pub failure: Option<OperationFailure>,
}

/// Why an operation did not finish on a device.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OperationFailure {
    /// It panicked with this message, as driver errors do.
    #[error("{0}")]
    Panicked(String),
    /// The process that computed it ended.
    #[error("its process ended ({0})")]
    ProcessEnded(ExitStatus),
    /// The process that computed it did not answer within this time.
    #[error("it did not answer within {} s", .0.as_secs())]
    Silent(Duration),
}

impl OperationCheck {
    /// Whether the result equals the processor's, within [`TOLERANCE`].
    #[must_use]
    pub fn forward_is_right(&self) -> bool {
        self.failure.is_none() && self.forward <= TOLERANCE
    }

    /// Whether result and gradients equal the processor's, within [`TOLERANCE`].
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.forward_is_right() && self.backward.is_none_or(|error| error <= TOLERANCE)
    }
}

/// Names of all operations that are compared, the simple ones first.
pub fn operations() -> impl Iterator<Item = (&'static str, NeededBy)> {
    let cases = cases::all().into_iter();
    cases.map(|case| (case.operation, case.needed_by))
}

/// Computes an operation on a device and on the processor; `None` for a name that [`operations`] does not list. A panic, as from a driver's
/// error, counts as a failure. A driver may also end the whole process: to continue after that, run each operation in a process of its own.
#[must_use]
pub fn check_operation(operation: &str, device: &Device) -> Option<OperationCheck> {
    let mut cases = cases::all().into_iter();
    let case = cases.find(|case| case.operation == operation)?;
    let right = (case.run)(&Inputs::exact(&Device::flex()));
    let found = catch_unwind(AssertUnwindSafe(|| (case.run)(&Inputs::exact(device))));
    let check = OperationCheck {
        operation: case.operation,
        needed_by: case.needed_by,
        forward: f64::INFINITY,
        backward: None,
        failure: None,
    };
    Some(match found {
        Ok(found) => compared(check, &right, &found),
        Err(panic) => OperationCheck {
            failure: Some(OperationFailure::Panicked(panic_message(&*panic))),
            ..check
        },
    })
}

/// Completes the check with the differences between `right` and `found`.
fn compared(check: OperationCheck, right: &Outcome, found: &Outcome) -> OperationCheck {
    let has_gradients = !right.backward.is_empty();
    OperationCheck {
        forward: apart(&right.forward, &found.forward),
        backward: has_gradients.then(|| apart(&right.backward, &found.backward)),
        ..check
    }
}

/// The largest difference in a part relative to the largest value there, for the worst part.
fn apart(right: &[Vec<f32>], found: &[Vec<f32>]) -> f64 {
    if right.len() != found.len() {
        return f64::INFINITY;
    }
    let parts = right.iter().zip(found);
    parts.fold(0.0, |most, (a, b)| most.max(part_apart(a, b)))
}

fn part_apart(right: &[f32], found: &[f32]) -> f64 {
    let same_kind = |(a, b): (&f32, &f32)| a.is_finite() == b.is_finite();
    if right.len() != found.len() || !right.iter().zip(found).all(same_kind) {
        return f64::INFINITY;
    }
    let finite = || right.iter().zip(found).filter(|(a, _)| a.is_finite());
    let largest = finite().fold(0.0_f64, |most, (a, _)| most.max(f64::from(a.abs())));
    let difference = finite().fold(0.0_f64, |most, (a, b)| {
        most.max((f64::from(*a) - f64::from(*b)).abs())
    });
    difference / largest.max(1e-6)
}

/// A panic's message.
fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string);
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "no message".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(operation: &str) -> OperationCheck {
        check_operation(operation, &Device::flex()).unwrap()
    }

    #[test]
    fn the_processor_agrees_with_itself() {
        for operation in ["convolution 3x3", "optimiser"] {
            let found = check(operation);
            assert!(found.is_right() && found.forward == 0.0, "{found:?}");
        }
        assert!(check("warp").backward.is_some());
        assert_eq!(check_operation("any", &Device::flex()), None);
    }

    /// Rounding errors in the inputs, as from another order of summation, must pass; errors a thousand times as large must fail. So every
    /// case is sensitive enough, and none depends on a single pixel.
    #[test]
    fn rounding_errors_pass_and_larger_errors_fail() {
        for case in cases::all() {
            let with = |rounding| {
                (case.run)(&Inputs {
                    rounding,
                    ..Inputs::exact(&Device::flex())
                })
            };
            let right = with(0.0);
            let check = |found| {
                let check = OperationCheck {
                    operation: case.operation,
                    needed_by: case.needed_by,
                    forward: 0.0,
                    backward: None,
                    failure: None,
                };
                compared(check, &right, &found)
            };
            let (rounded, wrong) = (check(with(1e-6)), check(with(3e-2)));
            println!(
                "{:42} {:8.1e} {:?}; {:8.1e} {:?}",
                case.operation, rounded.forward, rounded.backward, wrong.forward, wrong.backward
            );
            assert!(rounded.is_right(), "{rounded:?}");
            assert!(!wrong.is_right(), "{wrong:?}");
        }
    }

    #[test]
    fn differences_are_relative_to_the_largest_value() {
        let apart = |right: &[f32], found: &[f32]| apart(&[right.to_vec()], &[found.to_vec()]);
        assert_eq!(apart(&[1.0, -4.0], &[1.0, -3.0]), 0.25);
        assert_eq!(apart(&[1.0, f32::NAN], &[1.0, f32::NAN]), 0.0);
        assert_eq!(apart(&[1.0, f32::NAN], &[1.0, 2.0]), f64::INFINITY);
        assert_eq!(apart(&[1.0], &[]), f64::INFINITY);
        // A large part does not hide a small one.
        let parts = |small| [vec![100.0], vec![small]];
        assert!(super::apart(&parts(0.1), &parts(0.2)) > 0.9);
        let broken = catch_unwind(|| panic!("out of {}", "memory")).unwrap_err();
        assert_eq!(panic_message(&*broken), "out of memory");
    }

    #[test]
    fn a_wrong_gradient_leaves_the_result_right() {
        let check = OperationCheck {
            operation: "any",
            needed_by: NeededBy::Network,
            forward: 1e-6,
            backward: Some(0.5),
            failure: None,
        };
        assert!(check.forward_is_right() && !check.is_right());
        let failed = OperationCheck {
            failure: Some(OperationFailure::Panicked("gone".into())),
            backward: None,
            ..check
        };
        assert!(!failed.forward_is_right());
    }

    #[test]
    fn a_failure_has_the_panics_message() {
        let panicked = OperationFailure::Panicked("out of memory".into());
        assert_eq!(panicked.to_string(), "out of memory");
        let ended = OperationFailure::ProcessEnded(ExitStatus::default());
        let status = ExitStatus::default();
        assert_eq!(ended.to_string(), format!("its process ended ({status})"));
        let silent = OperationFailure::Silent(Duration::from_secs(300));
        assert_eq!(silent.to_string(), "it did not answer within 300 s");
    }
}
