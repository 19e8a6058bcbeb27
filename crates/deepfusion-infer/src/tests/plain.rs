//! A convolution in bf16 that reads exactly the elements that the fast forms read, in plain code, for processors and tools without their
//! instructions.

use rayon::prelude::*;

use crate::conv::{ConvForm, Geometry, Runs, padded_bias, weight};
use crate::element::{Bf16, Element};
use crate::tile::LANES;
use crate::view::Shared;
use crate::{Activation, Conv};

/// Reads like the dot products if `MULTIPLE` is 2, and like the matrix unit if it is 32.
#[derive(Debug)]
pub(super) struct Plain<const MULTIPLE: usize> {
    geometry: Geometry,
    runs: Runs,
    /// For each output channel: one weight for every input of every run.
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl<const MULTIPLE: usize> Plain<MULTIPLE> {
    /// Number of pixels that are read beyond one.
    const BEHIND: usize = if MULTIPLE == 32 { 15 } else { 0 };
}

impl<const MULTIPLE: usize> ConvForm<Bf16> for Plain<MULTIPLE> {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        let runs = match MULTIPLE {
            32 if channel_of.len() < 32 => Runs::new(&geometry, channel_of, usize::MAX, 32),
            32 => Runs::by_channels(&geometry, channel_of, 32),
            _ => Runs::new(&geometry, channel_of, 320, MULTIPLE),
        };
        let columns = conv.channels_out.next_multiple_of(LANES);
        let of = |o: usize| runs.sources.iter().map(move |s| weight(conv, o, *s));
        Self {
            weights: (0..columns).flat_map(of).collect(),
            bias: padded_bias(conv, columns),
            geometry,
            runs,
        }
    }

    fn overread(pitch: usize) -> usize {
        2 * Self::BEHIND * pitch + MULTIPLE - 1
    }

    fn name(&self) -> &'static str {
        "plain"
    }

    fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    fn reads_beyond_inputs(&self) -> Option<(&Geometry, &Runs)> {
        Some((&self.geometry, &self.runs))
    }

    unsafe fn run(&self, arena: Shared<Bf16>) {
        let (g, runs) = (&self.geometry, &self.runs);
        (0..g.out.height).into_par_iter().for_each(|y| {
            for x in 0..g.out.width {
                let behind = Self::BEHIND * g.stride * g.input.pitch;
                arena.at(g.first_tap(x, y), behind + runs.extent);
                // SAFETY: a pixel's inputs, which nobody writes, not even those that are multiplied by zero: the layout keeps them apart
                // from the output.
                let runs: Vec<&[Bf16]> = runs
                    .offsets
                    .iter()
                    .map(|run| unsafe { arena.read(g.first_tap(x, y) + run, runs.len) })
                    .collect();
                let sum = |o: usize| {
                    let weights = &self.weights[o * self.runs.sources.len()..];
                    let inputs = runs.iter().flat_map(|run| run.iter());
                    let sum: f32 = inputs.zip(weights).map(|(x, w)| x.value() * w).sum();
                    sum + self.bias[o]
                };
                if g.out.result {
                    // SAFETY: a pixel of the output, whose row is used by this task only.
                    let slots = unsafe { arena.write(g.out.at(x, y), 2) };
                    let bits = activated(g.activation, sum(0)).to_bits();
                    slots.copy_from_slice(&[Bf16(bits as u16), Bf16((bits >> 16) as u16)]);
                    continue;
                }
                for o in 0..self.bias.len() {
                    let mut value = sum(o);
                    if let Some(view) = &g.residual {
                        // SAFETY: a pixel of the residual, which nobody writes.
                        value += unsafe { arena.read(view.at(x, y) + o, 1) }[0].value();
                    }
                    // SAFETY: a pixel of the output, whose row is used by this task only.
                    let out = unsafe { arena.write(g.out.at(x, y) + o, 1) };
                    out[0] = Bf16::of(activated(g.activation, value));
                }
            }
        });
    }
}

fn activated(activation: Activation, v: f32) -> f32 {
    match activation {
        Activation::Identity => v,
        Activation::Relu if v < 0.0 => 0.0,
        Activation::Relu => v,
        Activation::Elu if v < 0.0 => v.exp_m1(),
        Activation::Elu => v,
        Activation::Sigmoid => 1.0 / (1.0 + (-v).exp()),
        Activation::Gelu => deepfusion_kernels::gelu_exact(f64::from(v)) as f32,
        Activation::LeakyRelu => v.max(0.01 * v),
        Activation::Tanh => v.tanh(),
    }
}
