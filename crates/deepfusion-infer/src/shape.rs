//! The output shape of an operation, and checks of its inputs.

use crate::{Conv, Depthwise, GraphProblem, Misfit, Op, ValueId, ValueShape};

/// A shape, or why the operation does not fit.
type Shape = Result<ValueShape, GraphProblem>;

/// The output shape of `op`, given the shapes of the values before it; or why the operation does not fit them.
pub(crate) fn shape_after(shapes: &[ValueShape], op: &Op) -> Shape {
    let shape = |value: ValueId| {
        let known = shapes.get(value.0).copied();
        known.ok_or(GraphProblem::NoSuchValue { value: value.0 })
    };
    match op {
        Op::Conv(conv) => {
            let residual = conv.residual.map(shape).transpose()?;
            after_conv(conv, shape(conv.input)?, residual)
        }
        Op::Depthwise(op) => after_depthwise(op, shape(op.input)?),
        Op::Enlarge { input } => {
            let input = image(shape(*input)?)?;
            let halvings = input.halvings.checked_sub(1);
            let halvings = halvings.ok_or(GraphProblem::LargerThanImage)?;
            Ok(ValueShape { halvings, ..input })
        }
        Op::DepthToSpace { input } => after_depth_to_space(image(shape(*input)?)?),
        Op::ChannelNorm { input, epsilon } => {
            if !(*epsilon > 0.0 && epsilon.is_finite()) {
                return Err(GraphProblem::Epsilon { epsilon: *epsilon });
            }
            image(shape(*input)?)
        }
        Op::CrossCovariance { input, temperature } => {
            let (input, heads) = (image(shape(*input)?)?, temperature.len());
            if heads == 0 || !input.channels.is_multiple_of(3 * heads) {
                let channels = input.channels;
                return Err(GraphProblem::Heads { channels, heads });
            }
            Ok(ValueShape {
                channels: input.channels / 3,
                ..input
            })
        }
        Op::Position { per_axis, halvings } => {
            // More channels are implausible, and would not fit in memory.
            if !(1..=1024).contains(per_axis) {
                return Err(GraphProblem::PositionChannels {
                    per_axis: *per_axis,
                });
            }
            Ok(ValueShape {
                channels: 2 * per_axis,
                halvings: halved(*halvings, false)?,
                pooled: false,
            })
        }
        Op::MaxPool { input } => {
            let input = image(shape(*input)?)?;
            Ok(ValueShape {
                halvings: halved(input.halvings, true)?,
                ..input
            })
        }
        Op::UpsampleConcat { input, skip } => {
            let input = image(shape(*input)?)?;
            let halvings = input.halvings.checked_sub(1);
            let halvings = halvings.ok_or(GraphProblem::LargerThanImage)?;
            let large = ValueShape { halvings, ..input };
            match skip.map(shape).transpose()? {
                Some(skip) => appended(large, skip),
                None => Ok(large),
            }
        }
        Op::Concat { inputs } => {
            let (first, rest) = inputs.split_first().ok_or(GraphProblem::NoInput)?;
            rest.iter()
                .try_fold(shape(*first)?, |all, next| appended(all, shape(*next)?))
        }
        Op::GlobalMean { input } => Ok(ValueShape {
            halvings: 0,
            pooled: true,
            ..image(shape(*input)?)?
        }),
        Op::ChannelExtent { input } => Ok(ValueShape {
            channels: 2,
            ..image(shape(*input)?)?
        }),
        Op::Gate {
            input,
            spatial,
            channel,
            ..
        } => {
            let input = image(shape(*input)?)?;
            let spatial = shape(*spatial)?;
            if spatial
                != (ValueShape {
                    channels: 1,
                    ..input
                })
            {
                return Err(Misfit::SpatialMask {
                    mask: spatial,
                    input,
                }
                .into());
            }
            with_pixel(input, shape(*channel)?)
        }
        Op::AddPixel { input, pixel } => with_pixel(image(shape(*input)?)?, shape(*pixel)?),
        Op::Multiply {
            inputs: [first, second],
        } => alike(shape(*first)?, [shape(*second)?]),
        Op::Blend {
            state,
            candidate,
            share,
        } => alike(shape(*state)?, [shape(*candidate)?, shape(*share)?]),
        Op::ConvexUpsample {
            input,
            weights,
            halvings,
        } => after_convex(image(shape(*input)?)?, shape(*weights)?, *halvings),
    }
}

/// The shape that all values must have.
fn alike<const N: usize>(first: ValueShape, others: [ValueShape; N]) -> Shape {
    let first = image(first)?;
    match others.into_iter().find(|other| *other != first) {
        Some(other) => Err(Misfit::Combined { other, first }.into()),
        None => Ok(first),
    }
}

fn after_convex(input: ValueShape, weights: ValueShape, halvings: u32) -> Shape {
    if !(1..=3).contains(&halvings) {
        return Err(GraphProblem::Enlargement { halvings });
    }
    if input.channels != 1 {
        return Err(GraphProblem::EnlargedChannels {
            channels: input.channels,
        });
    }
    let expected = ValueShape {
        channels: 9 << (2 * halvings),
        ..input
    };
    if weights != expected {
        return Err(Misfit::ConvexWeights {
            expected,
            found: weights,
        }
        .into());
    }
    let large = input.halvings.checked_sub(halvings);
    Ok(ValueShape {
        halvings: large.ok_or(GraphProblem::LargerThanImage)?,
        ..input
    })
}

fn after_depth_to_space(input: ValueShape) -> Shape {
    if !input.channels.is_multiple_of(4) || input.channels == 0 {
        return Err(GraphProblem::ChannelsForPixels {
            channels: input.channels,
        });
    }
    let halvings = input.halvings.checked_sub(1);
    Ok(ValueShape {
        channels: input.channels / 4,
        halvings: halvings.ok_or(GraphProblem::LargerThanImage)?,
        ..input
    })
}

fn after_depthwise(op: &Depthwise, input: ValueShape) -> Shape {
    let input = image(input)?;
    let area = op.kernel.checked_mul(op.kernel);
    let weights = area.and_then(|area| area.checked_mul(input.channels));
    let weights = weights.ok_or(GraphProblem::TooManyWeights)?;
    if op.weight.len() != weights || op.bias.len() != input.channels {
        return Err(GraphProblem::Weights {
            expected: [weights, input.channels],
            found: [op.weight.len(), op.bias.len()],
        });
    }
    check_window(op.kernel, op.stride, op.dilation)?;
    Ok(ValueShape {
        halvings: halved(input.halvings, op.stride == 2)?,
        ..input
    })
}

fn check_window(kernel: usize, stride: usize, dilation: usize) -> Result<(), GraphProblem> {
    if kernel.is_multiple_of(2) {
        return Err(GraphProblem::EvenKernelOrNoOutput);
    }
    if !matches!(stride, 1 | 2) {
        return Err(GraphProblem::Stride { stride });
    }
    // A wider border is implausible, and would not fit in memory.
    if dilation == 0 || dilation > 256 {
        return Err(GraphProblem::Dilation { dilation });
    }
    Ok(())
}

fn after_conv(conv: &Conv, input: ValueShape, residual: Option<ValueShape>) -> Shape {
    if conv.channels_in != input.channels {
        return Err(GraphProblem::Channels {
            expected: conv.channels_in,
            found: input.channels,
        });
    }
    let parts = [conv.channels_in, conv.kernel, conv.kernel];
    let weights = parts
        .into_iter()
        .try_fold(conv.channels_out, usize::checked_mul);
    let weights = weights.ok_or(GraphProblem::TooManyWeights)?;
    if conv.weight.len() != weights || conv.bias.len() != conv.channels_out {
        return Err(GraphProblem::Weights {
            expected: [weights, conv.channels_out],
            found: [conv.weight.len(), conv.bias.len()],
        });
    }
    if conv.channels_out == 0 {
        return Err(GraphProblem::EvenKernelOrNoOutput);
    }
    check_window(conv.kernel, conv.stride, conv.dilation)?;
    if input.pooled && (conv.kernel > 1 || conv.stride > 1) {
        return Err(GraphProblem::WindowOnPixel);
    }
    let output = ValueShape {
        channels: conv.channels_out,
        halvings: halved(input.halvings, conv.stride == 2)?,
        pooled: input.pooled,
    };
    match residual {
        Some(residual) if residual.pooled => with_pixel(output, residual),
        Some(residual) if residual != output => Err(Misfit::Residual { residual, output }.into()),
        _ => Ok(output),
    }
}

/// Checks that a value is an image, not a single pixel.
fn image(shape: ValueShape) -> Shape {
    if shape.pooled {
        return Err(GraphProblem::SinglePixel);
    }
    Ok(shape)
}

/// Checks that `pixel` is a single pixel that can be applied to a value.
fn with_pixel(input: ValueShape, pixel: ValueShape) -> Shape {
    if !pixel.pooled || pixel.channels != input.channels {
        return Err(Misfit::Pixel { pixel, input }.into());
    }
    Ok(input)
}

/// The shape of two values whose channels are concatenated.
fn appended(first: ValueShape, second: ValueShape) -> Shape {
    if (first.halvings, first.pooled) != (second.halvings, second.pooled) {
        return Err(Misfit::Appended { second, first }.into());
    }
    Ok(ValueShape {
        channels: first.channels + second.channels,
        ..first
    })
}

/// One more halving, if an image can be halved that often.
fn halved(halvings: u32, again: bool) -> Result<u32, GraphProblem> {
    const MOST: u32 = 20;
    match halvings + u32::from(again) {
        n if n <= MOST => Ok(n),
        halvings => Err(GraphProblem::Halvings { halvings }),
    }
}
