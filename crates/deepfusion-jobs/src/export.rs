//! Exports a network as an ONNX file, which is compared with the network before it is kept.

use std::io::Write;
use std::path::Path;

use burn::tensor::{Tensor, TensorData};
use deepfusion_data::Error as DataError;
use deepfusion_fs::write_aside;
use deepfusion_model::{InputSize, StoredNetwork, depth_graph};
use deepfusion_nn::{DepthNet, weights};
use deepfusion_onnx::check::{deviation, pictures};
use deepfusion_onnx::runtime::{OrtEngine, find};
use deepfusion_onnx::{DepthMaps, DepthModel, FocalLength, read, reference, write};
use deepfusion_train::{Device, depth_net};

use crate::{Error, Result};

/// A file that was written.
#[derive(Debug)]
pub struct Exported {
    /// The model in the file.
    pub model: DepthModel,
    /// Size of the file.
    pub bytes: usize,
    /// The engines that ran the file, and how they compare with the network.
    pub checks: Vec<Check>,
    /// Why ONNX Runtime did not run the file: no library was given, and none was found. `None` if it did.
    pub no_runtime: Option<deepfusion_onnx::Error>,
}

/// An engine that ran the file, compared with the network.
#[derive(Debug)]
pub struct Check {
    /// Name of the engine.
    pub engine: String,
    /// Difference of its depth from the network's: max |difference| / max |value|.
    pub depth_deviation: f64,
    /// Difference of its disparity, in the same measure.
    pub disparity_deviation: f64,
}

/// Writes a network as `out`, for pictures of `size` (by default the network's own); `library` is ONNX Runtime's. An existing file is
/// replaced.
///
/// # Errors
/// [`Error::Deviates`] if the file computes something else than the network; nothing is kept then. A size that the network does not
/// support; a given library that cannot be loaded; a file that cannot be written.
pub fn export(
    network: &StoredNetwork,
    size: Option<InputSize>,
    library: Option<&Path>,
    out: &Path,
) -> Result<Exported> {
    let device = Device::flex();
    let net = depth_net(&network.config, &network.weights, &device)?;
    let model = model_of(network, &net, size)?;
    let bytes = write(&model)?;
    let failed = |e| DataError::file(out, e);
    let partial = write_aside(out, failed, |file| file.write_all(&bytes).map_err(failed))?;
    let (checks, no_runtime) = check((out, partial.path()), &model, &net, library, &device)?;
    partial.publish().map_err(failed)?;
    let bytes = bytes.len();
    Ok(Exported {
        model,
        bytes,
        checks,
        no_runtime,
    })
}

fn model_of(
    network: &StoredNetwork,
    net: &DepthNet,
    size: Option<InputSize>,
) -> Result<DepthModel> {
    let config = &network.config;
    let size = match size {
        Some(size) => InputSize::new(size.width, size.height)?,
        None => config.size,
    };
    // The training camera, whatever the size: the network's metres belong to it.
    let camera = network
        .camera
        .map(|k| k.resized(config.size.width as u32, config.size.height as u32));
    Ok(DepthModel {
        graph: depth_graph(&config.depth_net, weights::collect(net))?,
        range: config.depth_net.range,
        width: size.width,
        height: size.height,
        trained_with: match config.canonical_focal_px {
            // The focal length that its depth is for.
            Some(focal) => Some(FocalLength {
                fx: focal,
                fy: focal,
            }),
            None => camera.map(|k| FocalLength { fx: k.fx, fy: k.fy }),
        },
        canonical: config.canonical_focal_px.is_some(),
    })
}

/// Reads the file back and compares it with the network in every available engine.
fn check(
    (out, file): (&Path, &Path),
    model: &DepthModel,
    net: &DepthNet,
    library: Option<&Path>,
    device: &Device,
) -> Result<(Vec<Check>, Option<deepfusion_onnx::Error>)> {
    let bytes = std::fs::read(file).map_err(|source| Error::ReadBack {
        path: out.to_owned(),
        source,
    })?;
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
    let mut checks = vec![compare(out, name, &found?, &expected)?];
    if library.is_none()
        && let Err(missing) = find(None)
    {
        return Ok((checks, Some(missing)));
    }
    let mut engine = OrtEngine::load(library, &bytes, 0)?;
    let found: Result<Vec<_>, _> = pictures.iter().map(|p| engine.maps(p)).collect();
    let library = engine.library();
    let name = format!(
        "ONNX Runtime {} ({})",
        library.version,
        library.path.display()
    );
    checks.push(compare(out, name, &found?, &expected)?);
    Ok((checks, None))
}

/// Compares an engine's output for the file with the network's.
fn compare(
    out: &Path,
    engine: String,
    found: &[DepthMaps],
    expected: &[DepthMaps],
) -> Result<Check> {
    let apart = deviation(found, expected);
    if !apart.is_small() {
        return Err(Error::Deviates {
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

/// The output of the network in Burn.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_result_is_an_error_that_names_the_deviation() {
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
            "depth.onnx: an engine differs from the network by 1.7e-1 (max |difference| / max |value|), expected at most 1e-4; \
             not kept"
        );
        assert!(compared(f32::NAN).is_err());
    }
}
