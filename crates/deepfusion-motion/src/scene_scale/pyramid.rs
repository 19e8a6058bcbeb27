//! A grey image at several sizes.

use std::sync::Arc;

use crate::GreyImage;

/// Smallest number of rows of the smallest level.
const LEAST_ROWS: usize = 20;
/// Largest number of levels: full size, a half, a quarter.
const LEVELS: usize = 3;

/// A grey image, its half and its quarter. Computed once, it serves all pairs that contain the image.
#[derive(Debug, Clone)]
pub struct GreyPyramid {
    /// The levels, full size first.
    levels: Arc<Vec<GreyImage>>,
}

impl GreyPyramid {
    /// Makes the pyramid of an image with values from 0 to 255.
    #[must_use]
    pub fn new(image: GreyImage) -> Self {
        let mut levels = vec![image];
        while levels.len() < LEVELS
            && let Some(last) = levels.last()
            && last.height / 2 >= LEAST_ROWS
        {
            let half = half(last);
            levels.push(half);
        }
        Self {
            levels: Arc::new(levels),
        }
    }

    /// The image at its full size.
    #[must_use]
    pub fn full(&self) -> &GreyImage {
        &self.levels[0]
    }

    /// All sizes, full size first.
    pub(super) fn levels(&self) -> &[GreyImage] {
        &self.levels
    }
}

/// Means of 2×2 pixels; an odd last row or column is left out.
fn half(image: &GreyImage) -> GreyImage {
    let (width, height) = (image.width / 2, image.height / 2);
    let at = |x: usize, y: usize| image.data[y * image.width + x];
    let mean = |i: usize| {
        let (x, y) = (2 * (i % width), 2 * (i / width));
        0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1))
    };
    GreyImage {
        width,
        height,
        data: (0..width * height).map(mean).collect(),
    }
}
