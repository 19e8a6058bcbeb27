#[cfg(feature = "train")]
use burn::tensor::Device;

use crate::cli::ComputeDevice;
#[cfg(feature = "train")]
use crate::error::CliError;
use crate::failure::Result;

/// The device asked for, where this build has its backend.
#[cfg(feature = "train")]
pub(crate) fn open(device: ComputeDevice) -> Result<Device> {
    #[allow(unused_imports)]
    use burn::tensor::DeviceKind;
    match device {
        ComputeDevice::Cpu => Ok(Device::flex()),
        #[cfg(feature = "vulkan")]
        ComputeDevice::Vulkan => Ok(Device::vulkan(DeviceKind::DefaultDevice)),
        #[cfg(feature = "wgpu")]
        ComputeDevice::Wgpu => Ok(Device::wgpu(DeviceKind::DefaultDevice)),
        #[cfg(feature = "cuda")]
        ComputeDevice::Cuda => Ok(Device::cuda(0)),
        #[cfg(feature = "metal")]
        ComputeDevice::Metal => Ok(Device::metal(DeviceKind::DefaultDevice)),
        #[allow(unreachable_patterns)]
        other => Err(CliError::NoBackend {
            device: name(other),
        }
        .into()),
    }
}

/// The device's name as on the command line.
pub(crate) fn name(device: ComputeDevice) -> &'static str {
    match device {
        ComputeDevice::Cpu => "cpu",
        ComputeDevice::Vulkan => "vulkan",
        ComputeDevice::Wgpu => "wgpu",
        ComputeDevice::Cuda => "cuda",
        ComputeDevice::Metal => "metal",
    }
}
