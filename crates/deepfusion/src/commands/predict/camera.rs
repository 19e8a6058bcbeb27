//! The camera of an input: given, read from a calibration file, or assumed.

use std::path::Path;

use anyhow::Result;
use deepfusion_data::{Camera, kitti::Calibration};
use deepfusion_geometry::Intrinsics;

use crate::cli::{CameraIntrinsics, PredictArgs};
use crate::error::CliError;

/// Where the inputs' camera comes from.
#[derive(Debug, Clone, Copy)]
pub enum CameraSource {
    /// Numbers given on the command line, for images of any size.
    Given(CameraIntrinsics),
    /// A calibration file, for images of its size.
    File(Intrinsics),
    /// The camera trained with: the inputs are taken to see what it saw.
    Trained(Intrinsics),
    /// Nothing is known.
    Unknown,
}

impl CameraSource {
    /// What the arguments say; `trained` where they say nothing.
    pub fn new(args: &PredictArgs, trained: Option<Intrinsics>) -> Result<Self> {
        if let Some(k) = args.intrinsics {
            return Ok(Self::Given(k));
        }
        let Some(path) = &args.calib else {
            return Ok(trained.map_or(Self::Unknown, Self::Trained));
        };
        let folder = if path.is_dir() {
            path.as_path()
        } else {
            path.parent().unwrap_or(Path::new("."))
        };
        Ok(Self::File(
            Calibration::read(folder, Camera::Left)?.intrinsics,
        ))
    }

    /// One word for the sidecar.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Given(_) | Self::File(_) => "given",
            Self::Trained(_) => "assumed",
            Self::Unknown => "unknown",
        }
    }

    /// The camera of an image of this size.
    pub fn of(&self, width: u32, height: u32) -> Result<Option<Intrinsics>, CliError> {
        match self {
            Self::Given(k) => {
                let k = Intrinsics {
                    fx: k.fx,
                    fy: k.fy,
                    cx: k.cx,
                    cy: k.cy,
                    width,
                    height,
                };
                match k.implausible() {
                    Some(why) => Err(CliError::Camera { why }),
                    None => Ok(Some(k)),
                }
            }
            Self::File(k) if (k.width, k.height) != (width, height) => Err(CliError::Camera {
                why: format!(
                    "the calibration is for {}x{}, the image has {width}x{height}",
                    k.width, k.height
                ),
            }),
            Self::File(k) => Ok(Some(*k)),
            Self::Trained(k) => Ok(Some(with_the_view_of(k, width, height))),
            Self::Unknown => Ok(None),
        }
    }
}

/// A camera of the same field of view from left to right, square pixels, the same height of the horizon.
fn with_the_view_of(k: &Intrinsics, width: u32, height: u32) -> Intrinsics {
    let f = k.fx * f64::from(width) / f64::from(k.width);
    let centre = |c: f64, from: u32, to: u32| (c + 0.5) * f64::from(to) / f64::from(from) - 0.5;
    Intrinsics {
        fx: f,
        fy: f,
        cx: centre(k.cx, k.width, width),
        cy: centre(k.cy, k.height, height),
        width,
        height,
    }
}
