//! How sharp a depth map is: whether its boundaries are at the true place, and whether depth changes abruptly there.
//!
//! Metrics over all pixels hardly notice blur: boundaries are few pixels, and a depth half way between two objects is only half as wrong.
//! The depth boundary error measures how far boundaries are from their true place. The share of flying pixels (which float between two
//! objects in a point cloud) counts pixels that belong to neither.
//!
//! Both are computed inside the protocol's crop and range, at the truth's size, where truth and prediction are both known. The prediction
//! is median-scaled first, since a wrong scale is not blur and other metrics show it. In both maps, everything beyond the cap is put at the
//! cap. So is the sky, which is infinitely deep, so that its borders are boundaries.

mod boundary;
mod canny;
mod distance;
mod flying;
mod pair;
mod smooth;

pub use boundary::BoundaryError;

use serde::{Deserialize, Serialize};

use self::pair::Pair;
use crate::statistics::mean;
use crate::{Grid, Prediction, Protocol};

/// Sharpness of one image's depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageSharpness {
    /// How far depth boundaries are from their true place; `None` if the truth has none.
    pub boundary: Option<BoundaryError>,
    /// Share of flying pixels among the pixels within two pixels of a jump of the true depth (a neighbour more than 1.25 times deeper);
    /// `None` if the truth has no jump. A flying pixel's predicted depth is between the smallest and the largest true depth of the
    /// surrounding 5×5 pixels and more than 10 % from each of them.
    pub flying_share: Option<f64>,
}

impl ImageSharpness {
    /// Sharpness of a prediction of any size, compared with H×W depth in metres: 0 or NaN for unknown, infinity for sky. `None` unless the
    /// crop is 21×21 or larger, half of it is known, and some of it is within the range.
    ///
    /// ```
    /// use deepfusion_eval::{Grid, ImageSharpness, Prediction, Protocol};
    /// // Something 5 m away before a wall at 20 m, and a prediction that is half as wide and so blurs the boundary.
    /// let depth = |width: usize, step: usize| {
    ///     let row = move |x: usize| if x < step { 5.0 } else { 20.0 };
    ///     Grid::new(width, 24, (0..width * 24).map(|i| row(i % width)).collect())
    /// };
    /// let half = Prediction::Depth(depth(16, 10)?);
    /// let sharpness = ImageSharpness::of(&depth(32, 20)?, &half, &Protocol::default()).unwrap();
    /// // Of the four pixels in a row that are near it, the middle ones are at neither depth.
    /// assert_eq!(sharpness.flying_share, Some(0.5));
    /// # Ok::<(), deepfusion_eval::Error>(())
    /// ```
    #[must_use]
    pub fn of(truth: &Grid, prediction: &Prediction, protocol: &Protocol) -> Option<Self> {
        let pair = Pair::new(truth, prediction, protocol)?;
        Some(Self {
            boundary: BoundaryError::of(&pair),
            flying_share: flying::share(&pair),
        })
    }
}

/// Sharpness of several images: means over the images for which each value exists.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sharpness {
    /// Mean of [`BoundaryError::accuracy_px`], in pixels of the truth; lower is better.
    pub boundary_accuracy_px: Option<f64>,
    /// Mean of [`BoundaryError::completeness_px`], in pixels of the truth; lower is better.
    pub boundary_completeness_px: Option<f64>,
    /// Mean of [`ImageSharpness::flying_share`]; lower is better.
    pub flying_share: Option<f64>,
    /// Number of images with dense ground truth.
    pub images: usize,
    /// Number of these images with depth boundaries: the first two values are means over them.
    pub boundary_images: usize,
    /// Number of these images with depth jumps: the third value is a mean over them.
    pub flying_images: usize,
}

impl Sharpness {
    /// The means; `None` without images.
    pub(crate) fn mean<'a>(images: impl Iterator<Item = &'a ImageSharpness>) -> Option<Self> {
        let images: Vec<_> = images.collect();
        let boundaries: Vec<_> = images.iter().filter_map(|i| i.boundary).collect();
        let flying: Vec<_> = images.iter().filter_map(|i| i.flying_share).collect();
        let of = |part: fn(&BoundaryError) -> f64| {
            mean(&boundaries.iter().map(part).collect::<Vec<_>>())
        };
        (!images.is_empty()).then(|| Self {
            boundary_accuracy_px: of(|b| b.accuracy_px),
            boundary_completeness_px: of(|b| b.completeness_px),
            flying_share: mean(&flying),
            images: images.len(),
            boundary_images: boundaries.len(),
            flying_images: flying.len(),
        })
    }
}
