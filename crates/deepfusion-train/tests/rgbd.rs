//! Learning from an RGB-D folder: in metres, with holes that are not sky, and without speeds.

use crate::support::small_without_data;
use burn::tensor::{Device, Tensor};
use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_train::{
    Control, DepthLoader, Error, Learn, LossTerms, RunFolder, SampleSet, TrainConfig, TrainEvent,
    Trainer,
};
use image::{ImageBuffer, Luma, Rgb, RgbImage};
use std::path::Path;

/// Width of the colour images: twice the network's input.
const WIDTH: u32 = 192;
const HEIGHT: u32 = 128;

/// A slanted wall, in millimetres, with both values for missing depth: 0 in one corner, 65535 in the opposite one.
fn depth_mm(x: u32, y: u32) -> u16 {
    match (x, y) {
        (..96, ..40) => 0,
        (96.., 88..) => 65_535,
        _ => 1000 + 20 * x as u16,
    }
}

/// Six frames in the layout of 7-Scenes, without poses, times and speeds. A depth pixel covers `across` by `down` colour pixels.
fn write_folder(folder: &Path, [across, down]: [u32; 2]) {
    for n in 0..6_u32 {
        let at = |ending: &str| folder.join(format!("frame-{n:06}.{ending}"));
        let colour = |x: u32, y: u32| Rgb([x as u8, (y * 2) as u8, (40 * n) as u8]);
        let image = RgbImage::from_fn(WIDTH, HEIGHT, colour);
        image.save(at("color.png")).unwrap();
        let depth: ImageBuffer<Luma<u16>, _> =
            ImageBuffer::from_fn(WIDTH / across, HEIGHT / down, |x, y| {
                Luma([depth_mm(x * across, y * down)])
            });
        depth.save(at("depth.png")).unwrap();
    }
    let camera = "180 0 95.5\n0 180 63.5\n0 0 1\n";
    std::fs::write(folder.join("camera-intrinsics.txt"), camera).unwrap();
}

/// A small network that learns from the depth of `folder`, and its samples.
fn learning(folder: &Path, steps: usize) -> (TrainConfig, SampleSet, SampleSet) {
    let mut config = small_without_data(steps);
    config.data.learn = Learn::Depth;
    config.learning_rate_warmup_steps = 0;
    config.validate_every = steps;
    let datasets = Dataset::open(folder, &OpenOptions::default()).unwrap();
    let (train, validation, skipped) = SampleSet::split(&config, datasets, None).unwrap();
    assert!(skipped.is_empty(), "{skipped:?}");
    (config, train, validation)
}

fn values(plane: &Tensor<4>) -> Vec<f32> {
    plane.clone().into_data().iter().collect()
}

/// Every pixel has the depth of the depth image at its centre, in metres. A hole is neither known nor far.
#[test]
fn depth_images_are_read_in_metres_and_holes_are_not_sky() {
    let folder = tempfile::tempdir().unwrap();
    write_folder(folder.path(), [1, 1]);
    let (config, train, validation) = learning(folder.path(), 1);
    assert!(
        train.samples.is_empty(),
        "without speeds there are no samples of video"
    );
    assert_eq!((train.depth.len(), validation.depth.len()), (5, 1));
    let loader = DepthLoader::validation(&config, train.depth);
    let batch = loader.next(&Device::flex()).unwrap().unwrap();
    let (width, height) = (config.size.width, config.size.height);
    assert_eq!(batch.truth.known.dims(), [2, 1, height, width]);
    let (known, far) = (values(&batch.truth.known), values(&batch.truth.far));
    let logs = values(&batch.truth.log_depth);
    assert!(far.iter().all(|far| *far == 0.0), "there is no sky");
    let mut holes = 0;
    for (i, (known, log)) in known.iter().zip(&logs).enumerate() {
        let (u, v) = (i % width, i / width % height);
        let mm = depth_mm(2 * u as u32 + 1, 2 * v as u32 + 1);
        if matches!(mm, 0 | 65_535) {
            assert_eq!(*known, 0.0, "{u}, {v}");
            holes += 1;
        } else {
            assert_eq!(*known, 1.0, "{u}, {v}");
            let metres = f32::from(mm) / 1000.0;
            assert!((log.exp() / metres - 1.0).abs() < 1e-5, "{u}, {v}: {log}");
        }
    }
    assert_eq!(holes, 2 * 2 * 48 * 20, "both corners of both images");
}

/// Twenty steps lower the error of the wall's depth by more than a tenth.
#[test]
fn a_network_learns_from_depth_images_without_a_speed() {
    let folder = tempfile::tempdir().unwrap();
    write_folder(folder.path(), [1, 1]);
    let (config, train, validation) = learning(folder.path(), 20);
    let run = RunFolder::create(&folder.path().join("run")).unwrap();
    let sets = (train, validation);
    let mut trainer = Trainer::create(config, run, sets, &Device::flex(), Ok).unwrap();
    let mut steps: Vec<LossTerms> = Vec::new();
    let mut listen = |event| {
        match event {
            TrainEvent::Step { losses, .. } => steps.push(losses),
            TrainEvent::Warning { warning, .. } => panic!("{warning}"),
            _ => {}
        }
        Control::Continue
    };
    trainer.run(&mut listen).unwrap();
    assert_eq!(steps.len(), 20);
    let depth_alone = |l: &LossTerms| l.reprojection == 0.0 && l.speed == 0.0 && l.depth == l.total;
    assert!(steps.iter().all(depth_alone));
    let mean = |part: &[LossTerms]| part.iter().map(|l| l.depth).sum::<f64>() / part.len() as f64;
    let (first, last) = (mean(&steps[..4]), mean(&steps[16..]));
    assert!(last < 0.9 * first, "{first} to {last}");
}

/// A depth sensor with fewer pixels, as in a phone: each of its pixels covers four of the colour image.
#[test]
fn depth_images_may_have_fewer_pixels_than_the_colour() {
    let folder = tempfile::tempdir().unwrap();
    write_folder(folder.path(), [2, 2]);
    let (config, train, _) = learning(folder.path(), 1);
    let loader = DepthLoader::validation(&config, train.depth);
    let batch = loader.next(&Device::flex()).unwrap().unwrap();
    let width = config.size.width;
    let (known, logs) = (values(&batch.truth.known), values(&batch.truth.log_depth));
    for (i, (known, log)) in known.iter().zip(&logs).enumerate() {
        let (u, v) = (i % width, i / width % config.size.height);
        let mm = depth_mm(2 * u as u32, 2 * v as u32);
        if matches!(mm, 0 | 65_535) {
            assert_eq!(*known, 0.0, "{u}, {v}");
        } else {
            let metres = f32::from(mm) / 1000.0;
            assert!((log.exp() / metres - 1.0).abs() < 1e-5, "{u}, {v}: {log}");
        }
    }
}

/// Depth images with another aspect ratio than the colour images are refused with both sizes, since their alignment is not known.
#[test]
fn depth_images_of_another_shape_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_folder(folder.path(), [2, 1]);
    let (config, train, _) = learning(folder.path(), 1);
    let loader = DepthLoader::training(&config, train.depth, 0);
    let error = loader.next(&Device::flex()).unwrap().unwrap_err();
    assert!(matches!(error, Error::Data(_)), "{error}");
    let text = error.to_string();
    assert!(
        text.contains("96x128") && text.contains("192x128"),
        "{text}"
    );
}
