//! The devices that this build and this machine have.

use std::fmt;
use std::str::FromStr;

#[cfg(feature = "train")]
use burn::tensor::Device;
use deepfusion_model::Compute;

#[cfg(feature = "train")]
use crate::error::CliError;
#[cfg(feature = "train")]
use crate::failure::Result;
#[cfg(feature = "train")]
use crate::progress::say;

/// What computes: this machine's processor, or a GPU through one of its interfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Backend {
    Cpu,
    Vulkan,
    Wgpu,
    Cuda,
    Metal,
}

impl Backend {
    /// Each with its name, a line for the help, and whether this build has it. Those that it has not are known, so that they are
    /// answered with how to build them.
    pub(crate) const ALL: [(Self, &str, &str, bool); 5] = [
        (Self::Cpu, "cpu", "This machine's processor", true),
        (
            Self::Vulkan,
            "vulkan",
            "A GPU through Vulkan",
            cfg!(feature = "vulkan"),
        ),
        (
            Self::Wgpu,
            "wgpu",
            "A GPU through WebGPU",
            cfg!(feature = "wgpu"),
        ),
        (Self::Cuda, "cuda", "An NVIDIA GPU", cfg!(feature = "cuda")),
        (
            Self::Metal,
            "metal",
            "An Apple GPU",
            cfg!(feature = "metal"),
        ),
    ];

    /// As on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Vulkan => "vulkan",
            Self::Wgpu => "wgpu",
            Self::Cuda => "cuda",
            Self::Metal => "metal",
        }
    }
}

/// A device of a backend: the one with an index, or the one that the backend takes by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ComputeDevice {
    pub(crate) backend: Backend,
    pub(crate) index: Option<usize>,
}

impl Default for ComputeDevice {
    fn default() -> Self {
        Self::of(Backend::Cpu)
    }
}

impl ComputeDevice {
    pub(crate) fn of(backend: Backend) -> Self {
        Self {
            backend,
            index: None,
        }
    }

    /// What a preset's sizes follow.
    pub(crate) fn compute(self) -> Compute {
        match self.backend {
            Backend::Cpu => Compute::Processor,
            Backend::Vulkan | Backend::Wgpu | Backend::Cuda | Backend::Metal => Compute::Gpu,
        }
    }
}

/// As it is given: `cpu`, `cuda:1`.
impl fmt::Display for ComputeDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.backend.name())?;
        match self.index {
            Some(index) => write!(f, ":{index}"),
            None => Ok(()),
        }
    }
}

/// Why a word is no device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum NoDevice {
    /// No backend has this name.
    Name,
    /// Something else than a number behind the colon, or the processor is asked for one.
    Index,
}

impl FromStr for ComputeDevice {
    type Err = NoDevice;

    fn from_str(word: &str) -> Result<Self, NoDevice> {
        let (name, index) = match word.split_once(':') {
            Some((name, index)) => (name, Some(index)),
            None => (word, None),
        };
        let found = Backend::ALL.iter().find(|(_, own, ..)| *own == name);
        let (backend, ..) = found.ok_or(NoDevice::Name)?;
        let index = index.map(str::parse).transpose();
        match index {
            Ok(index) if index.is_none() || *backend != Backend::Cpu => Ok(Self {
                backend: *backend,
                index,
            }),
            _ => Err(NoDevice::Index),
        }
    }
}

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
    let chosen = chosen.ok_or_else(missing)?;
    // Whoever said `auto` hears what it came to.
    say(&format!("computes on {device}"));
    Ok(chosen)
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
    #[allow(unused_imports, reason = "builds without a GPU backend")]
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
        #[allow(unreachable_patterns, reason = "builds with every GPU backend")]
        _ => None,
    }
}

/// The device that a backend takes by itself.
#[cfg(feature = "train")]
fn preferred(backend: Backend) -> Device {
    #[allow(unused_imports, reason = "builds without a GPU backend")]
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
        #[allow(unreachable_patterns, reason = "builds with every GPU backend")]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_a_name_and_perhaps_an_index() {
        for word in [
            "cpu", "vulkan", "wgpu", "cuda", "metal", "cuda:1", "vulkan:0",
        ] {
            let device: ComputeDevice = word.parse().unwrap();
            assert_eq!(device.to_string(), word);
        }
        let second: ComputeDevice = "cuda:1".parse().unwrap();
        assert_eq!((second.backend, second.index), (Backend::Cuda, Some(1)));
        for word in ["cuda:", "cuda:-1", "cuda:x", "cuda:1:2", "cpu:0"] {
            assert_eq!(
                word.parse::<ComputeDevice>(),
                Err(NoDevice::Index),
                "{word}"
            );
        }
        for word in ["", "gpu", "CUDA", ":1", "auto"] {
            assert_eq!(word.parse::<ComputeDevice>(), Err(NoDevice::Name), "{word}");
        }
    }

    /// Sizes follow what a device is, whichever of several it is.
    #[test]
    fn presets_follow_the_kind_of_device() {
        let of = |word: &str| word.parse::<ComputeDevice>().unwrap().compute();
        assert_eq!(of("cpu"), Compute::Processor);
        assert_eq!(of("cuda:1"), Compute::Gpu);
    }
}
