//! R-MSFM's part of the graph: all refinements in turn, and the enlargement of the last one only.

use deepfusion_infer::{Activation, Border, Op, ValueId};

use super::{Builder, Layer, Offset};
use crate::{DepthNetConfig, NetworkError, R_MSFM_STATE, RMsfmConfig, RefinementInput};

/// The factor of a mask layer's output, which balances gradients as in RAFT.
const MASK_SCALE: f32 = 0.25;

/// Side of the square kernels into which 1×3 and 3×1 kernels are embedded.
const SQUARE: usize = 3;

impl Builder {
    /// The disparity at the image's size.
    pub(super) fn r_msfm(
        &mut self,
        config: &DepthNetConfig,
        r_msfm: &RMsfmConfig,
    ) -> Result<ValueId, NetworkError> {
        let features = self.encoder_to("r_msfm.encoder", &config.encoder, 2)?;
        let [f0, f1, f2] = [features[0], features[1], features[2]];
        let mut state = self.feature("coarse", f2, R_MSFM_STATE, 1)?;
        let start = config
            .initial_depth_m
            .map_or(0.0, |depth| config.range.logit_of(depth) as f32);
        let mut logit = self.everywhere("r_msfm.start", state, start)?;
        for index in 0..r_msfm.iterations {
            if index > 0 {
                let seen = match r_msfm.refinement_input(index) {
                    RefinementInput::Again(level) => self.second_input(level, state)?,
                    RefinementInput::Middle => self.feature("middle", f1, R_MSFM_STATE, 2)?,
                    RefinementInput::Fine => self.fine(f0)?,
                };
                state = self.gru(index, state, seen)?;
            }
            let (refined, seen) = self.refined(index, state, logit)?;
            logit = refined;
            if index + 1 == r_msfm.iterations {
                let weights = self.weights(seen)?;
                return self.enlarged(logit, weights);
            }
        }
        Ok(logit)
    }

    /// A layer of `features`: 3×3, tanh.
    fn feature(
        &mut self,
        name: &str,
        input: ValueId,
        channels: usize,
        stride: usize,
    ) -> Result<ValueId, NetworkError> {
        let path = format!("r_msfm.features.{name}");
        self.reflected(
            path.clone(),
            &path,
            (input, channels),
            (3, stride),
            &Activation::Tanh,
        )
    }

    fn fine(&mut self, input: ValueId) -> Result<ValueId, NetworkError> {
        let path = "r_msfm.features.fine_reduce";
        let small = self.reflected(
            path.into(),
            path,
            (input, 96),
            (3, 2),
            &Activation::LeakyRelu,
        )?;
        self.feature("fine", small, R_MSFM_STATE, 2)
    }

    /// The input of R-MSFM6's second refinement at a level, from the state: convolutions of 1×3 and 3×1, with tanh after each.
    fn second_input(&mut self, index: usize, input: ValueId) -> Result<ValueId, NetworkError> {
        let mut x = input;
        for strip in ["across", "down"] {
            let path = format!("r_msfm.features.context.{index}.{strip}");
            x = self.strip(path.clone(), &path, x, &Activation::Tanh)?;
        }
        Ok(x)
    }

    /// The gated recurrent unit, first along rows, then along columns.
    fn gru(
        &mut self,
        index: usize,
        state: ValueId,
        seen: ValueId,
    ) -> Result<ValueId, NetworkError> {
        let mut state = state;
        for strip in ["across", "down"] {
            let of = |part: &str| format!("r_msfm.gru.{strip}.{part}");
            let name = |part: &str| format!("r_msfm.gru.{index}.{strip}.{part}");
            let joined = self.push(
                name("joined"),
                Op::Concat {
                    inputs: vec![state, seen],
                },
            )?;
            let share = self.strip(name("update"), &of("update"), joined, &Activation::Sigmoid)?;
            let reset = self.strip(name("reset"), &of("reset"), joined, &Activation::Sigmoid)?;
            let kept = self.push(
                name("kept"),
                Op::Multiply {
                    inputs: [reset, state],
                },
            )?;
            let joined = self.push(
                name("candidate_of"),
                Op::Concat {
                    inputs: vec![kept, seen],
                },
            )?;
            let candidate = self.strip(
                name("candidate"),
                &of("candidate"),
                joined,
                &Activation::Tanh,
            )?;
            state = self.push(
                name("state"),
                Op::Blend {
                    state,
                    candidate,
                    share,
                },
            )?;
        }
        Ok(state)
    }

    /// The refined logit of the disparity, and the features that refined it.
    fn refined(
        &mut self,
        index: usize,
        state: ValueId,
        logit: ValueId,
    ) -> Result<(ValueId, ValueId), NetworkError> {
        let layer = |builder: &mut Self, part: &str, from: (ValueId, usize), kernel: usize| {
            let name = format!("r_msfm.update.{index}.{part}");
            builder.reflected(
                name,
                &format!("r_msfm.update.{part}"),
                from,
                (kernel, 1),
                &Activation::LeakyRelu,
            )
        };
        let seen = layer(self, "state_1", (state, 160), 3)?;
        let seen = layer(self, "state_2", (seen, 128), 3)?;
        let depth = layer(self, "disparity_1", (logit, 64), 7)?;
        let depth = layer(self, "disparity_2", (depth, 32), 3)?;
        let inputs = vec![seen, depth];
        let joined = self.push(format!("r_msfm.update.{index}.both"), Op::Concat { inputs })?;
        let joined = layer(self, "join", (joined, 191), 3)?;
        let inputs = vec![joined, logit];
        let seen = self.push(format!("r_msfm.update.{index}.seen"), Op::Concat { inputs })?;
        let change = layer(self, "change_1", (seen, 256), 3)?;
        let (weight, bias) = self.copied("r_msfm.update.change_2", &[1, 256, 3, 3])?;
        let last = Layer {
            border: Border::Reflect,
            residual: Some(logit),
            ..plain(
                format!("r_msfm.update.{index}.change_2"),
                change,
                [256, 1],
                3,
            )
        };
        Ok((self.conv_with(&last, weight, bias)?, seen))
    }

    /// Logarithmic weights of each pixel's neighbours.
    fn weights(&mut self, seen: ValueId) -> Result<ValueId, NetworkError> {
        let path = "r_msfm.weights.reduce";
        let x = self.reflected(
            path.into(),
            path,
            (seen, 324),
            (3, 1),
            &Activation::LeakyRelu,
        )?;
        let path = "r_msfm.weights.expand";
        let (mut weight, mut bias) = self.copied(path, &[576, 324, 1, 1])?;
        for value in weight.iter_mut().chain(&mut bias) {
            *value *= MASK_SCALE;
        }
        self.conv_with(&plain(path.into(), x, [324, 576], 1), weight, bias)
    }

    fn enlarged(&mut self, logit: ValueId, weights: ValueId) -> Result<ValueId, NetworkError> {
        let sigmoid = Layer {
            activation: &Activation::Sigmoid,
            ..plain("r_msfm.sigmoid".into(), logit, [1, 1], 1)
        };
        let input = self.conv_with(&sigmoid, vec![1.0], vec![0.0])?;
        let halvings = self.graph.shape(input).halvings;
        let op = Op::ConvexUpsample {
            input,
            weights,
            halvings,
        };
        self.push("r_msfm.enlarge".into(), op)
    }

    /// A constant at every pixel of a value's size.
    fn everywhere(
        &mut self,
        name: &str,
        like: ValueId,
        number: f32,
    ) -> Result<ValueId, NetworkError> {
        let channels = self.graph.shape(like).channels;
        let layer = plain(name.into(), like, [channels, 1], 1);
        self.conv_with(&layer, vec![0.0; channels], vec![number])
    }

    /// A convolution with reflection padding and a copy of the weights at `path`.
    fn reflected(
        &mut self,
        name: String,
        path: &str,
        (input, channels): (ValueId, usize),
        (kernel, stride): (usize, usize),
        activation: &Activation,
    ) -> Result<ValueId, NetworkError> {
        let from = self.graph.shape(input).channels;
        let (weight, bias) = self.copied(path, &[channels, from, kernel, kernel])?;
        let layer = Layer {
            stride,
            border: Border::Reflect,
            activation,
            ..plain(name, input, [from, channels], kernel)
        };
        self.conv_with(&layer, weight, bias)
    }

    /// A 1×3 or 3×1 convolution with zero padding, as a 3×3 of which six taps are zero.
    fn strip(
        &mut self,
        name: String,
        path: &str,
        input: ValueId,
        activation: &Activation,
    ) -> Result<ValueId, NetworkError> {
        let (from, to) = (self.graph.shape(input).channels, R_MSFM_STATE);
        let down = path.contains("down");
        let shape = if down {
            [to, from, SQUARE, 1]
        } else {
            [to, from, 1, SQUARE]
        };
        let (strip, bias) = self.copied(path, &shape)?;
        let mut weight = vec![0.0; to * from * SQUARE * SQUARE];
        for (square, strip) in weight
            .chunks_exact_mut(SQUARE * SQUARE)
            .zip(strip.chunks_exact(SQUARE))
        {
            for (i, value) in strip.iter().enumerate() {
                // The middle row or the middle column.
                square[if down { SQUARE * i + 1 } else { SQUARE + i }] = *value;
            }
        }
        let layer = Layer {
            activation,
            ..plain(name, input, [from, to], SQUARE)
        };
        self.conv_with(&layer, weight, bias)
    }

    /// A layer's weights and bias, copied because later refinements use them too.
    fn copied(
        &mut self,
        path: &str,
        shape: &[usize],
    ) -> Result<(Vec<f32>, Vec<f32>), NetworkError> {
        let weight = self.copy(format!("{path}.weight"), shape)?;
        Ok((weight, self.copy(format!("{path}.bias"), &shape[..1])?))
    }

    fn copy(&mut self, name: String, shape: &[usize]) -> Result<Vec<f32>, NetworkError> {
        if let Some(values) = self.repeated.get(&name) {
            return Ok(values.clone());
        }
        let values = self.take(&name, shape)?;
        self.repeated.insert(name, values.clone());
        Ok(values)
    }
}

/// A convolution of stride 1 with zero padding.
fn plain(name: String, input: ValueId, channels: [usize; 2], kernel: usize) -> Layer<'static> {
    Layer {
        name,
        offset: Offset::Bias,
        input,
        channels,
        kernel,
        stride: 1,
        dilation: 1,
        border: Border::Zero,
        residual: None,
        activation: &Activation::Identity,
    }
}
