//! The field's post-processing: a prediction blended with that of the mirrored image.

use serde::{Deserialize, Serialize};

use crate::{Error, Grid, Result};

/// What is done with a prediction before it is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PostProcess {
    /// [`blend_flipped`] with the prediction of the mirrored image, at twice the time.
    Flip,
}

/// Where the blending begins and ends, from an edge, as shares of the width.
const EDGE: (f64, f64) = (0.05, 0.10);

/// Disparity of an image and of its mirror image as one (Godard et al., CVPR 2017, section 3.4, as Monodepth2's evaluation does it): the mean of
/// both; in the leftmost twentieth that of the mirrored image alone, in the rightmost that of the image, with a ramp as wide between.
/// At its left edge a network trained on views to the right has not seen what it should predict; at the mirrored image's it has.
///
/// # Shapes
/// - `own`: H×W
/// - `mirrored`: H×W, the mirrored image's prediction mirrored back
///
/// # Errors
/// [`Error::Shape`] where the two differ in size.
pub fn blend_flipped(own: &Grid, mirrored: &Grid) -> Result<Grid> {
    let (width, height) = (own.width(), own.height());
    if (mirrored.width(), mirrored.height()) != (width, height) {
        return Err(Error::Shape {
            name: "mirrored prediction".into(),
            width,
            height,
            len: mirrored.values().len(),
        });
    }
    let (from, to) = EDGE;
    let last = width.saturating_sub(1).max(1) as f64;
    let near_left = |column: usize| {
        let x = column as f64 / last;
        1.0 - ((x - from) / (to - from)).clamp(0.0, 1.0)
    };
    let weights: Vec<(f64, f64)> = (0..width)
        .map(|column| {
            let (left, right) = (near_left(column), near_left(width - 1 - column));
            let both = (1.0 - left - right) / 2.0;
            (right + both, left + both)
        })
        .collect();
    let pairs = own.values().iter().zip(mirrored.values());
    let blended = pairs.enumerate().map(|(i, (a, b))| {
        let (of_own, of_mirrored) = weights[i % width];
        of_own * a + of_mirrored * b
    });
    Grid::new(width, height, blended.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_edge_is_of_the_image_that_saw_it() {
        let (own, mirrored) = (vec![1.0; 101], vec![3.0; 101]);
        let own = Grid::new(101, 1, own).unwrap();
        let mirrored = Grid::new(101, 1, mirrored).unwrap();
        let blended = blend_flipped(&own, &mirrored).unwrap();
        let at = |column: usize| blended.values()[column];
        assert_eq!(
            (at(0), at(5), at(50), at(95), at(100)),
            (3.0, 3.0, 2.0, 1.0, 1.0)
        );
        // Halfway down the ramp, between the seventh column and the eighth: three quarters and one.
        assert!((f64::midpoint(at(7), at(8)) - 2.5).abs() < 1e-12);
        assert!((f64::midpoint(at(92), at(93)) - 1.5).abs() < 1e-12);
        assert_eq!(blend_flipped(&own, &own).unwrap().values()[7], 1.0);
    }

    #[test]
    fn two_sizes_are_an_error() {
        let grid = |width| Grid::new(width, 1, vec![1.0; width]).unwrap();
        assert!(blend_flipped(&grid(4), &grid(5)).is_err());
        assert_eq!(blend_flipped(&grid(1), &grid(1)).unwrap(), grid(1));
    }
}
