//! Two data sets in one run, with different cameras, speeds and depth ranges, each with its own metres per unit.

use burn::tensor::{Device, Tensor};
use deepfusion_data::{Dataset, OpenOptions, RgbImage, load_rgb, save_png};
use deepfusion_geometry::DepthRange;
use deepfusion_sim::{SimConfig, Simulation, write_kitti};
use deepfusion_train::{
    BatchLoader, Control, DataSetConfig, Model, Preset, RunFolder, SampleSet, SnippetBatch,
    TrainConfig, TrainEvent, Trainer,
};
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

const GARAGE: DepthRange = DepthRange {
    min_m: 0.2,
    max_m: 40.0,
};

fn drive(folder: &Path, seed: u64, fps: f64) -> PathBuf {
    let config = SimConfig {
        seed,
        fps,
        frames: 16,
        width: 320,
        height: 96,
        scan_every: 0,
        ..SimConfig::default()
    };
    write_kitti(&Simulation::new(&config).unwrap(), folder, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap()
}

/// Crops a drive's images to their middle, half as wide and half as high: at the network's input size, a camera with twice the focal length.
fn zoom(drive: &Path) {
    for entry in fs::read_dir(drive.join("image_02/data")).unwrap() {
        let path = entry.unwrap().path();
        let image = load_rgb(&path).unwrap();
        let middle = RgbImage::from_fn(160, 48, |x, y| *image.get_pixel(x + 80, y + 24));
        save_png(&middle, &path).unwrap();
    }
    let path = drive.parent().unwrap().join("calib_cam_to_cam.txt");
    let shifted = |line: &str| -> String {
        let Some((field, numbers)) = line.split_once(": ") else {
            return line.to_owned();
        };
        let mut values: Vec<f64> = numbers.split(' ').filter_map(|v| v.parse().ok()).collect();
        match field {
            "S_rect_02" => values = vec![160.0, 48.0],
            "P_rect_02" => {
                values[2] -= 80.0;
                values[6] -= 24.0;
            }
            _ => return line.to_owned(),
        }
        let words: Vec<String> = values.iter().map(f64::to_string).collect();
        format!("{field}: {}", words.join(" "))
    };
    let text = fs::read_to_string(&path).unwrap();
    let lines: Vec<String> = text.lines().map(shifted).collect();
    fs::write(&path, lines.join("\n") + "\n").unwrap();
}

struct Both {
    _folder: tempfile::TempDir,
    drives: [PathBuf; 2],
}

/// A road at 10 frames per second, and another drive with a zoomed camera at 30: a third of the distance per pair.
fn both() -> Both {
    let folder = tempfile::tempdir().unwrap();
    let drives = [
        drive(&folder.path().join("road"), 5, 10.0),
        drive(&folder.path().join("garage"), 6, 30.0),
    ];
    zoom(&drives[1]);
    Both {
        _folder: folder,
        drives,
    }
}

fn config(drives: &[PathBuf; 2]) -> TrainConfig {
    let mut config = Preset::Tiny.config();
    (config.size.width, config.size.height) = (96, 64);
    config.batch = 4;
    config.steps = Some(12);
    config.validate_every = 100;
    config.depth_net.encoder = config.depth_net.encoder.with_base_width(8);
    config.depth_net.decoder.widths = [16, 16, 8, 8, 8];
    config.pose_net.encoder = config.pose_net.encoder.with_base_width(8);
    let set = |name: &str, drive: &PathBuf, range| DataSetConfig {
        name: name.into(),
        paths: vec![drive.clone()],
        range,
        ..DataSetConfig::default()
    };
    config.data.sets = vec![
        set("road", &drives[0], None),
        set("garage", &drives[1], Some(GARAGE)),
    ];
    config.validate().unwrap();
    config
}

fn samples(config: &TrainConfig, drives: &[PathBuf; 2]) -> (SampleSet, SampleSet) {
    let open = |drive: &PathBuf| {
        Dataset::open(drive, &OpenOptions::default())
            .unwrap()
            .remove(0)
    };
    let recordings = drives.iter().map(open).enumerate().collect();
    let (train, validation, skipped) = SampleSet::split_sets(config, recordings, None).unwrap();
    assert!(skipped.is_empty(), "{skipped:?}");
    (train, validation)
}

fn created(both: &Both, name: &str) -> Trainer {
    let config = config(&both.drives);
    let samples = samples(&config, &both.drives);
    let folder = RunFolder::create(&both._folder.path().join(name)).unwrap();
    Trainer::create(config, folder, samples, &Device::flex(), Ok).unwrap()
}

fn batches(config: &TrainConfig, set: SampleSet) -> Vec<SnippetBatch> {
    let device = Device::flex();
    let loader = BatchLoader::validation(config, set);
    std::iter::from_fn(|| loader.next(&device))
        .map(Result::unwrap)
        .collect()
}

fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
    tensor.into_data().iter::<f64>().collect()
}

/// Mean measured over mean predicted displacement of one set's samples.
fn scale_ratio(model: &Model, config: &TrainConfig, set: SampleSet) -> f64 {
    let (mut measured, mut predicted) = (0.0, 0.0);
    for batch in batches(config, set) {
        let pass = model.forward(&batch);
        let distances = numbers(pass.motions[0].distance());
        predicted += distances[..batch.len()].iter().sum::<f64>();
        measured += numbers(batch.distance_m[0].clone()).iter().sum::<f64>();
    }
    measured / predicted
}

/// A network for two focal lengths predicts metres for one of them, and depth of the other is scaled to it. Otherwise the same pixels would
/// have to be near for one camera and far for the other.
#[test]
fn depth_of_one_set_is_scaled_to_one_focal_length() {
    let both = both();
    let with = |drives: &[PathBuf; 2], name: &str| {
        let mut config = config(&both.drives);
        config.data.sets.clear();
        let open = |drive: &PathBuf| {
            let opened = Dataset::open(drive, &OpenOptions::default());
            (0, opened.unwrap().remove(0))
        };
        let recordings = drives.iter().map(open).collect();
        let (train, held, _) = SampleSet::split_sets(&config, recordings, None).unwrap();
        let folder = RunFolder::create(&both._folder.path().join(name)).unwrap();
        Trainer::create(config, folder, (train, held), &Device::flex(), Ok).unwrap()
    };
    let [road, zoomed] = &both.drives;
    let alike = with(&[road.clone(), road.clone()], "alike");
    assert_eq!(alike.config().canonical_focal_px, None);
    let differ = with(&[road.clone(), zoomed.clone()], "differ");
    let first = Dataset::open(road, &OpenOptions::default())
        .unwrap()
        .remove(0);
    let fy = first.intrinsics(0).resized(96, 64).fy;
    assert_eq!(differ.config().canonical_focal_px, Some(fy));
    // Predictions with the run use its camera, which has that focal length.
    let (folder, _) = RunFolder::open(differ.folder()).unwrap();
    assert_eq!(folder.read_config().unwrap().canonical_focal_px, None);
    let findings = folder.read_findings().unwrap();
    assert_eq!(findings.focal_px, Some(fy));
    assert_eq!(findings.camera, Some(first.intrinsics(0)));
    let focal = |dataset: &Dataset| {
        let camera = dataset.intrinsics(0);
        differ
            .config()
            .sample_factors(0, &camera, differ.config().size)
            .focal
    };
    let second = Dataset::open(zoomed, &OpenOptions::default())
        .unwrap()
        .remove(0);
    assert!((focal(&first) - 1.0).abs() < 1e-9);
    assert!((focal(&second) - 2.0).abs() < 1e-6);
}

/// The factors are found in the data, set by set, and each sample of a batch gets those of its set and camera.
#[test]
fn every_sample_has_its_own_camera_range_and_unit() {
    let both = both();
    let trainer = created(&both, "run");
    let config = trainer.config();
    let (train, validation) = samples(config, &both.drives);
    let [road, garage] = [0, 1].map(|set| &config.data.sets[set]);
    for (i, set) in [road, garage].into_iter().enumerate() {
        let mean = train.of_set(i).mean_displacement_m();
        assert!((set.metres_per_unit - mean).abs() < 1e-12);
    }
    let ratio = road.metres_per_unit / garage.metres_per_unit;
    assert!(ratio > 1.5, "{ratio}");
    let (folder, _) = RunFolder::open(trainer.folder()).unwrap();
    let found = folder.read_findings().unwrap().sets;
    let [k_road, k_garage] = [0, 1].map(|set: usize| found[set].camera.unwrap().resized(96, 64));
    // The file has the settings, and separately what was found.
    let set = folder.read_settings().unwrap();
    assert!(set.data.sets.iter().all(|set| set.metres_per_unit == 0.0));
    assert_eq!(folder.read_config().unwrap(), *config);
    assert!((k_garage.fx / k_road.fx - 2.0).abs() < 1e-6);
    assert!(validation.samples.iter().any(|s| s.dataset == 0));

    // Batches of four with samples of both sets.
    let mut mixed = train.clone();
    mixed.samples = (0..4)
        .flat_map(|i| [0, 1].map(|set| train.of_set(set).samples[i].clone()))
        .collect();
    let mut seen = 0;
    for batch in batches(config, mixed.clone()) {
        let factors = batch.factors.as_ref().unwrap();
        let (k, span) = (
            numbers(batch.intrinsics.clone()),
            numbers(factors.span.clone()),
        );
        let unit = numbers(factors.translation.clone());
        for i in 0..batch.len() {
            let set = mixed.set_of[mixed.samples[seen].dataset];
            let (own_k, range) = [(k_road, config.depth_net.range), (k_garage, GARAGE)][set];
            assert!((k[9 * i] / own_k.fx - 1.0).abs() < 1e-5);
            let own_span = 1.0 / range.min_m - 1.0 / range.max_m;
            assert!((span[i] / own_span - 1.0).abs() < 1e-6);
            let own_unit = config.data.sets[set].metres_per_unit / config.pose_net.metres_per_unit;
            assert!((unit[i] / own_unit - 1.0).abs() < 1e-6);
            seen += 1;
        }
    }
    assert_eq!(seen, 8);
}

/// PoseNet starts with one unit ahead (`start_moving`), which is each set's own displacement. Without the factors, one of the two sets
/// would be off by their ratio at the start and for a long time. A short training keeps both near 1.
#[test]
fn both_scale_ratios_are_near_one() {
    let both = both();
    let mut trainer = created(&both, "run");
    let config = trainer.config().clone();
    assert!(config.start_moving);
    let (train, _) = samples(&config, &both.drives);
    let near = |trainer: &Trainer, when: &str| {
        for set in 0..2 {
            let ratio = scale_ratio(trainer.model(), &config, train.of_set(set));
            eprintln!("{when}, {}: {ratio:.3}", config.data.sets[set].name);
            assert!((0.7..1.4).contains(&ratio), "{when}, set {set}: {ratio}");
        }
    };
    near(&trainer, "at the start");
    // The same network with one unit for both sets.
    let mut pooled = config.clone();
    pooled.data.sets.clear();
    let device = Device::flex().autodiff();
    let model = Model::new(&pooled, &device).unwrap();
    let ratios = [0, 1].map(|set| scale_ratio(&model, &pooled, train.of_set(set)));
    assert!(ratios[0] / ratios[1] > 1.5, "{ratios:?}");

    let mut finite = true;
    trainer
        .run(&mut |event| {
            if let TrainEvent::Step { losses, .. } = event {
                finite &= losses.total.is_finite();
            }
            Control::Continue
        })
        .unwrap();
    assert!(finite);
    near(&trainer, "after 12 steps");
}

/// A set without usable samples is an error that names it; it is not silently left out.
#[test]
fn a_set_without_samples_is_an_error() {
    let both = both();
    fs::remove_dir_all(both.drives[1].join("oxts")).unwrap();
    let config = config(&both.drives);
    let open = |drive: &PathBuf| {
        Dataset::open(drive, &OpenOptions::default())
            .unwrap()
            .remove(0)
    };
    let recordings = both.drives.iter().map(open).enumerate().collect();
    let error = SampleSet::split_sets(&config, recordings, None).unwrap_err();
    let message = error.to_string();
    assert!(message.contains("data set garage"), "{message}");
    assert!(message.contains("oxts"), "{message}");
}
