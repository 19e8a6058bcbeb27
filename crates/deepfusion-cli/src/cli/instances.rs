use std::path::PathBuf;

use clap::Args;
use deepfusion_instances::Limits;

use super::values::share;

/// A model that tells things apart in the image, where the user has one.
#[derive(Debug, Clone, Args)]
pub(crate) struct InstanceArgs {
    /// A segmentation or detection model in ONNX (YOLO-seg, YOLO, YOLOX), run in ONNX Runtime: its masks, with their depth,
    /// become targets of a class; what it does not know is still found by depth alone.
    #[arg(long, value_name = "FILE.onnx", help_heading = HEADING)]
    pub instances: Option<PathBuf>,
    /// Least score of what it finds, 0 to 1.
    #[arg(long, value_name = "S", default_value_t = 0.35, value_parser = share, help_heading = HEADING, requires = "instances")]
    pub instance_score: f64,
    /// The classes that count, by the model's names [default: all].
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
