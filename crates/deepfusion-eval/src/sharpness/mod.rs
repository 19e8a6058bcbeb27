//! How sharp a depth map is: whether its boundaries are where the truth's are, and whether things end there.
//!
//! Metrics over all pixels hardly see a blur: boundaries are few pixels, and half-way depth is half as wrong. The depth
//! boundary error says how far boundaries are from their place, flying pixels (which float between two things in a
//! cloud) say how many belong to neither.
//!
//! Both compare within the protocol's crop and range, at the truth's size, where truth and prediction are both known.
//! The prediction is median-scaled first: a wrong scale is no blur, and other numbers tell it. What lies beyond the cap
//! is at the cap, in both maps; the sky, infinitely deep, too, so that its borders are boundaries.

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

/// How sharp one image's depth is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageSharpness {
    /// How far depth boundaries are from their place; `None` where the truth has none.
    pub boundary: Option<BoundaryError>,
    /// Of the pixels within two of a jump of the true depth (a neighbour more than 1.25 times deeper), the share that
    /// hangs between two depths; `None` where the truth has no jump. Such a pixel's predicted depth is between the least
    /// and the greatest true depth of the 5×5 pixels around, and more than 10 % from each of them.
    pub flying_share: Option<f64>,
}

impl ImageSharpness {
    /// Of a prediction of any size, compared with H×W depth in metres: 0 or NaN where nothing is known, infinity where
    /// the sky is. `None` unless the crop is 21×21 or larger, half of it is known, and something of it is within the range.
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

/// How sharp the depth of several images is: means over the images that have what is measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sharpness {
    /// Mean of [`BoundaryError::accuracy_px`], in pixels of the truth; lower is better.
    pub boundary_accuracy_px: Option<f64>,
    /// Mean of [`BoundaryError::completeness_px`], in pixels of the truth; lower is better.
    pub boundary_completeness_px: Option<f64>,
    /// Mean of [`ImageSharpness::flying_share`]; lower is better.
    pub flying_share: Option<f64>,
    /// How many images have dense truth.
    pub images: usize,
    /// How many of them have depth boundaries, over which the first two are means.
    pub boundary_images: usize,
    /// How many of them have jumps of depth, over which the third is a mean.
    pub flying_images: usize,
}

impl Sharpness {
    /// `None` of none.
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
