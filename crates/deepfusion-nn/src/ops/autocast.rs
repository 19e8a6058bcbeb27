//! Convolutions in another precision than their layers say, for as long as some work takes.

use super::{ConvOptions, Precision};
use burn::backend::DispatchDevice;
use burn::tensor::Device;
use deepfusion_kernels::has_bf16;
use std::cell::Cell;

thread_local! {
    static PRECISION: Cell<Option<Precision>> = const { Cell::new(None) };
}

/// Puts the precision back that was there before, however the work ends.
struct Before(Option<Precision>);

impl Drop for Before {
    fn drop(&mut self) {
        PRECISION.set(self.0);
    }
}

/// Does `work` with the convolutions that it asks for on this thread in `precision`. Their gradients keep it, also where they are
/// asked for afterwards. As `torch.autocast`, but that all tensors stay f32: only what is multiplied is rounded.
pub fn autocast<R>(precision: Precision, work: impl FnOnce() -> R) -> R {
    let _before = Before(PRECISION.replace(Some(precision)));
    work()
}

/// A convolution's options where it is asked for.
pub(super) fn within(options: ConvOptions) -> ConvOptions {
    ConvOptions {
        precision: PRECISION.get().unwrap_or(options.precision),
        ..options
    }
}

/// Whether convolutions on a device can be in this precision: bf16 needs this project's kernels, so no GPU, and a processor
/// that multiplies bf16.
#[must_use]
pub fn supports(device: &Device, precision: Precision) -> bool {
    let on_cpu = matches!(
        device.clone().inner().as_dispatch(),
        DispatchDevice::Flex(_)
    );
    precision == Precision::F32 || (on_cpu && has_bf16())
}
