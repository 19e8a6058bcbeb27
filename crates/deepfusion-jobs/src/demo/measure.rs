//! How a demo evaluates a network.

use deepfusion_data::{Dataset, GtKind};
use deepfusion_eval::{Crop, GroundTruth, Protocol};
use deepfusion_runtime::DepthEstimator;

use crate::evaluation::{Evaluated, Truth, baseline_from_datasets, evaluate_datasets, predict};
use crate::{Error, Result};

/// The protocol as a sentence for the page.
pub(super) const PROTOCOL: &str = "Scans of the simulated LiDAR, Garg's crop, 80 m. Unscaled: the prediction as it is, in metres. \
    Median-scaled: each image multiplied by median(truth) / median(prediction), as methods without a metric scale need. The \
    mean-depth baseline predicts each pixel's mean depth over the training streets.";

/// Evaluates on the scans of `test`, beside the mean depth of the scans of `train`. `go_on` is called before every frame; `progress`
/// receives the number of frames done, and of all.
///
/// # Errors
/// The error of `go_on`; an image or a scan that cannot be read; the error of the network's engine.
pub fn measure<E: From<Error>>(
    estimator: &mut DepthEstimator,
    train: &[Dataset],
    test: &[Dataset],
    go_on: &mut dyn FnMut() -> Result<(), E>,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Evaluated, E> {
    let protocol = Protocol {
        crop: Crop::Garg,
        gt: GroundTruth::Z,
        ..Protocol::default()
    };
    evaluate_datasets(
        test,
        &mut Truth::Scans(GtKind::Z),
        &protocol,
        Some(baseline_from_datasets(train, GtKind::Z)?),
        &mut |dataset, frame| {
            go_on()?;
            let image = dataset.load_image(frame).map_err(Error::from)?;
            let camera = dataset.intrinsics(frame);
            Ok(predict(estimator, &image, &camera, true)?)
        },
        progress,
    )
}
