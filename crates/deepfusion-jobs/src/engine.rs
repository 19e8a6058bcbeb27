//! The engines that run a trained network: the fused engine on the processor, Burn on any device, or the user's ONNX Runtime.

use std::fmt;
use std::path::PathBuf;

use deepfusion_model::weights::Weights;
use deepfusion_model::{Int8Calibration, StoredNetwork, TrainConfig};
use deepfusion_runtime::{DepthEstimator, DepthRunner, FusedRunner, OrtRunner, Precision};

use crate::devices::{Backend, ComputeDevice};
use crate::{Error, Result};

/// An engine that runs a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Engine {
    /// [`Self::Fused`] on the processor, [`Self::Burn`] on any other device.
    #[default]
    Auto,
    /// The training framework. Needs the feature `train`.
    Burn,
    /// This library's own engine for processors.
    Fused,
    /// ONNX Runtime, a library that the user provides.
    Ort,
}

impl Engine {
    /// The engine's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Burn => "burn",
            Self::Fused => "fused",
            Self::Ort => "ort",
        }
    }
}

impl fmt::Display for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The engine, its precision and its device. By default the fused engine in f32 on the processor.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct EngineSettings {
    /// The engine.
    pub engine: Engine,
    /// Precision of the fused engine; the others compute in f32.
    pub precision: Precision,
    /// The library of [`Engine::Ort`]; `None`: it is searched for.
    pub ort_library: Option<PathBuf>,
    /// The device.
    pub device: ComputeDevice,
}

impl EngineSettings {
    /// The default settings for a device.
    #[must_use]
    pub fn on(device: ComputeDevice) -> Self {
        Self {
            device,
            ..Self::default()
        }
    }

    /// The engine that these settings select: never [`Engine::Auto`].
    ///
    /// # Errors
    /// [`Error::OnlyOnCpu`], [`Error::OnlyFused`] and [`Error::OnlyOrt`] for settings that contradict one another.
    pub fn chosen(&self) -> Result<Engine> {
        let on_cpu = self.device.backend == Backend::Cpu;
        let engine = match self.engine {
            Engine::Auto if on_cpu => Engine::Fused,
            Engine::Auto => Engine::Burn,
            chosen => chosen,
        };
        if engine != Engine::Burn && !on_cpu {
            return Err(Error::OnlyOnCpu);
        }
        if engine != Engine::Fused && self.precision != Precision::F32 {
            return Err(Error::OnlyFused {
                precision: self.precision,
            });
        }
        if engine != Engine::Ort && self.ort_library.is_some() {
            return Err(Error::OnlyOrt);
        }
        Ok(engine)
    }

    /// A network's int8 calibration, if these settings need it.
    ///
    /// # Errors
    /// A calibration that cannot be read.
    pub fn calibration(&self, network: &StoredNetwork) -> Result<Option<Int8Calibration>> {
        match self.precision {
            Precision::Int8 => {
                let kept = network.int8.clone();
                Ok(kept.map_err(deepfusion_runtime::Error::from)?)
            }
            _ => Ok(None),
        }
    }

    /// The runner for a network of this configuration with these weights. `int8` is its calibration ([`Self::calibration`]).
    ///
    /// # Errors
    /// As [`Self::chosen`], [`FusedRunner::with_calibration`] and [`OrtRunner::new`]; [`Error::NoBackend`] and [`Error::NoSuchDevice`] for
    /// a missing device, [`Error::NoFramework`] for Burn in a build without it.
    pub fn runner(
        &self,
        config: &TrainConfig,
        weights: Weights,
        int8: Option<&Int8Calibration>,
    ) -> Result<Box<dyn DepthRunner>> {
        Ok(match self.chosen()? {
            Engine::Burn | Engine::Auto => in_burn(self.device, config, &weights)?,
            Engine::Fused => Box::new(FusedRunner::with_calibration(
                config,
                weights,
                self.precision,
                int8,
            )?),
            Engine::Ort => Box::new(OrtRunner::new(
                self.ort_library.as_deref(),
                config,
                weights,
            )?),
        })
    }

    /// A stored network, ready to predict images.
    ///
    /// # Errors
    /// As [`Self::calibration`] and [`Self::runner`].
    pub fn load(self, network: StoredNetwork) -> Result<DepthEstimator> {
        let int8 = self.calibration(&network)?;
        DepthEstimator::of(network, move |config, weights| {
            self.runner(config, weights, int8.as_ref())
        })
    }
}

/// Runs the network in Burn.
#[cfg(feature = "train")]
fn in_burn(
    device: ComputeDevice,
    config: &TrainConfig,
    weights: &Weights,
) -> Result<Box<dyn DepthRunner>> {
    let device = crate::devices::open(device)?;
    let runner = deepfusion_train::BurnRunner::new(config, weights, &device)?;
    Ok(Box::new(runner))
}

#[cfg(not(feature = "train"))]
fn in_burn(_: ComputeDevice, _: &TrainConfig, _: &Weights) -> Result<Box<dyn DepthRunner>> {
    Err(Error::NoFramework)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(engine: Engine, precision: Precision, device: &str) -> EngineSettings {
        EngineSettings {
            engine,
            precision,
            device: device.parse().unwrap(),
            ..EngineSettings::default()
        }
    }

    #[test]
    fn the_device_chooses_the_engine() {
        for (device, expected) in [("cpu", Engine::Fused), ("cuda:1", Engine::Burn)] {
            let chosen = settings(Engine::Auto, Precision::F32, device).chosen();
            assert_eq!(chosen.unwrap(), expected, "{device}");
        }
        let asked = settings(Engine::Burn, Precision::F32, "cpu").chosen();
        assert_eq!(asked.unwrap(), Engine::Burn);
    }

    #[test]
    fn settings_that_contradict_one_another_are_errors() {
        let elsewhere = settings(Engine::Fused, Precision::F32, "vulkan").chosen();
        assert!(matches!(elsewhere, Err(Error::OnlyOnCpu)));
        let on_a_gpu = settings(Engine::Auto, Precision::Bf16, "vulkan").chosen();
        assert!(matches!(
            on_a_gpu,
            Err(Error::OnlyFused {
                precision: Precision::Bf16
            })
        ));
        let library = EngineSettings {
            ort_library: Some("libonnxruntime.so".into()),
            ..EngineSettings::default()
        };
        assert!(matches!(library.chosen(), Err(Error::OnlyOrt)));
    }

    /// All engines compute the same network.
    #[cfg(feature = "train")]
    #[test]
    fn burn_and_the_fused_engine_agree() {
        let source = deepfusion_runtime::ModelSource::named("tiny".as_ref()).unwrap();
        let load = |engine| {
            let settings = settings(engine, Precision::F32, "cpu");
            settings.load(source.load(None).unwrap()).unwrap()
        };
        let (mut fused, mut burn) = (load(Engine::Auto), load(Engine::Burn));
        assert_eq!((fused.engine(), burn.engine()), ("fused", "burn"));
        let size = fused.config().size;
        let image: Vec<f32> = (0..3 * size.width * size.height)
            .map(|i| (i % 251) as f32 / 251.0)
            .collect();
        let expected = fused.runner().disparity(&image).unwrap();
        let found = burn.runner().disparity(&image).unwrap();
        for (found, expected) in found.iter().zip(&expected) {
            assert!(
                (found - expected).abs() <= 5e-3 * expected,
                "{found} {expected}"
            );
        }
    }
}
