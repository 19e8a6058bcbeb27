use deepfusion_data::OpenOptions;
use deepfusion_jobs::{find_inputs, int8};
use deepfusion_runtime::ModelSource;

use crate::cli::CalibrateWeightsArgs;
use crate::commands::warnings;
use crate::failure::Result;
use crate::output;
use crate::progress::Progress;

/// `deepfusion weights calibrate`.
pub(crate) fn run(args: &CalibrateWeightsArgs) -> Result<()> {
    let model = ModelSource::named(&args.model)?;
    let options = OpenOptions {
        assumed_camera: model.assumed_camera(None)?,
        ..OpenOptions::default()
    };
    let images = find_inputs(&args.inputs, &options, warnings::print)?;
    let mut shown = Progress::new("calibrating");
    let found = int8::calibrate(&model, &images, usize::from(args.images), |done, total| {
        shown.set(done, total);
    });
    drop(shown);
    let (calibration, path) = found?;
    if args.json {
        return output::print_json(&calibration);
    }
    output::print(&format!(
        "{}: the ranges of {} convolutions, from {} images; --precision int8 uses them\n",
        path.display(),
        calibration.ranges.len(),
        calibration.images
    ))
}
