use deepfusion_data::OpenOptions;
use deepfusion_hint::count_of;
use deepfusion_jobs::find_inputs;
use deepfusion_jobs::int8::{self, Int8Options};

use crate::cli::CalibrateWeightsArgs;
use crate::commands::warnings;
use crate::failure::Result;
use crate::model;
use crate::output;
use crate::progress::Progress;

/// `deepfusion weights calibrate`.
pub(crate) fn run(args: &CalibrateWeightsArgs) -> Result<()> {
    let model = model::named(&args.model)?;
    // Before searching for the images.
    int8::check(&model)?;
    let set = args.set.as_deref();
    let options = OpenOptions {
        assumed_camera: model.assumed_camera(set)?,
        ..OpenOptions::default()
    };
    let images = find_inputs(&args.inputs, &options, warnings::print)?;
    let mut shown = Progress::new("calibrating");
    let options = Int8Options {
        images: usize::from(args.images),
        most_deviation: args.most_deviation,
        set,
    };
    let found = int8::calibrate(&model, &images, options, |done, total| {
        shown.set(done, total);
    });
    drop(shown);
    let (calibration, path) = found?;
    if args.json {
        return output::print_json(&calibration);
    }
    output::print(&format!(
        "{}: {} in int8; depth differs from f32's by {:.2} % on average\n",
        path.display(),
        count_of(calibration.ranges.len(), "convolution"),
        100.0 * calibration.deviation
    ))
}
