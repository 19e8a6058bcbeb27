//! `--device`: where to compute.

use std::fmt;
use std::str::FromStr;

use clap::builder::{PossibleValue, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use deepfusion_model::Compute;

use crate::commands::device;

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

    /// Reads `--device`.
    pub(super) fn parser() -> impl TypedValueParser<Value = Self> {
        Parser
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
    /// What stands behind the colon is no number, or the processor is asked for one.
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

/// Takes the names of [`Backend::ALL`], with an index, and `auto`.
#[derive(Clone)]
struct Parser;

impl TypedValueParser for Parser {
    type Value = ComputeDevice;

    fn parse_ref(
        &self,
        command: &clap::Command,
        arg: Option<&clap::Arg>,
        value: &std::ffi::OsStr,
    ) -> Result<ComputeDevice, clap::Error> {
        let given = value.to_string_lossy();
        if given == "auto" {
            return Ok(device::fastest());
        }
        given.parse().map_err(|why| {
            let mut error = clap::Error::new(ErrorKind::InvalidValue).with_cmd(command);
            if let Some(arg) = arg {
                let named = ContextValue::String(arg.to_string());
                error.insert(ContextKind::InvalidArg, named);
            }
            let given = ContextValue::String(given.into_owned());
            error.insert(ContextKind::InvalidValue, given);
            let valid = match why {
                NoDevice::Index => vec!["cuda:1".into(), "vulkan:0".into()],
                NoDevice::Name => self
                    .possible_values()
                    .into_iter()
                    .flatten()
                    .filter(|value| !value.is_hide_set())
                    .map(|value| value.get_name().to_owned())
                    .collect(),
            };
            error.insert(ContextKind::ValidValue, ContextValue::Strings(valid));
            error
        })
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let auto = PossibleValue::new("auto")
            .help("A GPU where this build and this machine have one, else the processor");
        let named = Backend::ALL
            .iter()
            .map(|(_, name, meaning, built)| PossibleValue::new(*name).help(*meaning).hide(!built));
        Some(Box::new(named.chain([auto])))
    }
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
