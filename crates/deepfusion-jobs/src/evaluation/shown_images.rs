//! Reads the chosen images of an evaluation again, to show them.

use std::collections::HashMap;

use deepfusion_data::{Dataset, RgbImage, ground_truth_names};
use deepfusion_eval::{ArraySet, Grid, Prediction};
use deepfusion_geometry::Intrinsics;
use deepfusion_render::ShownFrame;

use super::{ChosenImage, Evaluated, ImageRef, Truth, array_places, chosen_images, depth_map};
use crate::Result;

/// What to show of an image.
struct ImageToShow {
    image: Option<RgbImage>,
    prediction: Prediction,
    truth: Grid,
    camera: Option<Intrinsics>,
}

/// The chosen images of recordings, with their pictures; `predict` returns an image of a data set and its prediction.
///
/// # Errors
/// An error of `predict`; ground truth that cannot be read.
pub fn shown_of_datasets(
    datasets: &[Dataset],
    truth: &mut Truth,
    evaluated: &Evaluated,
    mut predict: impl FnMut(&Dataset, usize) -> Result<(RgbImage, Prediction)>,
) -> Result<Vec<(ChosenImage, ShownFrame)>> {
    let names = ground_truth_names(datasets);
    let arrays = match truth {
        Truth::Scans(_) => HashMap::new(),
        Truth::Arrays(arrays) => array_places(arrays, datasets)?,
    };
    shown(evaluated, |ImageRef(number, frame)| {
        let dataset = &datasets[number];
        let place = dataset.selected().iter().position(|f| *f == frame);
        let name = place.and_then(|p| names[number].get(p));
        let array = name.and_then(|n| arrays.get(n)).copied();
        let (image, prediction) = predict(dataset, frame)?;
        let depth = truth.of(dataset, frame, array)?;
        Ok(depth.map(|depth| ImageToShow {
            image: Some(image),
            prediction,
            truth: depth,
            camera: Some(dataset.intrinsics(frame)),
        }))
    })
}

/// The chosen images of array files, without pictures; `of_kind` is the kind of the first file's arrays.
///
/// # Errors
/// An array that cannot be read.
pub fn shown_of_arrays(
    (predicted, of_kind): (&mut ArraySet, &dyn Fn(Grid) -> Prediction),
    known: &mut ArraySet,
    evaluated: &Evaluated,
) -> Result<Vec<(ChosenImage, ShownFrame)>> {
    shown(evaluated, |ImageRef(prediction, depth)| {
        Ok(Some(ImageToShow {
            image: None,
            prediction: of_kind(predicted.read(prediction)?),
            truth: known.read(depth)?,
            camera: None,
        }))
    })
}

fn shown(
    evaluated: &Evaluated,
    mut read: impl FnMut(ImageRef) -> Result<Option<ImageToShow>>,
) -> Result<Vec<(ChosenImage, ShownFrame)>> {
    let mut frames = Vec::new();
    for chosen in chosen_images(&evaluated.images) {
        let Some(to_show) = read(evaluated.places[chosen.image])? else {
            continue;
        };
        let truth = depth_map(&to_show.truth);
        let score = &evaluated.images[chosen.image];
        let frame = ShownFrame {
            title: format!(
                "{}: {}, Abs Rel {:.3} unscaled, {:.3} median-scaled, scale {:.3}",
                chosen.standing,
                score.name,
                score.unscaled.abs_rel,
                score.median_scaled.abs_rel,
                score.ratio
            ),
            image: to_show.image,
            prediction: to_show.prediction.depth_at(truth.width, truth.height),
            truth,
            camera: to_show.camera,
        };
        frames.push((chosen, frame));
    }
    Ok(frames)
}
