//! A recording in a layout of your own, opened as a [`Dataset`]: here, images named by their times in milliseconds
//! (`0.png`, `100.png`, …) and a vehicle that drove straight on at a known speed.
//!
//! ```text
//! cargo run --release --example own_layout -- FOLDER SPEED_MPS
//! ```

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result};
use deepfusion::data::{self, CalibrationPlace, Camera, Dataset, DatasetKind, DatasetParts, Frame};
use deepfusion::data::{FrameImage, MotionModel, Recording, RgbImage, Stream, VehicleTrack};
use deepfusion::geometry::{Intrinsics, Se3};

/// What all layouts share lies in the dataset; this is the rest, read when it is asked for.
#[derive(Debug)]
struct NamedByTime(PathBuf);

impl Recording for NamedByTime {
    fn kind(&self) -> DatasetKind {
        DatasetKind::Other
    }
    fn folder(&self) -> &Path {
        &self.0
    }
    fn load_image(&self, frame: &Frame) -> data::Result<RgbImage> {
        data::load_rgb(frame.image.path())
    }
    fn calibration(&self) -> CalibrationPlace {
        CalibrationPlace {
            file: self.0.clone(),
            field: "the lens, taken for 90 degrees wide",
        }
    }
    fn streams(&self) -> data::Result<Vec<Stream>> {
        Ok(Vec::new())
    }
    fn no_motion(&self) -> data::Error {
        let (path, what) = (self.0.clone(), "images named by their times");
        data::Error::Missing {
            path,
            what,
            remedy: "name them 0.png, 100.png, …",
        }
    }
}

fn main() -> Result<()> {
    let usage = "usage: own_layout FOLDER SPEED_MPS";
    let folder = PathBuf::from(std::env::args().nth(1).context(usage)?);
    let speed: f64 = std::env::args().nth(2).context(usage)?.parse()?;
    let mut images = Vec::new();
    for entry in std::fs::read_dir(&folder)? {
        let path = entry?.path();
        let time = path
            .file_stem()
            .and_then(|name| name.to_str()?.parse::<u64>().ok());
        images.extend(time.map(|time| (time, path)));
    }
    images.sort();
    let (_, first) = images.first().context("no image is named by its time")?;
    let (width, height) = data::image_size(first)?;
    let track: Vec<_> = images
        .iter()
        .map(|(ms, _)| (*ms as f64 / 1e3, speed, 0.0))
        .collect();
    let frames = images
        .into_iter()
        .enumerate()
        .map(|(number, (ms, path))| Frame {
            drive: "own".into(),
            number: number as u64,
            time_s: Some(ms as f64 / 1e3),
            image: FrameImage::File(path),
            speed_mps: Some(speed),
        });
    // The vehicle's axes are x ahead, y to the left, z up; the camera's x to the right, y down, z ahead.
    let here = Se3::identity().translation();
    let looks_ahead = Se3::from_quaternion([0.5, 0.5, -0.5, 0.5], here);
    let parts = DatasetParts {
        name: "own".into(),
        split_name: "own".into(),
        camera: Camera::Left,
        frames: frames.collect(),
        intrinsics: Intrinsics::centred(f64::from(width) / 2.0, (width, height)),
        cam_from_vehicle: Some(looks_ahead),
        track: Some(MotionModel::Track(Box::new(VehicleTrack::new(&track)))),
        yaw_known: true,
        origin_ns: None,
        camera_ahead_s: 0.0,
        scenario: None,
    };
    let dataset = Dataset::new(parts, Arc::new(NamedByTime(folder)));
    println!(
        "{} frames, {} pairs to learn from",
        dataset.frames().len(),
        dataset.snippets(&[1], 0.5)?.len()
    );
    Ok(())
}
