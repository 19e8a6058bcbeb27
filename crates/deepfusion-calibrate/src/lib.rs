//! A camera's intrinsics and lens from pictures of a checkerboard.
//!
//! [`find_board`] finds the board's inner corners in a picture, [`pick`] chooses among a video's frames, and [`calibrate`] fits the camera:
//! Zhang's closed form from the board's homographies (IEEE TPAMI 22(11), 2000), then all parameters together by the Levenberg–Marquardt
//! method, with standard errors. The lens model is Brown–Conrady or, for a fisheye, Kannala–Brandt, as in OpenCV.
//!
//! ```
//! use deepfusion_calibrate::{Board, LensModel, View, calibrate};
//! use nalgebra::{Rotation3, Vector2, Vector3};
//!
//! // Corners as seen by a camera with f = 500 px, from six sides.
//! let board = Board::new(9, 6, 0.025)?;
//! let views: Vec<View> = (0..6)
//!     .map(|i| {
//!         let turn = Rotation3::from_euler_angles(0.3 - 0.1 * f64::from(i), 0.2 * f64::from(i % 3), 0.0);
//!         let corners = board.points().into_iter().map(|p| {
//!             let p = turn * p + Vector3::new(-0.1, -0.06, 0.4);
//!             Vector2::new(500.0 * p.x / p.z + 320.0, 500.0 * p.y / p.z + 240.0)
//!         });
//!         View { name: format!("{i}.png"), corners: corners.collect() }
//!     })
//!     .collect();
//! let found = calibrate(&views, &board, (640, 480), LensModel::BrownConrady)?;
//! assert!((found.intrinsics.fx - 500.0).abs() < 1e-3);
//! # Ok::<(), deepfusion_calibrate::Error>(())
//! ```
//!
//! Pixel centres are at whole numbers. The board's first inner corner is its origin; x is along a row, y along a column, in metres.

mod board;
mod calibration;
mod complete;
mod corners;
mod coverage;
mod detect;
mod error;
mod grid;
mod homography;
mod model;
mod pick;
mod refine;
mod solve;
mod warning;
mod zhang;

pub use board::Board;
pub use calibration::{Calibration, StandardErrors, View, ViewFit};
pub use coverage::Coverage;
pub use detect::{BoardDetection, find_board};
pub use error::{Error, Result, Undetermined};
pub use model::LensModel;
pub use pick::{Candidate, pick, sharpness};
pub use solve::{LEAST_VIEWS, calibrate};
pub use warning::CalibrationWarning;
