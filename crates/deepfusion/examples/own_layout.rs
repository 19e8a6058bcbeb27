//! A layout of your own, opened as a [`Dataset`]: images named by their times in milliseconds (`0.png`, `100.png`, …), of a
//! vehicle at a known speed: `cargo run --release --example own_layout -- FOLDER SPEED_MPS`
use anyhow::{Context, Result};
use deepfusion::data::{self, DataWarning, Dataset, DatasetParts, Frame, FrameImage, Recording};
use deepfusion::geometry::Intrinsics;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The part of a recording that depends on the layout and is read on demand. It can also provide more, such as ground truth.
#[derive(Debug)]
struct NamedByTime {
    folder: PathBuf,
    warnings: Vec<DataWarning>,
}

impl Recording for NamedByTime {
    fn folder(&self) -> &Path {
        &self.folder
    }
    fn warnings(&self) -> &[DataWarning] {
        &self.warnings
    }
    fn load_image(&self, frame: &Frame) -> data::Result<data::RgbImage> {
        Ok(data::load_rgb(frame.image.path())?)
    }
}

fn main() -> Result<()> {
    let usage = "usage: own_layout FOLDER SPEED_MPS";
    let folder = PathBuf::from(std::env::args().nth(1).context(usage)?);
    let speed: f64 = std::env::args().nth(2).context(usage)?.parse()?;
    let mut images = Vec::new();
    for entry in std::fs::read_dir(&folder)? {
        let path = entry?.path();
        let name = path.file_stem().and_then(|name| name.to_str());
        let ms = name.and_then(|name| name.parse::<u64>().ok());
        images.extend(ms.map(|ms| (ms, path)));
    }
    images.sort();
    let (_, first) = images.first().context("no image is named by its time")?;
    let size = data::image_size(first)?;
    let camera = Intrinsics::centred(f64::from(size.0) / 2.0, size);
    let assumed = "a field of view of 90 degrees is assumed for the camera";
    let warnings = vec![DataWarning::Other(assumed.into())];
    let frame = |(number, (ms, path)): (usize, (u64, PathBuf))| Frame {
        drive: "own".into(),
        number: number as u64,
        time_s: Some(ms as f64 / 1e3),
        image: FrameImage::File(path),
        speed_mps: Some(speed),
    };
    let frames = images.into_iter().enumerate().map(frame).collect();
    let parts = DatasetParts::of_frames("own", frames, camera);
    let dataset = Dataset::new(parts, Arc::new(NamedByTime { folder, warnings }));
    println!("warnings: {:?}", dataset.warnings());
    let (frames, pairs) = (dataset.frames().len(), dataset.snippets(&[1], 0.5)?.len());
    println!("{frames} frames, {pairs} pairs to train on");
    Ok(())
}
