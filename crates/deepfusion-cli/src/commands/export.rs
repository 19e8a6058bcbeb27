use std::fs;
use std::io::Write;
use std::path::Path;

use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_fs::Partial;
use deepfusion_model::{InputSize, StoredNetwork, depth_graph};
use deepfusion_nn::{DepthNet, weights};
use deepfusion_onnx::check::{PICTURES, deviation, pictures};
use deepfusion_onnx::runtime::{OrtEngine, find};
use deepfusion_onnx::{DepthMaps, DepthModel, FocalLength, OPSET, read, reference, write};
use deepfusion_train::depth_net;
use serde::Serialize;

use crate::cli::ExportArgs;
use crate::error::CliError;
use crate::failure::{Context, Result};
use crate::model;
use crate::output;
use crate::progress::say;

#[derive(Debug, Serialize)]
struct Report {
    file: String,
    bytes: usize,
    opset: i64,
    size: [usize; 2],
    depth_min_m: f64,
    depth_max_m: f64,
    training_fy_px: Option<f64>,
    pictures: [&'static str; 4],
    checks: Vec<Check>,
}

/// A way in which the file was run and compared with the network.
#[derive(Debug, Serialize)]
struct Check {
    engine: String,
    depth_deviation: f64,
    disparity_deviation: f64,
}

/// `deepfusion export`.
pub(super) fn run(args: &ExportArgs) -> Result<()> {
    let out = &args.out;
    if out.exists() && (!args.overwrite || out.is_dir()) {
        return Err(CliError::Exists {
            path: out.clone(),
            remedy: "choose another name, or give --overwrite to replace a file",
        }
        .into());
    }
    let device = Device::flex();
    let network = model::chosen(args.model.as_deref())?.load(args.set.as_deref())?;
    let net = depth_net(&network.config, &network.weights, &device)?;
    let model = model_of(&network, &net, args)?;
    let bytes = write(&model)?;
    let partial = partial_file(out, &bytes)?;
    let checks = check(args, &model, &net, partial.path(), &device)?;
    partial
        .publish()
        .map_err(|e| deepfusion_data::Error::file(out, e))?;
    print_report(args, &model, bytes.len(), checks)
}

/// The network of a run, for pictures of the size asked for.
fn model_of(network: &StoredNetwork, net: &DepthNet, args: &ExportArgs) -> Result<DepthModel> {
    let config = &network.config;
    let size = match args.size {
        Some(size) => InputSize::new(size.width as usize, size.height as usize)?,
        None => config.size,
    };
    // Of the pictures trained on, whatever the size now: a network sees metres through those.
    let camera = network
        .camera
        .map(|k| k.resized(config.size.width as u32, config.size.height as u32));
    Ok(DepthModel {
        graph: depth_graph(&config.depth_net, weights::collect(net))?,
        range: config.depth_net.range,
        width: size.width,
        height: size.height,
        trained_with: match config.canonical_focal_px {
            // The camera that its depth is of.
            Some(focal) => Some(FocalLength {
                fx: focal,
                fy: focal,
            }),
            None => camera.map(|k| FocalLength { fx: k.fx, fy: k.fy }),
        },
    })
}

/// The bytes in a file beside `out` that is gone unless it is published.
fn partial_file(out: &Path, bytes: &[u8]) -> Result<Partial> {
    let partial = Partial::beside(out);
    let written = partial.create().and_then(|mut file| file.write_all(bytes));
    written.map_err(|e| deepfusion_data::Error::file(out, e))?;
    Ok(partial)
}

/// Reads the file back and compares it with the network, in every engine there is.
fn check(
    args: &ExportArgs,
    model: &DepthModel,
    net: &DepthNet,
    file: &Path,
    device: &Device,
) -> Result<Vec<Check>> {
    let bytes =
        fs::read(file).with_context(|| format!("cannot read {} back", args.out.display()))?;
    let pictures = pictures(model.width, model.height);
    let expected: Vec<_> = pictures
        .iter()
        .map(|picture| burn_maps(model, net, picture, device))
        .collect();
    let again = read(&bytes)?;
    let found: Result<Vec<_>, _> = pictures
        .iter()
        .map(|picture| reference::depth(&again, picture))
        .collect();
    let name = "this program (the file read back)".to_owned();
    let mut checks = vec![compare(&args.out, name, &found?, &expected)?];
    if let Some(mut engine) = runtime(args, &bytes)? {
        let found: Result<Vec<_>, _> = pictures.iter().map(|p| engine.maps(p)).collect();
        let library = engine.library();
        let name = format!(
            "ONNX Runtime {} ({})",
            library.version,
            library.path.display()
        );
        checks.push(compare(&args.out, name, &found?, &expected)?);
    }
    Ok(checks)
}

/// What an engine made of the file, beside what the network sees.
fn compare(
    out: &Path,
    engine: String,
    found: &[DepthMaps],
    expected: &[DepthMaps],
) -> Result<Check, CliError> {
    let apart = deviation(found, expected);
    if !apart.is_small() {
        return Err(CliError::Deviates {
            path: out.to_owned(),
            engine,
            deviation: apart.worst(),
        });
    }
    Ok(Check {
        engine,
        depth_deviation: apart.depth,
        disparity_deviation: apart.disparity,
    })
}

/// The file in ONNX Runtime; none where no library was named and none is found.
fn runtime(args: &ExportArgs, bytes: &[u8]) -> Result<Option<OrtEngine>> {
    let library = args.check_with.as_deref();
    if library.is_none()
        && let Err(missing) = find(None)
    {
        say(&format!("not checked with ONNX Runtime: {missing}"));
        return Ok(None);
    }
    Ok(Some(OrtEngine::load(library, bytes, 0)?))
}

/// What the Burn network sees.
fn burn_maps(model: &DepthModel, net: &DepthNet, rgb: &[u8], device: &Device) -> DepthMaps {
    let (w, h) = (model.width, model.height);
    let unit = rgb.iter().map(|v| f32::from(*v) / 255.0).collect();
    let image = Tensor::<4>::from_data(TensorData::new(unit, [1, h, w, 3]), device);
    let sigmoid = net.forward(image.permute([0, 3, 1, 2])).swap_remove(0);
    let sigmoid = sigmoid.into_data();
    let disparity: Vec<f64> = sigmoid
        .iter::<f32>()
        .map(|s| model.range.disparity(f64::from(s)))
        .collect();
    DepthMaps {
        depth: disparity.iter().map(|d| d.recip() as f32).collect(),
        disparity: disparity.iter().map(|d| *d as f32).collect(),
    }
}

fn print_report(
    args: &ExportArgs,
    model: &DepthModel,
    bytes: usize,
    checks: Vec<Check>,
) -> Result<()> {
    let report = Report {
        file: args.out.display().to_string(),
        bytes,
        opset: OPSET,
        size: [model.width, model.height],
        depth_min_m: model.range.min_m,
        depth_max_m: model.range.max_m,
        training_fy_px: model.trained_with.map(|k| k.fy),
        pictures: PICTURES,
        checks,
    };
    if args.json {
        return output::print_json(&report);
    }
    for check in &report.checks {
        say(&format!(
            "checked with {}: depth {:.1e}, disparity {:.1e} from the network (max |difference| / max |value|, {} pictures)",
            check.engine,
            check.depth_deviation,
            check.disparity_deviation,
            PICTURES.len()
        ));
    }
    output::print(&format!("{}\n", report.file))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_answer_is_an_error_that_names_the_deviation() {
        let maps = |depth: f32| {
            [DepthMaps {
                depth: vec![10.0, depth],
                disparity: vec![0.1, 1.0 / depth],
            }]
        };
        let compared = |depth| {
            compare(
                Path::new("depth.onnx"),
                "an engine".into(),
                &maps(depth),
                &maps(5.0),
            )
        };
        assert!(compared(5.000_1).is_ok());
        let error = compared(6.0).unwrap_err().to_string();
        assert_eq!(
            error,
            "depth.onnx: an engine is 1.7e-1 away from the network (max |difference| / max |value|), more than 1e-4; \
             not kept"
        );
        assert!(compared(f32::NAN).is_err());
    }
}
