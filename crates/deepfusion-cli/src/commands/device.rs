//! The devices that this build and this machine have.

#[cfg(feature = "train")]
use burn::tensor::Device;

use crate::cli::{Backend, ComputeDevice};
#[cfg(feature = "train")]
use crate::error::CliError;
#[cfg(feature = "train")]
use crate::failure::Result;

/// Opens a device.
///
/// # Errors
/// [`CliError::NoBackend`] where this build lacks its backend, [`CliError::NoSuchDevice`] where this machine has none of that index.
#[cfg(feature = "train")]
pub(crate) fn open(device: ComputeDevice) -> Result<Device> {
    if device.backend == Backend::Cpu {
        return Ok(Device::flex());
    }
    let backend = device.backend.name();
    let found = found(device.backend).ok_or(CliError::NoBackend { device: backend })?;
    let count = found.len();
    let chosen = match device.index {
        // The backend's own choice: the faster of two.
        None if count > 0 => Some(preferred(device.backend)),
        None => None,
        Some(index) => found.into_iter().nth(index),
    };
    let missing = || CliError::NoSuchDevice {
        device: device.to_string(),
        backend,
        count,
    };
    Ok(chosen.ok_or_else(missing)?)
}

/// A GPU, where this build has a backend for one that this machine has, else the processor: what `--device auto` stands for. A
/// processor that acts as a GPU (Mesa's lavapipe) is not one.
pub(crate) fn fastest() -> ComputeDevice {
    #[cfg(feature = "train")]
    for backend in [
        Backend::Cuda,
        Backend::Metal,
        Backend::Vulkan,
        Backend::Wgpu,
    ] {
        let devices = found(backend).unwrap_or_default();
        if let Some(index) = devices.iter().position(is_a_card) {
            return ComputeDevice {
                backend,
                index: Some(index),
            };
        }
    }
    ComputeDevice::of(Backend::Cpu)
}

/// Bytes in the unit that memory is reported in.
pub(crate) fn megabytes(bytes: u64) -> f64 {
    bytes as f64 / 1024.0 / 1024.0
}

/// This machine's devices of a backend other than the processor's own; `None` where this build does not have it.
#[cfg(feature = "train")]
fn found(backend: Backend) -> Option<Vec<Device>> {
    #[allow(unused_imports)]
    use burn::tensor::DeviceType;
    match backend {
        #[cfg(feature = "vulkan")]
        Backend::Vulkan => Some(Device::enumerate(DeviceType::Vulkan).into_vec()),
        #[cfg(feature = "wgpu")]
        Backend::Wgpu => Some(Device::enumerate(DeviceType::Wgpu).into_vec()),
        #[cfg(feature = "cuda")]
        Backend::Cuda => Some(Device::enumerate(DeviceType::Cuda).into_vec()),
        #[cfg(feature = "metal")]
        Backend::Metal => Some(Device::enumerate(DeviceType::Metal).into_vec()),
        #[allow(unreachable_patterns)]
        _ => None,
    }
}

/// The device that a backend takes by itself.
#[cfg(feature = "train")]
fn preferred(backend: Backend) -> Device {
    #[allow(unused_imports)]
    use burn::tensor::DeviceKind;
    match backend {
        #[cfg(feature = "vulkan")]
        Backend::Vulkan => Device::vulkan(DeviceKind::DefaultDevice),
        #[cfg(feature = "wgpu")]
        Backend::Wgpu => Device::wgpu(DeviceKind::DefaultDevice),
        #[cfg(feature = "cuda")]
        Backend::Cuda => Device::cuda(0),
        #[cfg(feature = "metal")]
        Backend::Metal => Device::metal(DeviceKind::DefaultDevice),
        #[allow(unreachable_patterns)]
        _ => Device::flex(),
    }
}

/// Whether there is a card behind a device: none is behind a processor that acts as one.
#[cfg(any(
    feature = "vulkan",
    feature = "wgpu",
    feature = "cuda",
    feature = "metal"
))]
fn is_a_card(device: &Device) -> bool {
    let identity = device.identity();
    identity.is_some_and(|identity| identity.physical.is_some())
}

/// A build without a GPU's backend finds no device to ask.
#[cfg(all(
    feature = "train",
    not(any(
        feature = "vulkan",
        feature = "wgpu",
        feature = "cuda",
        feature = "metal"
    ))
))]
fn is_a_card(_: &Device) -> bool {
    false
}
