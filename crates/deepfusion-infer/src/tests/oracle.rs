//! Reference implementations of the operations, in f64.

use crate::{Activation, Border, Conv, Depthwise, Graph, Op};

/// Channels × height × width.
#[derive(Clone)]
pub(super) struct Image {
    pub(super) channels: usize,
    pub(super) height: usize,
    pub(super) width: usize,
    pub(super) data: Vec<f64>,
}

impl Image {
    fn from_fn(
        channels: usize,
        height: usize,
        width: usize,
        f: impl Fn(usize, usize, usize) -> f64,
    ) -> Self {
        let mut data = Vec::with_capacity(channels * height * width);
        for c in 0..channels {
            for y in 0..height {
                data.extend((0..width).map(|x| f(c, y, x)));
            }
        }
        Self {
            channels,
            height,
            width,
            data,
        }
    }

    fn at(&self, c: usize, y: usize, x: usize) -> f64 {
        self.data[(c * self.height + y) * self.width + x]
    }

    /// A pixel's value; a single pixel is the same everywhere.
    fn near(&self, c: usize, y: usize, x: usize) -> f64 {
        self.at(c, y.min(self.height - 1), x.min(self.width - 1))
    }
}

fn conv(conv: &Conv, values: &[Image]) -> Image {
    let input = &values[conv.input.0];
    let half = conv.reach() as isize;
    // The index that a tap reads; `None` for zeros.
    let place = |i: isize, n: usize| {
        let n = n as isize;
        match conv.border {
            _ if (0..n).contains(&i) => Some(i as usize),
            Border::Zero => None,
            Border::Reflect if i < 0 => Some((-i) as usize),
            Border::Reflect => Some((2 * (n - 1) - i) as usize),
        }
    };
    let halved = |side: usize| side.div_ceil(conv.stride);
    let (h, w) = (halved(input.height), halved(input.width));
    Image::from_fn(conv.channels_out, h, w, |o, y, x| {
        let mut sum = f64::from(conv.bias[o]);
        for c in 0..conv.channels_in {
            for ky in 0..conv.kernel {
                for kx in 0..conv.kernel {
                    let tap_at = |i: usize, k: usize, n| {
                        place((i * conv.stride + k * conv.dilation) as isize - half, n)
                    };
                    let places = (tap_at(y, ky, input.height), tap_at(x, kx, input.width));
                    if let (Some(i), Some(j)) = places {
                        let tap =
                            ((o * conv.channels_in + c) * conv.kernel + ky) * conv.kernel + kx;
                        sum += f64::from(conv.weight[tap]) * input.at(c, i, j);
                    }
                }
            }
        }
        sum += conv.residual.map_or(0.0, |r| values[r.0].near(o, y, x));
        match conv.activation {
            Activation::Identity => sum,
            Activation::Relu => sum.max(0.0),
            Activation::Elu if sum < 0.0 => sum.exp_m1(),
            Activation::Elu => sum,
            Activation::Sigmoid => 1.0 / (1.0 + (-sum).exp()),
            Activation::Gelu => deepfusion_kernels::gelu_exact(sum),
            Activation::LeakyRelu => sum.max(0.01 * sum),
            Activation::Tanh => sum.tanh(),
        }
    })
}

fn depthwise(op: &Depthwise, input: &Image) -> Image {
    let half = op.reach() as isize;
    let (h, w) = (input.height / op.stride, input.width / op.stride);
    Image::from_fn(input.channels, h, w, |c, y, x| {
        let mut sum = f64::from(op.bias[c]);
        for ky in 0..op.kernel {
            for kx in 0..op.kernel {
                let at = |i: usize, k: usize, n: usize| {
                    let i = (i * op.stride + k * op.dilation) as isize - half;
                    (0..n as isize).contains(&i).then_some(i as usize)
                };
                if let (Some(i), Some(j)) = (at(y, ky, input.height), at(x, kx, input.width)) {
                    let tap = (c * op.kernel + ky) * op.kernel + kx;
                    sum += f64::from(op.weight[tap]) * input.at(c, i, j);
                }
            }
        }
        sum
    })
}

/// Half-pixel centres: output pixel i is at (i + ½)/2 − ½ of the input.
fn enlarged(v: &Image) -> Image {
    let around = |i: usize, n: usize| {
        let place = ((i as f64 + 0.5) / 2.0 - 0.5).clamp(0.0, (n - 1) as f64);
        let low = place.floor() as usize;
        (low, (low + 1).min(n - 1), place - low as f64)
    };
    Image::from_fn(v.channels, v.height * 2, v.width * 2, |c, y, x| {
        let (top, bottom, down) = around(y, v.height);
        let (left, right, across) = around(x, v.width);
        let along = |y| v.at(c, y, left) * (1.0 - across) + v.at(c, y, right) * across;
        along(top) * (1.0 - down) + along(bottom) * down
    })
}

/// Each pixel, by the softmax of its nine weights.
fn convex(v: &Image, weights: &Image, side: usize) -> Image {
    Image::from_fn(1, v.height * side, v.width * side, |_, y, x| {
        let (row, column) = (y / side, x / side);
        let within = y % side * side + x % side;
        let (mut sum, mut total) = (0.0, 0.0);
        for tap in 0..9 {
            let share = weights.at(tap * side * side + within, row, column).exp();
            total += share;
            let (down, across) = (row + tap / 3, column + tap % 3);
            let inside = (1..=v.height).contains(&down) && (1..=v.width).contains(&across);
            if inside {
                sum += share * v.at(0, down - 1, across - 1);
            }
        }
        sum / total
    })
}

fn channel_norm(v: &Image, epsilon: f32) -> Image {
    Image::from_fn(v.channels, v.height, v.width, |c, y, x| {
        let along = || (0..v.channels).map(|k| v.at(k, y, x));
        let mean = along().sum::<f64>() / v.channels as f64;
        let squares = along().map(|value| (value - mean).powi(2));
        let variance = squares.sum::<f64>() / v.channels as f64;
        (v.at(c, y, x) - mean) / (variance + f64::from(epsilon)).sqrt()
    })
}

fn cross_covariance(v: &Image, temperature: &[f32]) -> Image {
    let (channels, area) = (v.channels / 3, v.height * v.width);
    let each = channels / temperature.len();
    let plane = |c: usize| &v.data[c * area..][..area];
    let dot = |a: usize, b: usize| -> f64 {
        let pairs = plane(a).iter().zip(plane(b));
        pairs.map(|(a, b)| a * b).sum()
    };
    let shares: Vec<Vec<f64>> = (0..channels)
        .map(|c| {
            let head = c / each;
            let others = head * each..(head + 1) * each;
            let similar = others.map(|k| {
                let k = channels + k;
                f64::from(temperature[head]) * dot(c, k) / (dot(c, c) * dot(k, k)).sqrt()
            });
            let similar: Vec<f64> = similar.map(f64::exp).collect();
            let sum: f64 = similar.iter().sum();
            similar.iter().map(|s| s / sum).collect()
        })
        .collect();
    Image::from_fn(channels, v.height, v.width, |c, y, x| {
        let first = 2 * channels + c / each * each;
        let shares = shares[c].iter().enumerate();
        shares.map(|(k, share)| share * v.at(first + k, y, x)).sum()
    })
}

/// All values of the graph.
pub(super) fn run(graph: &Graph, image: &[f32], height: usize, width: usize) -> Vec<Image> {
    let mut values = vec![Image::from_fn(3, height, width, |c, y, x| {
        let value = f64::from(image[(c * height + y) * width + x]);
        (value - f64::from(graph.mean()[c])) / f64::from(graph.std()[c])
    })];
    for node in graph.nodes() {
        let value = match &node.op {
            Op::Conv(op) => conv(op, &values),
            Op::Depthwise(op) => depthwise(op, &values[op.input.0]),
            Op::Enlarge { input } => enlarged(&values[input.0]),
            Op::ChannelNorm { input, epsilon } => channel_norm(&values[input.0], *epsilon),
            Op::CrossCovariance { input, temperature } => {
                cross_covariance(&values[input.0], temperature)
            }
            Op::Position { per_axis, halvings } => {
                let (h, w) = (height >> halvings, width >> halvings);
                let code = deepfusion_kernels::position_code(*per_axis, h, w);
                Image::from_fn(2 * per_axis, h, w, |c, y, x| {
                    f64::from(code[(c * h + y) * w + x])
                })
            }
            Op::MaxPool { input } => {
                let v = &values[input.0];
                Image::from_fn(v.channels, v.height / 2, v.width / 2, |c, y, x| {
                    let around = |i: usize, n: usize| (2 * i).saturating_sub(1)..(2 * i + 2).min(n);
                    around(y, v.height)
                        .flat_map(|i| around(x, v.width).map(move |j| (i, j)))
                        .map(|(i, j)| v.at(c, i, j))
                        .fold(f64::NEG_INFINITY, f64::max)
                })
            }
            Op::UpsampleConcat { input, skip } => {
                let v = &values[input.0];
                let skip = skip.map(|s| &values[s.0]);
                let channels = v.channels + skip.map_or(0, |s| s.channels);
                Image::from_fn(channels, v.height * 2, v.width * 2, |c, y, x| match skip {
                    Some(skip) if c >= v.channels => skip.at(c - v.channels, y, x),
                    _ => v.at(c, y / 2, x / 2),
                })
            }
            Op::Concat { inputs } => {
                let parts: Vec<_> = inputs.iter().map(|v| &values[v.0]).collect();
                let data: Vec<f64> = parts.iter().flat_map(|p| p.data.clone()).collect();
                Image {
                    channels: parts.iter().map(|p| p.channels).sum(),
                    data,
                    ..*parts[0]
                }
            }
            Op::GlobalMean { input } => {
                let v = &values[input.0];
                let area = v.height * v.width;
                Image::from_fn(v.channels, 1, 1, |c, _, _| {
                    v.data[c * area..][..area].iter().sum::<f64>() / area as f64
                })
            }
            Op::ChannelExtent { input } => {
                let v = &values[input.0];
                Image::from_fn(2, v.height, v.width, |c, y, x| {
                    let along = (0..v.channels).map(|k| v.at(k, y, x));
                    if c == 0 {
                        along.sum::<f64>() / v.channels as f64
                    } else {
                        along.fold(f64::NEG_INFINITY, f64::max)
                    }
                })
            }
            Op::Gate {
                input,
                spatial,
                channel,
                residual,
            } => {
                let [v, s, m] = [input, spatial, channel].map(|v| &values[v.0]);
                let shift = if *residual { 1.0 } else { 0.0 };
                Image::from_fn(v.channels, v.height, v.width, |c, y, x| {
                    v.at(c, y, x) * (shift + s.at(0, y, x) * m.at(c, 0, 0))
                })
            }
            Op::Multiply { inputs } => {
                let [a, b] = inputs.map(|v| &values[v.0]);
                Image::from_fn(a.channels, a.height, a.width, |c, y, x| {
                    a.at(c, y, x) * b.at(c, y, x)
                })
            }
            Op::Blend {
                state,
                candidate,
                share,
            } => {
                let [h, q, z] = [state, candidate, share].map(|v| &values[v.0]);
                Image::from_fn(h.channels, h.height, h.width, |c, y, x| {
                    let share = z.at(c, y, x);
                    (1.0 - share) * h.at(c, y, x) + share * q.at(c, y, x)
                })
            }
            Op::ConvexUpsample {
                input,
                weights,
                halvings,
            } => convex(&values[input.0], &values[weights.0], 1 << halvings),
            Op::DepthToSpace { input } => {
                let shape = graph.shape(crate::ValueId(values.len()));
                let (w, h) = shape.size(width, height);
                let v = &values[input.0];
                Image::from_fn(shape.channels, h, w, |c, y, x| {
                    let part = 2 * (y % 2) + x % 2;
                    v.at(part * shape.channels + c, y / 2, x / 2)
                })
            }
            Op::AddPixel { input, pixel } => {
                let (v, p) = (&values[input.0], &values[pixel.0]);
                Image::from_fn(v.channels, v.height, v.width, |c, y, x| {
                    v.at(c, y, x) + p.at(c, 0, 0)
                })
            }
        };
        values.push(value);
    }
    values
}
