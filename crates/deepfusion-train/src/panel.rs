use crate::{BatchLoss, ForwardPass};
use burn::tensor::Tensor;

/// What the networks make of one training image. All planes are row by row, of `width` × `height`.
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
    /// Its sigmoid disparity at the finest scale, H×W.
    pub disparity: Vec<f32>,
    /// The source seen from its place, 3×H×W.
    pub warped: Vec<f32>,
    /// The photometric error that counts, H×W.
    pub error: Vec<f32>,
    /// 1 where the warped source explains the pixel, 0 where it is masked, H×W.
    pub mask: Vec<f32>,
    /// The optical flow to the source, 2×H×W in pixels, where one is learned.
    pub flow: Option<Vec<f32>>,
    /// 1 where the pixel is taken to move by itself, H×W, once that is looked for.
    pub moving: Option<Vec<f32>>,
}

impl SamplePanel {
    /// The panel of the batch's first sample.
    pub(crate) fn first(pass: &ForwardPass, loss: &BatchLoss, name: String) -> Self {
        let [_, _, height, width] = pass.targets.dims();
        let first = |t: &Tensor<4>| -> Vec<f32> {
            t.clone()
                .narrow(0, 0, 1)
                .into_data()
                .iter::<f32>()
                .collect()
        };
        Self {
            width,
            height,
            name,
            image: first(&pass.targets),
            disparity: first(&pass.disparities[0]),
            warped: first(&loss.warped),
            error: first(&loss.finest.error),
            mask: first(&loss.finest.explained.clone().float()),
            flow: pass.flows.first().map(|view| first(&view.flow)),
            moving: loss.moving.as_ref().map(|m| first(&m.clone().float())),
        }
    }
}
