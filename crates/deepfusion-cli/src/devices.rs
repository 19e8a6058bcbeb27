//! The devices that this build and this machine have, and the line that says which one computes.

pub(crate) use deepfusion_jobs::devices::{Backend, ComputeDevice, NoDevice, megabytes};
#[cfg(feature = "train")]
use deepfusion_train::Device;

#[cfg(feature = "train")]
use crate::progress::say;

/// Opens a device, and says which it is where it is not the processor.
///
/// # Errors
/// As [`deepfusion_jobs::devices::open`].
#[cfg(feature = "train")]
pub(crate) fn open(device: ComputeDevice) -> deepfusion_jobs::Result<Device> {
    let opened = deepfusion_jobs::devices::open(device)?;
    // Whoever said `auto` hears what it came to.
    if device.backend != Backend::Cpu {
        say(&format!("computes on {device}"));
    }
    Ok(opened)
}
