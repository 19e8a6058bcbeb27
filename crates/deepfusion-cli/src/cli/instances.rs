use std::path::PathBuf;

use clap::Args;
use deepfusion_instances::Limits;

use super::values::share;

/// A model that tells things apart in the image, where the user has one.
#[derive(Debug, Clone, Args)]
pub(crate) struct InstanceArgs {
    /// ONNX model for segmentation or detection (YOLO-seg, YOLO, YOLOX), run in ONNX Runtime.
    ///
    /// Its masks, with their depth, become targets with a class. Whatever the model does not know is still found from depth alone.
    #[arg(long, value_name = "FILE.onnx", help_heading = HEADING)]
    pub instances: Option<PathBuf>,
    /// Lowest score that counts as found, 0 to 1.
    #[arg(long, value_name = "S", default_value_t = 0.35, value_parser = share, help_heading = HEADING, requires = "instances")]
    pub instance_score: f64,
    /// Classes that count, by the model's names [default: all].
    #[arg(long, value_name = "NAME", value_delimiter = ',', help_heading = HEADING, requires = "instances")]
    pub classes: Vec<String>,
}

const HEADING: &str = "Instance masks";

impl InstanceArgs {
    /// What counts as found.
    pub(crate) fn limits(&self) -> Limits {
        Limits {
            score: self.instance_score as f32,
            classes: self.classes.clone(),
            ..Limits::default()
        }
    }
}
