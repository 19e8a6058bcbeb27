//! Whether a device computes what this machine's processor does, forward and backward: how a GPU that nobody here has becomes
//! trustworthy.

mod cases;
mod inputs;

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use burn::tensor::Device;

/// How far a device may be from the processor, over the largest value: both round in single precision, in another order.
pub const TOLERANCE: f64 = 1e-3;

/// What needs an operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NeededBy {
    /// The ResNet presets.
    Network,
    /// Lite-Mono alone.
    LiteMono,
    /// R-MSFM alone.
    RMsfm,
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
}

/// An operation on the device beside the same on the processor.
#[derive(Debug, Clone, PartialEq)]
pub struct OperationCheck {
    /// What was computed.
    pub operation: &'static str,
    /// What needs it.
    pub needed_by: NeededBy,
    /// How far its result is from the processor's, over the largest value there; infinite where one is finite and the other is not.
    pub forward: f64,
    /// The same of its gradients; `None` of an operation without.
    pub backward: Option<f64>,
    /// Why it did not run to its end on the device.
    pub failure: Option<String>,
}

impl OperationCheck {
    /// Whether the result is the processor's.
    #[must_use]
    pub fn forward_is_right(&self) -> bool {
        self.failure.is_none() && self.forward <= TOLERANCE
    }

    /// Whether the gradients are the processor's, too.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.forward_is_right() && self.backward.is_none_or(|error| error <= TOLERANCE)
    }
}

/// Computes everything that networks and losses are made of on `device` and on the processor, an operation at a time. `listen` gets each
/// as it is done. An operation that panics, as drivers' errors do, is one that failed; a driver that ends the process is not survived.
pub fn check_device(
    device: &Device,
    mut listen: impl FnMut(&OperationCheck),
) -> Vec<OperationCheck> {
    let processor = Device::flex().autodiff();
    let device = device.clone().autodiff();
    let mut checks = Vec::new();
    for case in cases::all() {
        let right = (case.run)(&processor);
        let check = match catch_unwind(AssertUnwindSafe(|| (case.run)(&device))) {
            Ok(found) => OperationCheck {
                operation: case.operation,
                needed_by: case.needed_by,
                forward: apart(&right.forward, &found.forward),
                backward: (!right.backward.is_empty())
                    .then(|| apart(&right.backward, &found.backward)),
                failure: None,
            },
            Err(panic) => OperationCheck {
                operation: case.operation,
                needed_by: case.needed_by,
                forward: f64::INFINITY,
                backward: None,
                failure: Some(said(&*panic)),
            },
        };
        listen(&check);
        checks.push(check);
    }
    checks
}

/// The largest difference over the largest value.
fn apart(right: &[f32], found: &[f32]) -> f64 {
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
fn said(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string);
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "it does not say why".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The processor agrees with itself, and every case has numbers that say something.
    #[test]
    fn the_processor_is_right() {
        let mut seen = 0;
        let checks = check_device(&Device::flex(), |_| seen += 1);
        assert_eq!(seen, checks.len());
        assert!(checks.len() > 20, "{}", checks.len());
        for check in &checks {
            assert!(check.is_right(), "{check:?}");
            assert_eq!((check.forward, check.backward.unwrap_or(0.0)), (0.0, 0.0));
        }
        let device = Device::flex().autodiff();
        for case in cases::all() {
            let found = (case.run)(&device);
            for (what, values) in [("forward", found.forward), ("backward", found.backward)] {
                if what == "backward" && values.is_empty() {
                    continue;
                }
                let moves = values.iter().any(|v| v.abs() > 1e-6);
                let finite = values.iter().all(|v| v.is_finite());
                assert!(moves && finite, "{}: {what}", case.operation);
            }
        }
    }

    #[test]
    fn what_differs_is_measured() {
        assert_eq!(apart(&[1.0, -4.0], &[1.0, -3.0]), 0.25);
        assert_eq!(apart(&[1.0, f32::NAN], &[1.0, f32::NAN]), 0.0);
        assert_eq!(apart(&[1.0, f32::NAN], &[1.0, 2.0]), f64::INFINITY);
        assert_eq!(apart(&[1.0], &[]), f64::INFINITY);
        let broken = catch_unwind(|| panic!("out of {}", "memory")).unwrap_err();
        assert_eq!(said(&*broken), "out of memory");
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
            failure: Some("gone".into()),
            backward: None,
            ..check
        };
        assert!(!failed.forward_is_right());
    }
}
