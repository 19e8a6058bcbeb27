//! The output shape of an operation, and checks of its inputs.

use crate::{Conv, Depthwise, Op, ValueId, ValueShape};

/// The shape that `op` gives where these are the values before it; else why it does not fit them.
pub(crate) fn shape_after(shapes: &[ValueShape], op: &Op) -> Result<ValueShape, String> {
    let shape = |value: ValueId| {
        let known = shapes.get(value.0).copied();
        known.ok_or_else(|| format!("value {} does not exist yet", value.0))
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
            let halvings = halvings.ok_or("larger than the image")?;
            Ok(ValueShape { halvings, ..input })
        }
        Op::DepthToSpace { input } => after_depth_to_space(image(shape(*input)?)?),
        Op::ChannelNorm { input, epsilon } => {
            if !(*epsilon > 0.0 && epsilon.is_finite()) {
                return Err(format!("an epsilon of {epsilon}, expected above 0"));
            }
            image(shape(*input)?)
        }
        Op::CrossCovariance { input, temperature } => {
            let (input, heads) = (image(shape(*input)?)?, temperature.len());
            if heads == 0 || !input.channels.is_multiple_of(3 * heads) {
                let channels = input.channels;
                return Err(format!("{channels} channels for 3 times {heads} heads"));
            }
            Ok(ValueShape {
                channels: input.channels / 3,
                ..input
            })
        }
        Op::Position { per_axis, halvings } => {
            // More channels are no network's, and would not fit in memory.
            if !(1..=1024).contains(per_axis) {
                return Err(format!("{per_axis} channels an axis, expected 1 to 1024"));
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
            let halvings = halvings.ok_or("larger than the image")?;
            let large = ValueShape { halvings, ..input };
            match skip.map(shape).transpose()? {
                Some(skip) => appended(large, skip),
                None => Ok(large),
            }
        }
        Op::Concat { inputs } => {
            let (first, rest) = inputs.split_first().ok_or("nothing to concatenate")?;
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
                return Err(format!("a spatial mask of {spatial:?} on {input:?}"));
            }
            with_pixel(input, shape(*channel)?)
        }
        Op::AddPixel { input, pixel } => with_pixel(image(shape(*input)?)?, shape(*pixel)?),
        Op::Multiply { inputs } => alike(inputs.map(shape)),
        Op::Blend {
            state,
            candidate,
            share,
        } => alike([*state, *candidate, *share].map(shape)),
        Op::ConvexUpsample {
            input,
            weights,
            halvings,
        } => after_convex(image(shape(*input)?)?, shape(*weights)?, *halvings),
    }
}

/// The shape of all of them.
fn alike<const N: usize>(shapes: [Result<ValueShape, String>; N]) -> Result<ValueShape, String> {
    let mut shapes = shapes.into_iter();
    let first = image(shapes.next().ok_or("nothing to combine")??)?;
    for other in shapes {
        let other = other?;
        if other != first {
            return Err(format!("{other:?} combined with {first:?}"));
        }
    }
    Ok(first)
}

fn after_convex(
    input: ValueShape,
    weights: ValueShape,
    halvings: u32,
) -> Result<ValueShape, String> {
    if !(1..=3).contains(&halvings) {
        return Err(format!(
            "an enlargement by 2 to the {halvings}, expected 1 to 3"
        ));
    }
    if input.channels != 1 {
        return Err(format!(
            "{} channels enlarged, expected one",
            input.channels
        ));
    }
    let expected = ValueShape {
        channels: 9 << (2 * halvings),
        ..input
    };
    if weights != expected {
        return Err(format!("weights of {weights:?}, expected {expected:?}"));
    }
    let large = input.halvings.checked_sub(halvings);
    Ok(ValueShape {
        halvings: large.ok_or("larger than the image")?,
        ..input
    })
}

fn after_depth_to_space(input: ValueShape) -> Result<ValueShape, String> {
    if !input.channels.is_multiple_of(4) || input.channels == 0 {
        return Err(format!("{} channels for 2×2 pixels", input.channels));
    }
    let halvings = input.halvings.checked_sub(1);
    Ok(ValueShape {
        channels: input.channels / 4,
        halvings: halvings.ok_or("larger than the image")?,
        ..input
    })
}

fn after_depthwise(op: &Depthwise, input: ValueShape) -> Result<ValueShape, String> {
    let input = image(input)?;
    let area = op.kernel.checked_mul(op.kernel);
    let weights = area.and_then(|area| area.checked_mul(input.channels));
    let weights = weights.ok_or("more weights than any memory holds")?;
    if op.weight.len() != weights || op.bias.len() != input.channels {
        return Err(format!(
            "{weights} weights and {} biases expected, {} and {} given",
            input.channels,
            op.weight.len(),
            op.bias.len()
        ));
    }
    check_window(op.kernel, op.stride, op.dilation)?;
    Ok(ValueShape {
        halvings: halved(input.halvings, op.stride == 2)?,
        ..input
    })
}

fn check_window(kernel: usize, stride: usize, dilation: usize) -> Result<(), String> {
    if kernel.is_multiple_of(2) {
        return Err("kernels are odd, and there is at least one output".into());
    }
    if !matches!(stride, 1 | 2) {
        return Err(format!("stride {stride}, expected 1 or 2"));
    }
    // A border as wide as this is no network's; wider ones would not fit in memory.
    if dilation == 0 || dilation > 256 {
        return Err(format!("dilation {dilation}, expected 1 to 256"));
    }
    Ok(())
}

fn after_conv(
    conv: &Conv,
    input: ValueShape,
    residual: Option<ValueShape>,
) -> Result<ValueShape, String> {
    if conv.channels_in != input.channels {
        return Err(format!(
            "{} channels expected, its input has {}",
            conv.channels_in, input.channels
        ));
    }
    let parts = [conv.channels_in, conv.kernel, conv.kernel];
    let weights = parts
        .into_iter()
        .try_fold(conv.channels_out, usize::checked_mul);
    let weights = weights.ok_or("more weights than any memory holds")?;
    if conv.weight.len() != weights || conv.bias.len() != conv.channels_out {
        return Err(format!(
            "{} weights and {} biases expected, {} and {} given",
            weights,
            conv.channels_out,
            conv.weight.len(),
            conv.bias.len()
        ));
    }
    if conv.channels_out == 0 {
        return Err("kernels are odd, and there is at least one output".into());
    }
    check_window(conv.kernel, conv.stride, conv.dilation)?;
    if input.pooled && (conv.kernel > 1 || conv.stride > 1) {
        return Err("a single pixel takes a 1×1 kernel at stride 1".into());
    }
    let output = ValueShape {
        channels: conv.channels_out,
        halvings: halved(input.halvings, conv.stride == 2)?,
        pooled: input.pooled,
    };
    match residual {
        Some(residual) if residual.pooled => with_pixel(output, residual),
        Some(residual) if residual != output => {
            Err(format!("a residual of {residual:?} on {output:?}"))
        }
        _ => Ok(output),
    }
}

/// A value of which there is more than a pixel.
fn image(shape: ValueShape) -> Result<ValueShape, String> {
    if shape.pooled {
        return Err("a single pixel where an image is expected".into());
    }
    Ok(shape)
}

/// A value that a single pixel acts on.
fn with_pixel(input: ValueShape, pixel: ValueShape) -> Result<ValueShape, String> {
    if !pixel.pooled || pixel.channels != input.channels {
        return Err(format!("{pixel:?} at every pixel of {input:?}"));
    }
    Ok(input)
}

/// The channels of one value behind those of another.
fn appended(first: ValueShape, second: ValueShape) -> Result<ValueShape, String> {
    if (first.halvings, first.pooled) != (second.halvings, second.pooled) {
        return Err(format!("{second:?} appended to {first:?}"));
    }
    Ok(ValueShape {
        channels: first.channels + second.channels,
        ..first
    })
}

/// One halving more; no image is so large that it could be halved more often.
fn halved(halvings: u32, again: bool) -> Result<u32, String> {
    const MOST: u32 = 20;
    match halvings + u32::from(again) {
        n if n <= MOST => Ok(n),
        n => Err(format!("the {n}th halving of the image")),
    }
}
