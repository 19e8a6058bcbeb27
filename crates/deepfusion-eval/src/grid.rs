use deepfusion_geometry::DepthMap;

use crate::resample::{Axis, sample};
use crate::{Error, Result};

/// H×W numbers, row by row: depth in metres or disparity in 1/m, depending on where it is used.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

impl Grid {
    /// Makes a grid from `width * height` values, row by row.
    ///
    /// # Errors
    /// [`Error::Shape`] if the number of values is different, or zero.
    pub fn new(width: usize, height: usize, values: Vec<f64>) -> Result<Self> {
        if width == 0 || height == 0 || values.len() != width * height {
            return Err(Error::Shape {
                name: "array".into(),
                width,
                height,
                len: values.len(),
            });
        }
        Ok(Self {
            width,
            height,
            values,
        })
    }

    /// Makes a grid from single-precision values, as networks produce them.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn from_f32(width: usize, height: usize, values: &[f32]) -> Result<Self> {
        Self::new(
            width,
            height,
            values.iter().copied().map(f64::from).collect(),
        )
    }

    /// Width, in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// The values, row by row.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }
}

impl From<&DepthMap> for Grid {
    fn from(map: &DepthMap) -> Self {
        Self {
            width: map.width,
            height: map.height,
            values: map.data.iter().copied().map(f64::from).collect(),
        }
    }
}

/// The prediction for an image, at any size. Depth and the equivalent disparity get the same scores.
#[derive(Debug, Clone, PartialEq)]
pub enum Prediction {
    /// Camera z in metres.
    Depth(Grid),
    /// 1 / depth, in 1/m.
    Disparity(Grid),
}

impl Prediction {
    /// The array as given.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        match self {
            Self::Depth(grid) | Self::Disparity(grid) => grid,
        }
    }

    /// Depth in metres at another size: resized as disparity, as in the protocol; 0 where there is no prediction.
    #[must_use]
    pub fn depth_at(&self, width: usize, height: usize) -> DepthMap {
        let mut map = DepthMap::empty(width, height);
        let (grid, disparities) = (self.grid(), self.disparities());
        let (columns, rows) = (Axis::new(grid.width, width), Axis::new(grid.height, height));
        for (i, depth) in map.data.iter_mut().enumerate() {
            let (x, y) = (i % width, i / width);
            if let Some(disparity) = sample(&disparities, grid.width, &columns, &rows, x, y) {
                *depth = (1.0 / disparity) as f32;
            }
        }
        map
    }

    /// "depth" or "disparity".
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Depth(_) => "depth",
            Self::Disparity(_) => "disparity",
        }
    }

    /// Disparity of every pixel in 1/m; `None` where the prediction or its inverse is not finite and positive.
    pub(crate) fn disparities(&self) -> Vec<Option<f64>> {
        let usable = |v: f64| v.is_finite() && v > 0.0 && (1.0 / v).is_finite();
        let invert = matches!(self, Self::Depth(_));
        self.grid()
            .values
            .iter()
            .map(|&v| usable(v).then(|| if invert { 1.0 / v } else { v }))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_enlarged_as_disparity_and_holes_are_zero() {
        let disparity = Prediction::Disparity(Grid::new(2, 1, vec![0.1, 0.2]).unwrap());
        let depth = disparity.depth_at(4, 2);
        assert_eq!((depth.width, depth.height), (4, 2));
        let expected = [10.0, 8.0, 1.0 / 0.175, 5.0].map(|d: f64| d as f32);
        for (d, e) in depth.data.iter().zip(expected.iter().cycle()) {
            assert!((d - e).abs() < 1e-5, "{d} {e}");
        }
        let holes = Prediction::Depth(Grid::new(2, 1, vec![4.0, f64::NAN]).unwrap());
        assert_eq!(holes.depth_at(2, 1).data, [4.0, 0.0]);
        assert!(holes.depth_at(0, 3).data.is_empty());
    }
}
