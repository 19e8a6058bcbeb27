//! Runs a closure's convolutions in another precision than their layers are configured for.

use super::{ConvOptions, Precision};
use burn::backend::DispatchDevice;
use burn::tensor::Device;
use deepfusion_kernels::has_bf16;
use std::cell::Cell;

thread_local! {
    static PRECISION: Cell<Option<Precision>> = const { Cell::new(None) };
}

/// Restores the previous precision when dropped.
struct PrecisionGuard(Option<Precision>);

impl Drop for PrecisionGuard {
    fn drop(&mut self) {
        PRECISION.set(self.0);
    }
}

/// Runs `work` with the convolutions of this thread in `precision`. Their backward passes use the same precision, even if they
/// run later. As `torch.autocast`, except that all results stay f32: only the factors of the products are rounded.
pub fn autocast<R>(precision: Precision, work: impl FnOnce() -> R) -> R {
    let _guard = PrecisionGuard(PRECISION.replace(Some(precision)));
    work()
}

/// A convolution's options, with this thread's precision.
pub(super) fn within(options: ConvOptions) -> ConvOptions {
    ConvOptions {
        precision: PRECISION.get().unwrap_or(options.precision),
        ..options
    }
}

/// Whether a device supports this precision: bf16 needs a processor with bf16 instructions, or a GPU with tensor cores for it.
#[must_use]
pub fn supports(device: &Device, precision: Precision) -> bool {
    precision == Precision::F32
        || match device.clone().inner().as_dispatch() {
            DispatchDevice::Flex(_) => has_bf16(),
            #[cfg(feature = "gpu")]
            DispatchDevice::Cube(device) => {
                super::gpu::conv::tensor_cores::has_tensor_cores(device)
            }
            _ => false,
        }
}
