//! What the command line says of the libraries' errors.

use std::path::Path;

use deepfusion_hint::Hint;

use super::{Exit, Reportable};

/// Errors whose own remedy names no setting that an option has.
macro_rules! as_the_library_says {
    ($($error:ty),* $(,)?) => {
        $(impl Reportable for $error {
            fn remedy(&self) -> Option<String> {
                self.hint()
            }
        })*
    };
}

as_the_library_says!(
    deepfusion_compare::Error,
    deepfusion_eval::Error,
    deepfusion_eval::odometry::PoseFileError,
    deepfusion_eval::odometry::TrackError,
    deepfusion_geometry::cloud::Error,
    deepfusion_infer::Error,
    deepfusion_instances::Error,
    deepfusion_model::Error,
    deepfusion_model::NetworkError,
    deepfusion_motion::Error,
    deepfusion_onnx::Error,
    deepfusion_perception::Error,
    deepfusion_render::Error,
    deepfusion_rosbag::Error,
    deepfusion_runtime::Error,
    deepfusion_sim::Error,
    deepfusion_weights::Error,
);

impl Reportable for deepfusion_data::Error {
    fn remedy(&self) -> Option<String> {
        self.hint()
    }

    fn missing(&self) -> Option<&Path> {
        match self {
            Self::NoSuchPath { path } => Some(path),
            _ => None,
        }
    }
}

#[cfg(feature = "train")]
impl Reportable for deepfusion_train::Error {
    fn remedy(&self) -> Option<String> {
        self.hint()
    }

    fn missing(&self) -> Option<&Path> {
        match self {
            Self::Data(error) => error.missing(),
            _ => None,
        }
    }
}

impl Reportable for deepfusion_view::Error {
    fn remedy(&self) -> Option<String> {
        self.hint()
    }

    fn exit(&self) -> Exit {
        match self {
            // Compiled in or not, the viewer's file has this error.
            Self::Stopped { .. } => Exit::Stopped,
            _ => Exit::Failed,
        }
    }
}

/// Other people's errors, which know no remedy.
macro_rules! foreign {
    ($($error:ty),* $(,)?) => {
        $(impl Reportable for $error {
            fn remedy(&self) -> Option<String> {
                None
            }
        })*
    };
}

foreign!(
    clap::Error,
    glob::PatternError,
    image::ImageError,
    ndarray::ShapeError,
    ndarray_npy::ReadNpyError,
    ndarray_npy::WriteNpyError,
    serde_json::Error,
    std::io::Error,
    toml::de::Error,
    toml::ser::Error,
);
