use deepfusion_hint::{Hint, count_of};
use std::path::PathBuf;

/// Why an engine cannot run a network.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EngineProblem {
    /// The fused engine refuses it.
    #[error("{0}")]
    Fused(#[from] deepfusion_infer::Error),
    /// ONNX Runtime refuses it.
    #[error("{0}")]
    Onnx(#[from] deepfusion_onnx::Error),
    /// It cannot be made ready for another input size.
    #[error("{0}")]
    Network(Box<Error>),
    /// The caller's own runner refuses it.
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

/// What can go wrong on the way from a network's name to metres.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Neither a path nor an embedded network's name.
    #[error("{}: no such file or folder, and no embedded network has this name", model.display())]
    NoSuchModel {
        /// What was given.
        model: PathBuf,
        /// The names there are.
        known: Vec<&'static str>,
    },
    /// Something that runs networks and cannot run this one.
    #[error("engine `{engine}`: {reason}")]
    Engine {
        /// Its name.
        engine: &'static str,
        /// What it says.
        #[source]
        reason: Box<EngineProblem>,
    },
    /// Int8 of a network whose convolutions' ranges nobody looked at.
    #[error("int8: the network was not calibrated, or not since it was last trained")]
    NotCalibrated,
    /// A calibration for int8 that cannot be read.
    #[error(transparent)]
    Calibration(#[from] deepfusion_model::UnreadableCalibration),
    /// An image's values are not as many as the network takes.
    #[error("an image of {}, where the network takes {expected}", count_of(*found, "value"))]
    ImageSize {
        /// As many as the network takes.
        expected: usize,
        /// As many as there were.
        found: usize,
    },
    /// Several input sizes of a network that learned one camera at one size.
    #[error(
        "several input sizes: the network learned one camera at one size, without a canonical focal length"
    )]
    OneSize,
    /// A packed network.
    #[error(transparent)]
    Weights(#[from] deepfusion_weights::Error),
    /// The configuration, the run's folder, or the networks' weights.
    #[error(transparent)]
    Model(#[from] deepfusion_model::Error),
    /// ONNX Runtime, or the model made for it.
    #[error(transparent)]
    Onnx(#[from] deepfusion_onnx::Error),
}

impl Error {
    /// What an engine said.
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
                [] => "give the folder of a run; this build has no embedded network".into(),
                known => format!(
                    "give the folder of a run, or an embedded network: {}",
                    known.join(", ")
                ),
            }),
            Self::Engine { reason, .. } => Some(reason.hint().unwrap_or(
                "f32 in the fused engine runs on every processor; with the training framework, Burn runs \
                 every network on every device"
                    .into(),
            )),
            Self::NotCalibrated => Some("bf16 needs no calibration".into()),
            Self::Calibration(_) => Some("calibrate the network again; bf16 needs no calibration".into()),
            Self::ImageSize { .. } => Some("3 × height × width values of the network's size".into()),
            Self::OneSize => Some(
                "the mirrored image (flip) needs no other size; the embedded networks, and what was trained from them, run at any".into(),
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
