use std::path::PathBuf;

use clap::Args;
use deepfusion_calibrate::LensModel;

use super::Size;
use super::values::{board, positive};

/// `deepfusion calibrate`.
#[derive(Debug, Args)]
#[command(
    after_help = "Print a checkerboard, fix it to something flat, and show all of it to the camera: near, tilted by 20 to 45 degrees to each side, \
    and in every corner of the image. Take 15 to 30 pictures, or a video of half a minute; from a video, the sharpest frames with \
    different poses are used. The file is ROS's camera_info YAML: pass it to --calib, or put it beside a drive's images as \
    calibration.yaml.\n\n\
    Examples:\n  deepfusion calibrate board.mp4 --board 9x6\n  \
    deepfusion calibrate pictures --board 9x6 --square 0.025 --fisheye --out camera.yaml --report camera.html"
)]
pub(crate) struct CalibrateArgs {
    /// Pictures of the board (PNG, JPEG), folders of them, globs, or videos.
    #[arg(required = true, value_name = "VIDEO|FOLDER|IMAGE")]
    pub inputs: Vec<String>,
    /// Inner corners of the board, where four squares meet: 9x6 for a board of 10x7 squares.
    #[arg(long, value_name = "WxH", value_parser = board)]
    pub board: Size,
    /// Side of a square in metres (25 mm: 0.025).
    ///
    /// The boards' distances depend on it, the camera does not. Without it, no distances are given.
    #[arg(long, allow_negative_numbers = true, value_name = "M", value_parser = positive)]
    pub square: Option<f64>,
    /// Fit a fisheye lens by Kannala and Brandt (k1 to k4) instead of Brown and Conrady's model (k1, k2, p1, p2, k3).
    #[arg(long)]
    pub fisheye: bool,
    /// Most frames to take of a video.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u16).range(5..=200))]
    pub frames: u16,
    /// Calibration file to write.
    #[arg(long, value_name = "FILE.yaml", value_parser = yaml, default_value = "camera.yaml")]
    pub out: PathBuf,
    /// Replace existing files of --out and --report.
    #[arg(long)]
    pub overwrite: bool,
    /// Also write a page with the numbers, where corners were seen, and every view with its error.
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

impl CalibrateArgs {
    /// Which lens is fitted.
    pub(crate) fn model(&self) -> LensModel {
        if self.fisheye {
            LensModel::Fisheye
        } else {
            LensModel::BrownConrady
        }
    }
}

/// A file that is read as YAML again.
fn yaml(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let ending = path.extension().and_then(|e| e.to_str());
    match ending {
        Some(e) if ["yaml", "yml"].contains(&e.to_ascii_lowercase().as_str()) => Ok(path),
        _ => Err("expected a file that ends in .yaml, such as camera.yaml".into()),
    }
}
