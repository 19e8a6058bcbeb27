//! The devices that this build and this machine have.

use std::fmt;
use std::str::FromStr;

use deepfusion_hint::Hint;
use deepfusion_model::Compute;
#[cfg(feature = "train")]
use deepfusion_train::Device;
use serde::{Serialize, Serializer};

#[cfg(feature = "train")]
use crate::Error;
use crate::Result;

/// A backend: this machine's processor, or a GPU through one of its interfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Backend {
    /// The processor.
    Cpu,
    /// A GPU through Vulkan.
    Vulkan,
    /// A GPU through WebGPU.
    Wgpu,
    /// An NVIDIA GPU through CUDA.
    Cuda,
    /// An Apple GPU through Metal.
    Metal,
}

impl Backend {
    /// All backends, including those that this build lacks ([`Self::is_built`]), so that the error can say how to build them.
    pub const ALL: [Self; 5] = [Self::Cpu, Self::Vulkan, Self::Wgpu, Self::Cuda, Self::Metal];

    /// The backends that this build has.
    pub fn built() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|one| one.is_built())
    }

    /// The backend's name, as in `cuda:1`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Vulkan => "vulkan",
            Self::Wgpu => "wgpu",
            Self::Cuda => "cuda",
            Self::Metal => "metal",
        }
    }

    /// A description in one line.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Cpu => "This machine's processor",
            Self::Vulkan => "A GPU through Vulkan",
            Self::Wgpu => "A GPU through WebGPU",
            Self::Cuda => "An NVIDIA GPU",
            Self::Metal => "An Apple GPU",
        }
    }

    /// Whether this build has it: a GPU backend needs the feature of the same name.
    #[must_use]
    pub fn is_built(self) -> bool {
        match self {
            Self::Cpu => true,
            Self::Vulkan => cfg!(feature = "vulkan"),
            Self::Wgpu => cfg!(feature = "wgpu"),
            Self::Cuda => cfg!(feature = "cuda"),
            Self::Metal => cfg!(feature = "metal"),
        }
    }
}

/// The name, as printed.
impl Serialize for Backend {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// A device of a backend: the one with an index, or the backend's default. By default the processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ComputeDevice {
    /// The backend.
    pub backend: Backend,
    /// Index of the device, from 0, in the backend's own order; `None` for its default.
    pub index: Option<usize>,
}

impl Default for ComputeDevice {
    fn default() -> Self {
        Self::of(Backend::Cpu)
    }
}

impl ComputeDevice {
    /// The default device of a backend.
    #[must_use]
    pub fn of(backend: Backend) -> Self {
        Self {
            backend,
            index: None,
        }
    }

    /// Parses a device: a backend's name, optionally with an index (`cuda:1`), or `auto` for [`fastest`].
    ///
    /// # Errors
    /// [`NoDevice`] for any other word. Whether the build and the machine have the device is checked when it is opened.
    pub fn chosen(word: &str) -> Result<Self, NoDevice> {
        match word {
            "auto" => Ok(fastest()),
            named => named.parse(),
        }
    }

    /// The kind of device, which determines a preset's sizes.
    #[must_use]
    pub fn compute(self) -> Compute {
        match self.backend {
            Backend::Cpu => Compute::Processor,
            Backend::Vulkan | Backend::Wgpu | Backend::Cuda | Backend::Metal => Compute::Gpu,
        }
    }
}

/// The name, as given: `cpu`, `cuda:1`.
impl fmt::Display for ComputeDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.backend.name())?;
        match self.index {
            Some(index) => write!(f, ":{index}"),
            None => Ok(()),
        }
    }
}

/// Why a word is not a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoDevice {
    /// No backend has this name.
    #[error("no device has this name")]
    Name,
    /// The part after the colon is not a number, or the device is the processor.
    #[error("expected the number of a GPU after the colon")]
    Index,
}

impl Hint for NoDevice {
    fn hint(&self) -> Option<String> {
        Some(match self {
            Self::Name => {
                let built = Backend::built().map(Backend::name);
                let names: Vec<&str> = built.chain(["auto"]).collect();
                format!("this build has {}", names.join(", "))
            }
            Self::Index => "give a number from 0, such as cuda:1 or vulkan:0".into(),
        })
    }
}

impl FromStr for ComputeDevice {
    type Err = NoDevice;

    fn from_str(word: &str) -> Result<Self, NoDevice> {
        let (name, index) = match word.split_once(':') {
            Some((name, index)) => (name, Some(index)),
            None => (word, None),
        };
        let found = Backend::ALL.into_iter().find(|one| one.name() == name);
        let backend = found.ok_or(NoDevice::Name)?;
        let index = index.map(str::parse).transpose();
        match index {
            Ok(index) if index.is_none() || backend != Backend::Cpu => Ok(Self { backend, index }),
            _ => Err(NoDevice::Index),
        }
    }
}

/// Opens a device.
///
/// # Errors
/// [`Error::NoBackend`] if this build lacks the backend, [`Error::NoSuchDevice`] if this machine has no device with the index.
#[cfg(feature = "train")]
pub fn open(device: ComputeDevice) -> Result<Device> {
    if device.backend == Backend::Cpu {
        return Ok(Device::flex());
    }
    let backend = device.backend.name();
    let found = found(device.backend).ok_or(Error::NoBackend { device: backend })?;
    let count = found.len();
    let chosen = match device.index {
        // The backend's default: the faster of two.
        None if count > 0 => Some(preferred(device.backend)),
        None => None,
        Some(index) => found.into_iter().nth(index),
    };
    chosen.ok_or_else(|| Error::NoSuchDevice {
        device: device.to_string(),
        backend,
        count,
    })
}

/// The device that `auto` stands for: a GPU, if this machine has one for which this build has a backend, otherwise the processor. A
/// processor that emulates a GPU (Mesa's lavapipe) does not count as one.
#[must_use]
pub fn fastest() -> ComputeDevice {
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

/// Bytes in the unit in which memory is reported: 2^20.
#[must_use]
pub fn megabytes(bytes: u64) -> f64 {
    bytes as f64 / 1024.0 / 1024.0
}

/// This machine's devices of a GPU backend; `None` if this build lacks the backend.
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

/// The default device of a backend.
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

/// Whether a device is hardware, not a processor that emulates a GPU.
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

/// A build without GPU backends finds no device.
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
    fn a_device_is_a_name_with_an_optional_index() {
        for word in [
            "cpu", "vulkan", "wgpu", "cuda", "metal", "cuda:1", "vulkan:0",
        ] {
            let device: ComputeDevice = word.parse().unwrap();
            assert_eq!(device.to_string(), word);
            assert_eq!(ComputeDevice::chosen(word), Ok(device));
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

    /// Sizes depend on the kind of device, not on its index.
    #[test]
    fn presets_follow_the_kind_of_device() {
        let of = |word: &str| word.parse::<ComputeDevice>().unwrap().compute();
        assert_eq!(of("cpu"), Compute::Processor);
        assert_eq!(of("cuda:1"), Compute::Gpu);
    }

    /// The error for a wrong device lists the right ones.
    #[test]
    fn the_error_for_an_unknown_device_lists_the_known_ones() {
        let hint = ComputeDevice::chosen("gpu").unwrap_err().hint().unwrap();
        assert!(hint.contains("cpu") && hint.contains("auto"), "{hint}");
        let hint = ComputeDevice::chosen("cuda:x").unwrap_err().hint().unwrap();
        assert!(hint.contains("cuda:1"), "{hint}");
    }

    /// A backend that is not built gives a different error from a device that the machine lacks.
    #[cfg(feature = "train")]
    #[test]
    fn a_backend_that_is_not_built_is_named() {
        assert!(open(ComputeDevice::default()).is_ok());
        for backend in Backend::ALL.into_iter().filter(|one| !one.is_built()) {
            let error = open(ComputeDevice::of(backend)).unwrap_err();
            let expected = format!("this build has no `{}` backend", backend.name());
            assert_eq!(error.to_string(), expected);
            assert!(error.hint().unwrap().contains(backend.name()), "{expected}");
        }
    }
}
