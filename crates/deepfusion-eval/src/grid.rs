use deepfusion_geometry::DepthMap;

use crate::{Error, Result};

/// H×W numbers, row by row: depth in metres or disparity in 1/m, as the place it stands in says.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

impl Grid {
    /// From `width * height` values, row by row.
    ///
    /// # Errors
    /// [`Error::Shape`] if the number of values is another one, or zero.
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

    /// From single-precision values, as networks give them.
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

/// What a method predicts for an image, at any size: both kinds score the same (SPEC 5, step 1).
#[derive(Debug, Clone, PartialEq)]
pub enum Prediction {
    /// Camera z in metres.
    Depth(Grid),
    /// 1 / depth, in 1/m.
    Disparity(Grid),
}

impl Prediction {
    /// The array as it was given.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        match self {
            Self::Depth(grid) | Self::Disparity(grid) => grid,
        }
    }

    /// "depth" or "disparity".
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Depth(_) => "depth",
            Self::Disparity(_) => "disparity",
        }
    }

    /// Disparity of every pixel in 1/m, `None` where the prediction is not finite and positive, or its inverse is not.
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
