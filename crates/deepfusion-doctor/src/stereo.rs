//! Whether a drive's two cameras are the right way round: points of the left image must lie further left in the right one.

use super::finding::{Figure, Limit, Outcome, Severity, median};
use super::flow::flow;
use super::reason::CameraReason;
use super::shared_error::SharedError;
use super::skip::CameraSkip;
use deepfusion_data::{Camera, Cameras, Dataset, OpenOptions, Result, grey_image};
use deepfusion_motion::GreyImage;
use std::path::Path;

/// Number of frames compared.
const MOST_FRAMES: usize = 4;
/// Width of the images compared, in pixels.
const WIDTH: u32 = 320;
const LEAST_POINTS: usize = 20;

/// The check of a recording with `image_02` and `image_03`.
pub(super) fn check(path: &Path, options: &OpenOptions) -> Outcome {
    const CHECK: &str = "stereo";
    let options = OpenOptions {
        camera: Cameras::Both,
        split: None,
        ..options.clone()
    };
    let datasets = match Dataset::open(path, &options) {
        Ok(datasets) => datasets,
        Err(error) => return Outcome::skipped(CHECK, SharedError::from(error)),
    };
    let is = |camera| {
        datasets
            .iter()
            .filter(move |d: &&Dataset| d.camera() == camera)
    };
    let mut moved = Vec::new();
    for left in is(Camera::Left) {
        // Drives in different places may have the same name.
        let of_drive =
            |right: &&Dataset| right.name() == left.name() && right.place() == left.place();
        for right in is(Camera::Right).filter(of_drive) {
            match disparities(left, right) {
                Ok(found) => moved.extend(found),
                Err(error) => return Outcome::skipped(CHECK, SharedError::from(error)),
            }
        }
    }
    if moved.len() < LEAST_POINTS {
        let cameras = [Camera::Left, Camera::Right];
        let why = if cameras.iter().all(|camera| is(*camera).next().is_some()) {
            CameraSkip::FewPoints
        } else {
            CameraSkip::OneCamera
        };
        return Outcome::skipped(CHECK, why);
    }
    let mut outcome = Outcome::new(CHECK);
    let figure = Figure::new(
        "disparity from left to right",
        -median(moved),
        "px of 320",
        Limit::AtLeast(0.0),
    );
    outcome.judge(Severity::Error, figure, || CameraReason::Swapped);
    outcome
}

/// How far points move to the right from the left image to the right one, pixels of the small images.
fn disparities(left: &Dataset, right: &Dataset) -> Result<Vec<f64>> {
    let common: Vec<(usize, usize)> = left
        .frames()
        .iter()
        .enumerate()
        .filter_map(|(i, frame)| {
            let same = right
                .frames()
                .binary_search_by_key(&frame.number, |f| f.number);
            Some((i, same.ok()?))
        })
        .collect();
    let step = common.len().div_ceil(MOST_FRAMES).max(1);
    let mut moved = Vec::new();
    for (a, b) in common.into_iter().step_by(step) {
        let k = left.intrinsics(a);
        let height = (k.height * WIDTH).div_ceil(k.width).max(1);
        let grey = |dataset: &Dataset, frame: usize| -> Result<GreyImage> {
            let image = dataset.load_image(frame)?;
            Ok(grey_image(&image, WIDTH, height))
        };
        let points = flow(&grey(left, a)?, &grey(right, b)?);
        // Points that lie too far apart do not show a side.
        moved.extend(points.iter().map(|p| p.by[0]).filter(|by| by.abs() > 0.3));
    }
    Ok(moved)
}
