use crate::losses::log_depth_error;
use crate::{BatchLoss, DepthBatch, DepthPass, ForwardPass};
use burn::tensor::Tensor;

/// The networks' outputs for one training image. All planes are row by row, of `width` × `height`.
#[derive(Debug, Clone, PartialEq)]
pub struct SamplePanel {
    /// Width, in pixels.
    pub width: usize,
    /// Height, in pixels.
    pub height: usize,
    /// Drive and frame.
    pub name: String,
    /// The image, 3×H×W in [0, 1].
    pub image: Vec<f32>,
    /// Its disparity at the finest scale, H×W: the sigmoid's, or in 1/m beside known depth.
    pub disparity: Vec<f32>,
    /// Its supervision.
    pub supervision: Supervision,
}

/// The supervision of a panel's image.
#[derive(Debug, Clone, PartialEq)]
pub enum Supervision {
    /// A source: its neighbour in the video.
    View {
        /// The source warped to the image, 3×H×W.
        warped: Vec<f32>,
        /// The photometric error in the loss, H×W.
        error: Vec<f32>,
        /// 1 where the warped source explains the pixel, 0 where it is masked, H×W.
        mask: Vec<f32>,
        /// The optical flow to the source, 2×H×W in pixels, where one is learned.
        flow: Option<Vec<f32>>,
        /// 1 where the pixel counts as dynamic, H×W, once such pixels are masked.
        moving: Option<Vec<f32>>,
    },
    /// Its known depth.
    Depth {
        /// True disparity, 1/m, H×W, 0 in the sky; NaN where unknown.
        truth: Vec<f32>,
        /// ln of predicted over known depth, H×W, 0 where depth is not known.
        error: Vec<f32>,
    },
}

impl SamplePanel {
    /// The panel of the batch's first sample.
    pub(crate) fn first(pass: &ForwardPass, loss: &BatchLoss, name: String) -> Self {
        let [_, _, height, width] = pass.targets.dims();
        Self {
            width,
            height,
            name,
            image: first(&pass.targets),
            disparity: first(&pass.disparities[0]),
            supervision: Supervision::View {
                warped: first(&loss.warped),
                error: first(&loss.finest.error),
                mask: first(&loss.finest.explained.clone().float()),
                flow: pass.flows.first().map(|view| first(&view.flow)),
                moving: loss.moving.as_ref().map(|m| first(&m.clone().float())),
            },
        }
    }

    /// The panel of the first image whose depth is known.
    pub(crate) fn of_depth(pass: &DepthPass, batch: &DepthBatch) -> Self {
        let [_, _, height, width] = batch.clean.dims();
        let truth = &batch.truth;
        let error = log_depth_error(pass.metric_disparity.clone(), truth);
        let planes = [&truth.known, &truth.log_depth, &truth.far].map(first);
        let [known, log_depth, far] = &planes;
        let disparity = |i: usize| match (known[i] > 0.0, far[i] > 0.0) {
            (true, _) => (-log_depth[i]).exp(),
            (_, true) => 0.0,
            _ => f32::NAN,
        };
        Self {
            width,
            height,
            name: batch.names.first().cloned().unwrap_or_default(),
            image: first(&batch.network),
            disparity: first(&pass.metric_disparity),
            supervision: Supervision::Depth {
                truth: (0..known.len()).map(disparity).collect(),
                error: first(&error),
            },
        }
    }
}

/// The values of a batch's first sample.
fn first(batch: &Tensor<4>) -> Vec<f32> {
    let values = batch.clone().narrow(0, 0, 1).into_data();
    values.iter::<f32>().collect()
}
