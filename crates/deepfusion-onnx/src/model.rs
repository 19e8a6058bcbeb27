use deepfusion_geometry::DepthRange;
use deepfusion_infer::Graph;

use crate::{Error, ModelProblem};

/// The focal lengths of a camera, in pixels of the images that a network was trained on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FocalLength {
    /// Along x.
    pub fx: f64,
    /// Along y.
    pub fy: f64,
}

/// The key of a file's metadata for a canonical focal length.
pub(crate) const CANONICAL: &str = "canonical_fy_px";

/// A depth network for images of one size, from an RGB picture to metres.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthModel {
    /// The network; its one output is the sigmoid disparity σ at the image's size.
    pub graph: Graph,
    /// The depth range of σ: 1/depth = 1/D_max + (1/D_min − 1/D_max)·σ.
    pub range: DepthRange,
    /// Width of the images, in pixels.
    pub width: usize,
    /// Height of the images, in pixels.
    pub height: usize,
    /// Focal lengths of the training camera. Depth of another camera's images has to be multiplied by
    /// f_y(that camera at this model's size) / f_y(trained with).
    pub trained_with: Option<FocalLength>,
    /// Whether [`Self::trained_with`] is a canonical focal length, which no real camera may have: then the depth of every camera's images
    /// has to be multiplied in this way.
    pub canonical: bool,
}

/// The output of a [`DepthModel`]: two maps of H×W values, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMaps {
    /// Camera z, in metres.
    pub depth: Vec<f32>,
    /// Metric disparity, 1 / depth, in 1/m.
    pub disparity: Vec<f32>,
}

impl DepthModel {
    /// Checks that the model can run on its images and has a single output, the depth map.
    ///
    /// # Errors
    /// [`Error::Network`] for a size that the network cannot halve, or that is too small for its reflected
    /// borders; [`Error::Model`] for an invalid range or other outputs.
    pub fn validate(&self) -> Result<(), Error> {
        self.graph.check_size(self.width, self.height)?;
        let fail = |part: &'static str, reason| Err(Error::Model { part, reason });
        let DepthRange { min_m, max_m } = self.range;
        if !(min_m > 0.0 && max_m > min_m && max_m.is_finite()) {
            return fail("depth range", ModelProblem::Range { range: self.range });
        }
        match self.graph.outputs() {
            [output] => {
                let shape = self.graph.shape(*output);
                if (shape.channels, shape.halvings, shape.pooled) != (1, 0, false) {
                    return fail("outputs", ModelProblem::Output { shape });
                }
            }
            others => {
                let found = others.len();
                return fail("outputs", ModelProblem::Outputs { found });
            }
        }
        Ok(())
    }

    /// 1/D_max and 1/D_min − 1/D_max as the files hold them: disparity = first + second · σ.
    pub(crate) fn disparity_terms(&self) -> [f32; 2] {
        let far = self.range.disparity(0.0);
        [far as f32, (self.range.disparity(1.0) - far) as f32]
    }
}
