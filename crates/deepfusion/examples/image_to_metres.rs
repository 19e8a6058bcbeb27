//! Predicts depth in metres from a photo, and writes a picture of it and its point cloud.
//!
//! ```text
//! cargo run --release --example image_to_metres -- PHOTO [NETWORK]
//! ```

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;

use anyhow::{Context, Result};
use deepfusion::DepthEstimator;
use deepfusion::data::{load_photo, save_png};
use deepfusion::geometry::cloud::PointCloud;
use deepfusion::render::{DepthScale, depth_picture};

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let photo = PathBuf::from(arguments.next().context("usage: image_to_metres PHOTO")?);
    let network = arguments.next().unwrap_or_else(|| "street".into());

    // The lens is known if the photo's EXIF data has it; otherwise the metres are a guess.
    let seen = load_photo(&photo)?;
    if seen.intrinsics.is_none() {
        eprintln!("no focal length in the photo's EXIF: the metres are a guess");
    }
    let mut estimator = DepthEstimator::load(network)?;
    let prediction = estimator.estimate(&seen.image, seen.intrinsics.as_ref())?;
    let depth = prediction.depth();

    let known = depth.data.iter().copied().filter(|metres| *metres > 0.0);
    let nearest = known.fold(f32::INFINITY, f32::min);
    println!("{}x{}: nearest {nearest:.1} m", depth.width, depth.height);

    let picture = photo.with_extension("depth.png");
    save_png(&depth_picture(&depth, &DepthScale::default()), &picture)?;
    println!("{}", picture.display());
    if let Some(camera) = &seen.intrinsics {
        let cloud = PointCloud::from_depth(&depth, camera, Some(&seen.image), 80.0)?;
        let file = photo.with_extension("ply");
        cloud.write_ply(BufWriter::new(File::create(&file)?))?;
        println!("{}", file.display());
    }
    Ok(())
}
