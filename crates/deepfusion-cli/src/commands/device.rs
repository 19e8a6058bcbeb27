#[cfg(feature = "train")]
#[cfg(feature = "train")]
use burn::tensor::Device;

use crate::cli::DeviceChoice;
#[cfg(feature = "train")]
use crate::error::CliError;
use crate::failure::Result;

/// The device asked for, where this build has its backend.
#[cfg(feature = "train")]
pub fn open(choice: DeviceChoice) -> Result<Device> {
    #[allow(unused_imports)]
    use burn::tensor::DeviceKind;
    match choice {
        DeviceChoice::Cpu => Ok(Device::flex()),
        #[cfg(feature = "vulkan")]
        DeviceChoice::Vulkan => Ok(Device::vulkan(DeviceKind::DefaultDevice)),
        #[cfg(feature = "wgpu")]
        DeviceChoice::Wgpu => Ok(Device::wgpu(DeviceKind::DefaultDevice)),
        #[cfg(feature = "cuda")]
        DeviceChoice::Cuda => Ok(Device::cuda(0)),
        #[cfg(feature = "metal")]
        DeviceChoice::Metal => Ok(Device::metal(DeviceKind::DefaultDevice)),
        #[allow(unreachable_patterns)]
        other => Err(CliError::NoBackend {
            device: name(other),
        }
        .into()),
    }
}

/// The device's name as on the command line.
pub fn name(choice: DeviceChoice) -> &'static str {
    match choice {
        DeviceChoice::Cpu => "cpu",
        DeviceChoice::Vulkan => "vulkan",
        DeviceChoice::Wgpu => "wgpu",
        DeviceChoice::Cuda => "cuda",
        DeviceChoice::Metal => "metal",
    }
}
