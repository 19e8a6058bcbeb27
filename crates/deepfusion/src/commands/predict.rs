use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Result;
use deepfusion_cloud::PointCloud;
use deepfusion_data::{Camera, load_rgb, save_png, write_atomically, write_depth_png};
use deepfusion_data::{RgbImage, kitti::Calibration};
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_render::{DepthScale, depth_picture, side_by_side, with_depth_legend};
use deepfusion_train::{Prediction, Predictor};
use serde::Serialize;

use crate::cli::{PredictArgs, Save};
use crate::error::CliError;
use crate::output;
use crate::progress::{Progress, say};

/// The endings of images.
const IMAGES: [&str; 3] = ["png", "jpg", "jpeg"];

/// What stands beside every prediction.
#[derive(Debug, Serialize)]
struct Sidecar {
    image: PathBuf,
    size: [u32; 2],
    unit: &'static str,
    model: PathBuf,
    checkpoint_step: usize,
    intrinsics: Option<[f64; 4]>,
    intrinsics_from: &'static str,
    /// Whether the metres can be trusted: the run learned them, and the camera is known.
    scale_trusted: bool,
    focal_factor: f64,
    /// x, y, width and height of the part that was looked at; depth is 0 outside.
    window: [u32; 4],
    depth_m: [f32; 2],
    files: Vec<PathBuf>,
}

/// `deepfusion predict`.
pub fn run(args: &PredictArgs) -> Result<()> {
    let inputs = find_images(&args.inputs)?;
    let predictor = crate::engine::load(&args.model, &crate::cli::EngineArgs::on(args.device))?;
    std::fs::create_dir_all(&args.out).map_err(|e| deepfusion_data::Error::file(&args.out, e))?;
    let names = output_names(&inputs);
    let mut sidecars = Vec::new();
    let mut progress = Progress::new("predicting");
    let mut assumed = false;
    for (i, (input, name)) in inputs.iter().zip(&names).enumerate() {
        let image = load_rgb(input)?;
        let (camera, from) = camera_of(args, &image, &predictor)?;
        assumed |= from == "assumed";
        let sidecar = predict_one(args, &predictor, input, name, &image, camera, from)?;
        sidecars.push(sidecar);
        progress.set(i + 1, inputs.len());
    }
    drop(progress);
    if assumed {
        tracing::warn!(
            "no intrinsics given: the training camera's field of view is assumed, so the metres are \
             only as right as that is (scale_trusted: false; give --intrinsics or --calib)"
        );
    }
    say(&format!(
        "{} images written to {}",
        sidecars.len(),
        args.out.display()
    ));
    if args.json {
        return output::print_json(&sidecars);
    }
    Ok(())
}

fn predict_one(
    args: &PredictArgs,
    predictor: &Predictor,
    input: &Path,
    name: &str,
    image: &RgbImage,
    camera: Option<Intrinsics>,
    from: &'static str,
) -> Result<Sidecar> {
    let prediction: Prediction = predictor.predict(
        image,
        camera.as_ref(),
        !args.no_focal_correction,
        !args.stretch,
    )?;
    let depth = prediction.depth();
    let scale = DepthScale::default();
    let mut files = Vec::new();
    for save in &args.save {
        let path = args.out.join(format!("{name}{}", ending(*save)));
        if path.exists() && !args.overwrite {
            return Err(CliError::Exists {
                path,
                remedy: "allow it with --overwrite, or choose another folder",
            }
            .into());
        }
        match save {
            Save::DepthPng => write_depth_png(&depth, &path)?,
            Save::Npy => write_npy(&depth, &path)?,
            Save::Color => {
                save_png(
                    &with_depth_legend(&depth_picture(&depth, &scale), &scale),
                    &path,
                )?;
            }
            Save::SideBySide => save_png(&side_by_side(image, &depth, &scale)?, &path)?,
            Save::Ply => {
                let k = camera.ok_or(CliError::NoCamera)?;
                let cloud = PointCloud::from_depth(
                    &depth,
                    &k,
                    Some(image.as_raw()),
                    args.max_depth as f32,
                )?;
                write_atomically::<CloudError>(&path, |out| Ok(cloud.write_ply(out)?))
                    .map_err(CloudError::into_inner)?;
            }
        }
        files.push(path);
    }
    let metric = predictor.training_camera().is_some() && predictor.config().loss.speed > 0.0;
    let seen = depth.data.iter().filter(|d| **d > 0.0);
    let sidecar = Sidecar {
        image: input.to_owned(),
        size: [image.width(), image.height()],
        unit: "metres along the camera's axis (z)",
        model: args.model.clone(),
        checkpoint_step: predictor.step,
        intrinsics: camera.map(|k| [k.fx, k.fy, k.cx, k.cy]),
        intrinsics_from: from,
        scale_trusted: metric && from == "given",
        focal_factor: prediction.focal_factor,
        window: prediction.window,
        depth_m: [
            seen.clone().copied().fold(f32::INFINITY, f32::min),
            seen.copied().fold(0.0, f32::max),
        ],
        files,
    };
    let path = args.out.join(format!("{name}.json"));
    let text = serde_json::to_string_pretty(&sidecar)?;
    write_atomically::<deepfusion_data::Error>(&path, |out| {
        writeln!(out, "{text}").map_err(|e| deepfusion_data::Error::file(&path, e))
    })?;
    Ok(sidecar)
}

fn ending(save: Save) -> &'static str {
    match save {
        Save::DepthPng => "_depth.png",
        Save::Npy => "_depth.npy",
        Save::Color => "_color.png",
        Save::SideBySide => "_side.png",
        Save::Ply => ".ply",
    }
}

fn write_npy(depth: &DepthMap, path: &Path) -> Result<()> {
    let view = ndarray::ArrayView2::from_shape((depth.height, depth.width), &depth.data)?;
    let mut bytes = Vec::new();
    ndarray_npy::WriteNpyExt::write_npy(&view, &mut bytes)?;
    write_atomically::<deepfusion_data::Error>(path, |out| {
        out.write_all(&bytes)
            .map_err(|e| deepfusion_data::Error::file(path, e))
    })?;
    Ok(())
}

/// Either crate's error, out of a file being written.
#[derive(Debug, thiserror::Error)]
enum CloudError {
    #[error(transparent)]
    File(#[from] deepfusion_data::Error),
    #[error(transparent)]
    Cloud(#[from] deepfusion_cloud::Error),
}

impl CloudError {
    fn into_inner(self) -> anyhow::Error {
        match self {
            Self::File(error) => error.into(),
            Self::Cloud(error) => error.into(),
        }
    }
}

/// The camera of an input: given, read from a calibration file, or assumed to see what the training
/// camera saw.
fn camera_of(
    args: &PredictArgs,
    image: &RgbImage,
    predictor: &Predictor,
) -> Result<(Option<Intrinsics>, &'static str)> {
    let (width, height) = image.dimensions();
    if let Some(k) = args.intrinsics {
        let k = Intrinsics {
            fx: k.fx,
            fy: k.fy,
            cx: k.cx,
            cy: k.cy,
            width,
            height,
        };
        if let Some(why) = k.implausible() {
            return Err(CliError::Camera { why }.into());
        }
        return Ok((Some(k), "given"));
    }
    if let Some(path) = &args.calib {
        let folder = if path.is_dir() {
            path.as_path()
        } else {
            path.parent().unwrap_or(Path::new("."))
        };
        let k = Calibration::read(folder, Camera::Left)?.intrinsics;
        if (k.width, k.height) != (width, height) {
            let why = format!(
                "the calibration is for {}x{}, the image has {width}x{height}",
                k.width, k.height
            );
            return Err(CliError::Camera { why }.into());
        }
        return Ok((Some(k), "given"));
    }
    let Some(train) = predictor.training_camera() else {
        return Ok((None, "unknown"));
    };
    // The same field of view from left to right, square pixels, the same height of the horizon.
    let f = train.fx * f64::from(width) / f64::from(train.width);
    let centre = |c: f64, from: u32, to: u32| (c + 0.5) * f64::from(to) / f64::from(from) - 0.5;
    let k = Intrinsics {
        fx: f,
        fy: f,
        cx: centre(train.cx, train.width, width),
        cy: centre(train.cy, train.height, height),
        width,
        height,
    };
    Ok((Some(k), "assumed"))
}

/// The images that files, folders and patterns mean, in order.
fn find_images(inputs: &[String]) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for input in inputs {
        let path = PathBuf::from(input);
        if path.is_dir() {
            let entries =
                std::fs::read_dir(&path).map_err(|e| deepfusion_data::Error::file(&path, e))?;
            let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
            found.extend(images_among(paths, input)?);
        } else if path.exists() || !input.contains(['*', '?', '[']) {
            // A file that is not there is told by whoever opens it.
            found.push(path);
        } else {
            found.extend(images_among(
                glob::glob(input)?.filter_map(Result::ok),
                input,
            )?);
        }
    }
    Ok(found)
}

/// The images among the paths, in order; that there is none is an error that names the input.
fn images_among(paths: impl Iterator<Item = PathBuf>, input: &str) -> Result<Vec<PathBuf>> {
    let mut images: Vec<_> = paths.filter(|p| is_image(p)).collect();
    if images.is_empty() {
        let input = input.to_owned();
        return Err(CliError::NoImages { input }.into());
    }
    images.sort();
    Ok(images)
}

fn is_image(path: &Path) -> bool {
    path.extension()
        .and_then(|e| e.to_str())
        .is_some_and(|e| IMAGES.contains(&e.to_ascii_lowercase().as_str()))
}

/// A name for each input's files: its own, numbered where two inputs share one.
fn output_names(inputs: &[PathBuf]) -> Vec<String> {
    let mut used = std::collections::HashMap::<String, usize>::new();
    inputs
        .iter()
        .map(|path| {
            let stem = path
                .file_stem()
                .map_or("image".into(), |s| s.to_string_lossy());
            let count = used.entry(stem.clone().into_owned()).or_insert(0);
            *count += 1;
            if *count == 1 {
                stem.into_owned()
            } else {
                format!("{stem}-{count}")
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_of_the_same_name_do_not_overwrite_each_other() {
        let inputs = ["a/0.png", "b/0.png", "b/1.jpg"].map(PathBuf::from);
        assert_eq!(output_names(&inputs), ["0", "0-2", "1"]);
    }

    #[test]
    fn a_pattern_without_images_is_an_error() {
        let error = find_images(&["/nowhere/*.png".into()]).unwrap_err();
        assert!(error.to_string().contains("/nowhere/*.png"), "{error}");
    }
}
