//! The devices of this build and this machine, and the line that names the one in use.

pub(crate) use deepfusion_jobs::devices::{Backend, ComputeDevice, NoDevice, megabytes};
#[cfg(feature = "train")]
use deepfusion_train::Device;

#[cfg(feature = "train")]
use crate::progress::say;

/// Opens a device, and prints its name unless it is the processor.
///
/// # Errors
/// As [`deepfusion_jobs::devices::open`].
#[cfg(feature = "train")]
pub(crate) fn open(device: ComputeDevice) -> deepfusion_jobs::Result<Device> {
    let opened = deepfusion_jobs::devices::open(device)?;
    // So that users of `auto` see which device was chosen.
    if device.backend != Backend::Cpu {
        say(&format!("computing on {device}"));
    }
    Ok(opened)
}
