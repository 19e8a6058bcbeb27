use deepfusion_hint::{Hint, count_of};
use std::path::PathBuf;

/// Why an engine cannot run a network.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EngineProblem {
    /// The fused engine's error.
    #[error("{0}")]
    Fused(#[from] deepfusion_infer::Error),
    /// ONNX Runtime's error.
    #[error("{0}")]
    Onnx(#[from] deepfusion_onnx::Error),
    /// The network cannot be prepared for another input size.
    #[error("{0}")]
    Network(Box<Error>),
    /// The error of a runner of the caller's own.
    #[error("{0}")]
    Runner(Box<dyn Hint + Send + Sync>),
}

impl From<Error> for EngineProblem {
    fn from(error: Error) -> Self {
        Self::Network(Box::new(error))
    }
}

impl Hint for EngineProblem {
    fn hint(&self) -> Option<String> {
        match self {
            Self::Fused(error) => error.hint(),
            Self::Onnx(error) => error.hint(),
            Self::Network(error) => error.hint(),
            Self::Runner(error) => error.hint(),
        }
    }
}

/// What can go wrong between a network's name and its metric depth.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A model that is neither a path nor an embedded network's name.
    #[error("{}: no such file or folder, and no embedded network has this name", model.display())]
    NoSuchModel {
        /// The model as given.
        model: PathBuf,
        /// Names of the embedded networks.
        known: Vec<&'static str>,
    },
    /// An engine that cannot run the network.
    #[error("engine `{engine}`: {reason}")]
    Engine {
        /// The engine's name.
        engine: &'static str,
        /// Why it cannot.
        #[source]
        reason: Box<EngineProblem>,
    },
    /// Int8 was requested for a network without a valid calibration.
    #[error("int8: the network is not calibrated, or was trained after its calibration")]
    NotCalibrated,
    /// A calibration for int8 that cannot be read.
    #[error(transparent)]
    Calibration(#[from] deepfusion_model::UnreadableCalibration),
    /// An image whose number of values does not match the network's input.
    #[error("input image has {}, expected {expected}", count_of(*found, "value"))]
    ImageSize {
        /// Number of values of the network's input.
        expected: usize,
        /// Number of values of the image.
        found: usize,
    },
    /// Several input sizes were requested of a network that was trained for one camera at one size.
    #[error(
        "several input sizes: the network was trained at one size, without a canonical focal length"
    )]
    OneSize,
    /// An error of a packed network.
    #[error(transparent)]
    Weights(#[from] deepfusion_weights::Error),
    /// An error of the configuration, the run's folder, or the networks' weights.
    #[error(transparent)]
    Model(#[from] deepfusion_model::Error),
    /// An error of ONNX Runtime, or of exporting the model to it.
    #[error(transparent)]
    Onnx(#[from] deepfusion_onnx::Error),
}

impl Error {
    /// Why an engine cannot run a network.
    #[must_use]
    pub fn engine(engine: &'static str, reason: impl Into<EngineProblem>) -> Self {
        Self::Engine {
            engine,
            reason: Box::new(reason.into()),
        }
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::NoSuchModel { known, .. } => Some(match known.as_slice() {
                [] => "give the folder of a run: this build has no embedded network".into(),
                known => format!(
                    "give the folder of a run, or an embedded network: {}",
                    known.join(", ")
                ),
            }),
            Self::Engine { reason, .. } => Some(reason.hint().unwrap_or(
                "use the fused engine in f32, which runs on every processor; with the training framework, Burn runs \
                 every network on every device"
                    .into(),
            )),
            Self::NotCalibrated => Some("calibrate the network, or use bf16, which needs no calibration".into()),
            Self::Calibration(_) => Some("calibrate the network again, or use bf16, which needs no calibration".into()),
            Self::ImageSize { .. } => Some("give 3 × height × width values, at the network's input size".into()),
            Self::OneSize => Some(
                "use flip, which needs one size only, or an embedded network or one trained from it, which run at any size".into(),
            ),
            Self::Weights(error) => error.hint(),
            Self::Model(error) => error.hint(),
            Self::Onnx(error) => error.hint(),
        }
    }
}

impl From<deepfusion_model::NetworkError> for Error {
    fn from(error: deepfusion_model::NetworkError) -> Self {
        Self::Model(error.into())
    }
}
