//! The other camera's view: its pose, its content, and what is refused.

use std::ops::ControlFlow;
use std::path::Path;

use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_data::{Camera, Cameras, Dataset, OpenOptions, Split};
use deepfusion_sim::{SimConfig, Simulation, write_kitti};
use deepfusion_train::{
    BatchLoader, Error, Model, NoStereo, Preset, Reprojection, SampleSet, Schedule, TrainConfig,
    synthesise,
};

const BASELINE_M: f64 = 0.5;

/// A drive with two cameras.
fn street() -> Simulation {
    Simulation::new(&SimConfig {
        seed: 5,
        frames: 5,
        width: 192,
        height: 96,
        scan_every: 0,
        stereo_baseline_m: BASELINE_M,
        ..SimConfig::default()
    })
    .unwrap()
}

fn opened(drive: &Path, camera: Cameras) -> Vec<Dataset> {
    let options = OpenOptions {
        camera,
        ..OpenOptions::default()
    };
    Dataset::open(drive, &options).unwrap()
}

fn settings() -> TrainConfig {
    let mut config = Preset::Tiny.config();
    (config.size.width, config.size.height) = (192, 96);
    (config.batch, config.validation_share) = (2, 0.0);
    (config.stereo, config.reprojection) = (true, Reprojection::Minimum);
    config.augmentation.jitter = 0.0;
    config
}

fn samples(config: &TrainConfig, drive: &Path, camera: Cameras) -> Result<SampleSet, Error> {
    Ok(SampleSet::split(config, opened(drive, camera), None)?.0)
}

/// A split may hold out a moment of one camera and train on the same moment of the other. The held-out image must not be the other's second
/// view.
#[test]
fn a_held_out_target_is_not_a_view_in_training() {
    let folder = tempfile::tempdir().unwrap();
    let street = Simulation::new(&SimConfig {
        seed: 5,
        frames: 10,
        width: 96,
        height: 64,
        scan_every: 0,
        stereo_baseline_m: BASELINE_M,
        ..SimConfig::default()
    })
    .unwrap();
    let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
    let drive = write_kitti(&street, &folder.path().join("sim"), &mut go_on).unwrap();
    let name = opened(&drive, Cameras::Both)[0].split_name().to_owned();
    let mut lines: Vec<String> = (0..9).map(|i| format!("{name} {i} l")).collect();
    lines.extend((0..5).map(|i| format!("{name} {i} r")));
    let file = folder.path().join("split.txt");
    std::fs::write(&file, lines.join("\n")).unwrap();
    let options = OpenOptions {
        camera: Cameras::Both,
        split: Some(Split::read(&file).unwrap()),
        ..OpenOptions::default()
    };
    let datasets = Dataset::open(&drive, &options).unwrap();
    let mut config = settings();
    config.validation_share = 0.3;
    let (train, held, _) = SampleSet::split(&config, datasets, None).unwrap();
    let of = |set: &SampleSet| -> Vec<(Camera, u64)> {
        let place = |sample: &deepfusion_train::Sample| {
            let dataset = &set.datasets[sample.dataset];
            let frame = &dataset.frames()[sample.snippet.target];
            (dataset.camera(), frame.number)
        };
        set.samples.iter().map(place).collect()
    };
    let each = |camera: Camera, numbers: &[u64]| -> Vec<(Camera, u64)> {
        numbers.iter().map(|number| (camera, *number)).collect()
    };
    let (left, right) = (Camera::Left, Camera::Right);
    assert_eq!(
        of(&held),
        [each(left, &[6, 7, 8]), each(right, &[3, 4])].concat()
    );
    // The left camera's frames 3 and 4 would have the right one's as second views.
    assert_eq!(
        of(&train),
        [each(left, &[0, 1, 2]), each(right, &[0, 1])].concat()
    );
}

/// Each camera's frame is explained by the other's, warped with exact depth and the calibrated baseline, and with no other baseline;
/// mirrored or not.
#[test]
fn the_other_cameras_view_fits_depth_and_baseline() {
    let folder = tempfile::tempdir().unwrap();
    let street = street();
    let drive = write_kitti(
        &street,
        folder.path(),
        &mut |_, _| ControlFlow::Continue(()),
    )
    .unwrap();
    let config = settings();
    let set = samples(&config, &drive, Cameras::Both).unwrap();
    assert_eq!(set.samples.len(), 8, "four pairs of each camera");
    for sample in &set.samples {
        let view = sample.stereo.as_ref().unwrap();
        let t = view.source_from_target.translation();
        let to_the_right = set.datasets[sample.dataset].camera() == deepfusion_data::Camera::Left;
        let expected = if to_the_right {
            -BASELINE_M
        } else {
            BASELINE_M
        };
        assert!((t.x - expected).abs() < 1e-6 && t.yz().norm() < 1e-6, "{t}");
        assert_ne!(view.dataset, sample.dataset);
        let number = |dataset: usize, frame: usize| set.datasets[dataset].frames()[frame].number;
        assert_eq!(
            number(view.dataset, view.frame),
            number(sample.dataset, sample.snippet.target)
        );
    }

    let device = Device::flex();
    let loader = BatchLoader::training(&config, set, 0);
    let mut mirrored = [0, 0];
    for _ in 0..8 {
        let batch = loader.next(&device).unwrap().unwrap();
        assert_eq!((batch.clean.len(), batch.measured.len()), (3, 2));
        assert_eq!((batch.offsets.len(), batch.distance_m.len()), (1, 1));
        for (i, name) in batch.names.iter().enumerate() {
            let image: Vec<f32> = values(batch.clean[0].clone().narrow(0, i, 1));
            let (depth, flip) = depth_of(&street, name, &image);
            mirrored[usize::from(flip)] += 1;
            let error = |scale: f32| {
                let inverse: Vec<f32> = depth
                    .iter()
                    .map(|z| if *z > 0.0 { scale / z } else { 1e-4 })
                    .collect();
                let inverse = Tensor::from_data(TensorData::new(inverse, [1, 1, 96, 192]), &device);
                let seen = synthesise(
                    batch.clean[2].clone().narrow(0, i, 1),
                    inverse,
                    &batch.measured[1].narrow(i, 1),
                    &batch.intrinsics.clone().narrow(0, i, 1),
                    &batch.inverse_intrinsics.clone().narrow(0, i, 1),
                );
                let warped = values(seen.image);
                let apart = warped.iter().zip(&image).map(|(a, b)| (a - b).abs());
                apart.sum::<f32>() / image.len() as f32
            };
            let [right, too_far, too_near] = [1.0, 0.8, 1.25].map(error);
            assert!(
                right < 0.75 * too_far.min(too_near),
                "{right} {too_far} {too_near}"
            );
        }
    }
    assert!(mirrored.iter().all(|n| *n > 0), "{mirrored:?}");
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().unwrap()
}

/// The exact depth of an image, which may be of either camera and mirrored; and whether it is mirrored.
fn depth_of(street: &Simulation, name: &str, image: &[f32]) -> (Vec<f32>, bool) {
    let index: usize = name.rsplit('/').next().unwrap().parse().unwrap();
    let mut found: Option<(f32, Vec<f32>, bool)> = None;
    for frame in [street.frame(index), street.right_frame(index)] {
        for flip in [false, true] {
            let mut red: Vec<f32> = frame
                .rgb
                .pixels()
                .map(|p| f32::from(p[0]) / 255.0)
                .collect();
            let mut depth = frame.depth.data.clone();
            if flip {
                red.chunks_exact_mut(192).for_each(<[f32]>::reverse);
                depth.chunks_exact_mut(192).for_each(<[f32]>::reverse);
            }
            let apart: f32 = red.iter().zip(image).map(|(a, b)| (a - b).abs()).sum();
            if found.as_ref().is_none_or(|(least, ..)| apart < *least) {
                found = Some((apart, depth, flip));
            }
        }
    }
    let (apart, depth, flip) = found.unwrap();
    assert!(apart < 1.0, "not an image of the street: {apart}");
    (depth, flip)
}

/// The baseline is used only for warping. PoseNet sees the pair in time, and its loss and the scale ratio depend on that pair alone.
#[test]
fn posenet_does_not_predict_the_other_cameras_pose() {
    let folder = tempfile::tempdir().unwrap();
    let drive = write_kitti(&street(), folder.path(), &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let device = Device::flex();
    let mut config = settings();
    config.pose_net.metres_per_unit = 1.0;
    let set = samples(&config, &drive, Cameras::Both).unwrap();
    let batch = BatchLoader::training(&config, set, 0)
        .next(&device)
        .unwrap()
        .unwrap();
    let learning = device.autodiff();
    let model = Model::new(&config, &learning).unwrap().valid(&learning);
    let pass = model.forward(&batch);
    assert_eq!((pass.motions.len(), pass.sources.len()), (2, 2));
    let baseline: Vec<f32> = values(pass.motions[1].distance());
    assert!(
        baseline
            .iter()
            .all(|b| (b - BASELINE_M as f32).abs() < 1e-4),
        "{baseline:?}"
    );
    let schedule = Schedule {
        speed_weight: 1.0,
        masks_active: false,
    };
    let with = model.loss(&pass, &batch, schedule);
    // Without the other camera's view the loss of PoseNet's motion is the same, but the photometric loss differs.
    let mut alone = batch.clone();
    alone.clean.pop();
    alone.network.pop();
    alone.measured.pop();
    let without = model.loss(&model.forward(&alone), &alone, schedule);
    assert_eq!(with.terms.speed, without.terms.speed);
    assert_ne!(with.terms.reprojection, without.terms.reprojection);
}

/// One of two drives has only one camera. It learns from its own frames, as without stereo, while the other uses both cameras.
#[test]
fn a_drive_with_one_camera_learns_beside_one_with_two() {
    let folder = tempfile::tempdir().unwrap();
    let two = write_kitti(&street(), folder.path(), &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let alone = folder.path().join("alone");
    let one = write_kitti(&street(), &alone, &mut |_, _| ControlFlow::Continue(())).unwrap();
    std::fs::remove_dir_all(one.join("image_03")).unwrap();
    let mut config = settings();
    (config.batch, config.loss.automask) = (12, true);
    config.pose_net.metres_per_unit = 1.0;
    let mut drives = opened(&two, Cameras::Both);
    drives.extend(opened(&one, Cameras::Both));
    let (set, ..) = SampleSet::split(&config, drives, None).unwrap();
    let paired = set.samples.iter().filter(|s| s.stereo.is_some()).count();
    assert_eq!((set.samples.len(), paired), (12, 8));

    // Such a drive alone is enough for validation, but not for training.
    let (two, one) = (opened(&two, Cameras::Both), opened(&one, Cameras::Both));
    let (_, held_out, _) =
        SampleSet::split(&config, two.clone(), Some(one.clone())).unwrap_or_else(|e| panic!("{e}"));
    assert!(
        held_out
            .samples
            .iter()
            .all(|sample| sample.stereo.is_none())
    );
    assert!(SampleSet::split(&config, one, Some(two)).is_err());

    let device = Device::flex();
    let batch = BatchLoader::training(&config, set, 0)
        .next(&device)
        .unwrap()
        .unwrap();
    assert_eq!((batch.clean.len(), batch.measured.len()), (3, 2));
    let there: Vec<f32> = values(batch.other_camera.clone().unwrap());
    assert_eq!(there.iter().sum::<f32>(), 8.0);
    let learning = device.autodiff();
    let model = Model::new(&config, &learning).unwrap().valid(&learning);
    let schedule = Schedule {
        speed_weight: 1.0,
        masks_active: false,
    };
    let errors = |batch: &deepfusion_train::SnippetBatch| {
        let loss = model.loss(&model.forward(batch), batch, schedule);
        values(loss.finest.error)
    };
    let both = errors(&batch);
    let mut in_time = batch.clone();
    in_time.clean.pop();
    in_time.network.pop();
    in_time.measured.pop();
    in_time.other_camera = None;
    let in_time = errors(&in_time);
    for (sample, there) in there.iter().enumerate() {
        let pixels = sample * 192 * 96..(sample + 1) * 192 * 96;
        let same = both[pixels.clone()] == in_time[pixels];
        assert_eq!(same, *there == 0.0, "sample {sample}");
    }
}

#[test]
fn drives_without_a_usable_second_camera_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let drive = write_kitti(&street(), folder.path(), &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let why = |camera| match samples(&settings(), &drive, camera) {
        Err(Error::NoStereo { why, .. }) => why,
        other => panic!("{other:?}"),
    };
    assert_eq!(why(Cameras::Left), NoStereo::OneCamera);
    // A drive whose second camera has no frame of the same moment.
    for entry in std::fs::read_dir(drive.join("image_03/data")).unwrap() {
        let path = entry.unwrap().path();
        if !path.ends_with("0000000004.png") {
            std::fs::remove_file(path).unwrap();
        }
    }
    assert_eq!(why(Cameras::Both), NoStereo::NoCommonFrame);
    let mut both_ways = settings();
    both_ways.reprojection = Reprojection::Bidirectional;
    let error = both_ways.validate().unwrap_err().to_string();
    assert!(
        error.contains("reprojection") && error.contains("stereo"),
        "{error}"
    );
}
