//! The arithmetic of a product over taps: f32, or pairs of bf16. It determines the layout of channels in a tile's planes, the layout of
//! weights, and the multiples of rows and columns.

use super::ConvShape;
use super::bf16::{self, TapPairs, Unit};
use super::lattice::{Lattice, gather_channels};
use super::product::{self, TapProduct};
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use rayon::prelude::*;

/// Buffers are measured in words of 32 bits: a float, or a pair of bf16.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arithmetic {
    Single,
    Pairs(Unit),
}

/// The weights of a product, in the layout of a convolution's weights.
#[derive(Clone, Copy)]
pub(super) struct Weights<'a> {
    pub(super) values: &'a [f32],
    /// Distance from one row to the next, and from one channel to the next.
    pub(super) strides: (usize, usize),
    /// Number of channels that are summed over.
    pub(super) channels: usize,
    /// Indices of the taps within a channel's weights.
    pub(super) taps: &'a [usize],
}

/// A product over all taps of all channels of a tile.
pub(super) struct Product<'a> {
    /// Written by [`Arithmetic::prepare`].
    pub(super) weights: &'a [f32],
    pub(super) rows: usize,
    /// Number of channels that are summed over.
    pub(super) channels: usize,
    /// From [`Arithmetic::offsets`].
    pub(super) offsets: &'a [usize],
    pub(super) plane_len: usize,
    /// Written by [`Arithmetic::gather`].
    pub(super) source: &'a [f32],
    pub(super) columns: usize,
    /// `rows` × `columns`.
    pub(super) out: &'a mut [f32],
}

impl Arithmetic {
    pub(super) fn of(shape: &ConvShape) -> Self {
        Unit::of(shape).map_or(Self::Single, Self::Pairs)
    }

    /// The number of rows of a task should be a multiple of this.
    pub(super) fn rows(self) -> usize {
        match self {
            Self::Single => 8,
            Self::Pairs(_) => 2 * bf16::ROWS,
        }
    }

    /// Number of columns of a product over a whole tile.
    pub(super) fn columns(self, lattice: &Lattice) -> usize {
        match self {
            Self::Single => product::padded(lattice.columns()),
            Self::Pairs(_) => lattice.columns().next_multiple_of(bf16::COLUMNS),
        }
    }

    /// Number of words of a tile's planes.
    pub(super) fn source_len(self, channels: usize, plane_len: usize) -> usize {
        match self {
            Self::Single => channels * plane_len,
            Self::Pairs(_) => channels / 2 * plane_len,
        }
    }

    /// Number of words of a row's weights.
    pub(super) fn row_len(self, channels: usize, taps: usize) -> usize {
        match self {
            Self::Single => channels * taps,
            Self::Pairs(_) => channels / 2 * taps,
        }
    }

    /// Copies all `channels` channels of the tile's images of `x` into padded planes.
    pub(super) fn gather(self, lattice: &Lattice, x: &[f32], channels: usize, planes: &mut [f32]) {
        let area = lattice.image_area();
        let image = |channel: usize| move |n: usize| &x[(n * channels + channel) * area..][..area];
        match self {
            Self::Single => gather_channels(lattice, x, channels, 0..channels, planes),
            Self::Pairs(_) => {
                let planes = cast_slice_mut(planes).chunks_exact_mut(lattice.plane_len);
                for (pair, plane) in planes.enumerate() {
                    lattice.gather_pairs(image(2 * pair), image(2 * pair + 1), plane);
                }
            }
        }
    }

    /// Offsets that a product reads at, given the channels' planes one after the other and each tap's offset in the first.
    pub(super) fn offsets(self, channels: usize, plane_len: usize, taps: &[usize]) -> Vec<usize> {
        let (steps, step_len) = match self {
            Self::Single => (channels, plane_len),
            Self::Pairs(_) => {
                let pairs = bf16::pairs_of(channels);
                (channels / 2 / pairs, pairs * plane_len)
            }
        };
        (0..steps)
            .flat_map(|step| taps.iter().map(move |tap| step * step_len + tap))
            .collect()
    }

    /// Rearranges weights for products: [`Self::row_len`] words for each row, all of which are written.
    pub(super) fn prepare(self, weights: Weights, to: &mut [f32]) {
        match self {
            Self::Single => copy(weights, to),
            Self::Pairs(_) => {
                let pairs = bf16::pairs_of(weights.channels);
                bf16::pack_weights(weights, pairs, cast_slice_mut(to));
            }
        }
    }

    pub(super) fn product(self, product: Product) {
        let Product {
            weights,
            rows,
            channels,
            offsets,
            plane_len,
            source,
            columns,
            out,
        } = product;
        match self {
            Self::Single => TapProduct {
                weights,
                weight_stride: offsets.len(),
                offsets,
                source,
                columns,
                out,
                rows,
            }
            .run(),
            Self::Pairs(unit) => TapPairs {
                weights: cast_slice(weights),
                offsets,
                pairs: bf16::pairs_of(channels),
                plane_len,
                source: cast_slice(source),
                columns,
                out,
                rows,
            }
            .run(unit),
        }
    }
}

/// Rows × (channels · taps).
fn copy(weights: Weights, to: &mut [f32]) {
    /// Rows of a task: a channel's weights of these rows are near each other in memory.
    const GROUP: usize = 8;
    let Weights {
        values,
        strides: (row_stride, channel_stride),
        channels,
        taps,
        ..
    } = weights;
    let len = channels * taps.len();
    to.par_chunks_mut(GROUP * len)
        .enumerate()
        .for_each(|(group, to)| {
            for channel in 0..channels {
                for (row, to) in to.chunks_exact_mut(len).enumerate() {
                    let from = (group * GROUP + row) * row_stride + channel * channel_stride;
                    let from = &values[from..];
                    let to = &mut to[channel * taps.len()..][..taps.len()];
                    if let (Some(to), Some(from)) =
                        (to.as_mut_array::<9>(), from.first_chunk::<9>())
                        && taps.last() == Some(&8)
                    {
                        // The usual 3×3: a copy of fixed length compiles without a call.
                        *to = *from;
                    } else {
                        for (to, tap) in to.iter_mut().zip(taps) {
                            *to = from[*tap];
                        }
                    }
                }
            }
        });
}
