//! Tensors as bytes: matrices and kernels in bf16, vectors in f32.

use safetensors::tensor::{Dtype, TensorView};

use crate::Error;

/// The number formats of [`pack`], as stated in cards.
pub const NUMBERS: &str = "bf16, tensors of one dimension f32";

/// A tensor to be packed.
#[derive(Debug, Clone, Copy)]
pub struct Tensor<'a> {
    /// Its name in the network, such as `encoder.layer1.0.conv1.weight`.
    pub name: &'a str,
    /// Shape, outermost dimension first.
    pub shape: &'a [usize],
    /// The values, row-major; their number is the product of `shape`.
    pub values: &'a [f32],
}

/// The tensors as a safetensors file. One-dimensional tensors (biases and batch-norm parameters) stay f32: they act on whole channels and
/// are small. All others are rounded to the nearest bf16, ties to even. Equal tensors give equal bytes, in whatever order they are.
///
/// # Errors
/// [`Error::Value`] naming a tensor with a value that is not finite or too large for bf16; [`Error::Tensors`] for a shape that
/// does not match its values.
pub fn pack(tensors: &[Tensor]) -> Result<Vec<u8>, Error> {
    let mut packed = Vec::with_capacity(tensors.len());
    for tensor in tensors {
        let (dtype, bytes) = match tensor.shape.len() {
            0 | 1 => (Dtype::F32, as_f32(tensor)?),
            _ => (Dtype::BF16, as_bf16(tensor)?),
        };
        packed.push((tensor, dtype, bytes));
    }
    let failed = |source| Error::Tensors { source };
    let mut views = Vec::with_capacity(packed.len());
    for (tensor, dtype, bytes) in &packed {
        let view = TensorView::new(*dtype, tensor.shape.to_vec(), bytes).map_err(failed)?;
        views.push((tensor.name, view));
    }
    // No metadata: its entries have no fixed order, and the card has all information.
    safetensors::serialize(views, None).map_err(failed)
}

fn as_f32(tensor: &Tensor) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::with_capacity(4 * tensor.values.len());
    for value in tensor.values {
        if !value.is_finite() {
            return Err(refused(tensor, *value));
        }
        bytes.extend(value.to_le_bytes());
    }
    Ok(bytes)
}

fn as_bf16(tensor: &Tensor) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::with_capacity(2 * tensor.values.len());
    for value in tensor.values {
        let short = bf16(*value).ok_or_else(|| refused(tensor, *value))?;
        bytes.extend(short.to_le_bytes());
    }
    Ok(bytes)
}

fn refused(tensor: &Tensor, value: f32) -> Error {
    Error::Value {
        tensor: tensor.name.to_owned(),
        value,
    }
}

/// The bits of the nearest bf16, ties to even; `None` if it is not finite.
fn bf16(value: f32) -> Option<u16> {
    // bf16 is f32's upper half. Adding just less than half of its last place, and one more if that place is odd, carries into it exactly if
    // the value is rounded up. A carry out of the mantissa correctly raises the exponent.
    let bits = value.to_bits();
    let odd = (bits >> 16) & 1;
    let rounded = (bits.checked_add(0x7fff + odd)? >> 16) as u16;
    let finite = value.is_finite() && rounded & 0x7f80 != 0x7f80;
    finite.then_some(rounded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use safetensors::SafeTensors;

    fn back(bits: u16) -> f32 {
        f32::from_bits(u32::from(bits) << 16)
    }

    /// f32 values between 1 and the next bf16, 1 + 2⁻⁷, are rounded to one of the two.
    #[test]
    fn ties_are_rounded_to_even() {
        let step = 2.0_f32.powi(-7);
        for (value, expected) in [
            (1.0, 1.0),
            (1.0 + 0.25 * step, 1.0),
            (1.0 + 0.5 * step, 1.0),
            (1.0 + 0.500_1 * step, 1.0 + step),
            (1.0 + step, 1.0 + step),
            (1.0 + 1.5 * step, 1.0 + 2.0 * step),
            (-(1.0 + 0.5 * step), -1.0),
            (-(1.0 + 1.5 * step), -(1.0 + 2.0 * step)),
            // A carry into the exponent.
            (2.0 - 0.25 * step, 2.0),
            (0.0, 0.0),
        ] {
            assert_eq!(bf16(value).map(back), Some(expected), "{value}");
        }
        assert_eq!(bf16(-0.0), Some(0x8000));
        for bad in [
            f32::NAN,
            -f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MAX,
            f32::MIN,
        ] {
            assert_eq!(bf16(bad), None, "{bad}");
        }
        // The largest f32 that fits, and the smallest that would be rounded to more than the largest bf16.
        assert_eq!(bf16(f32::from_bits(0x7f7f_7fff)), Some(0x7f7f));
        assert_eq!(bf16(f32::from_bits(0x7f7f_8000)), None);
    }

    proptest! {
        /// No other bf16 is nearer.
        #[test]
        fn values_are_rounded_to_the_nearest(value in -1e30_f32..1e30) {
            let bits = bf16(value).unwrap();
            let error = |bits: u16| (f64::from(back(bits)) - f64::from(value)).abs();
            for other in [bits.wrapping_sub(1), bits.wrapping_add(1)] {
                if back(other).is_finite() {
                    prop_assert!(error(bits) <= error(other));
                }
            }
        }
    }

    #[test]
    fn vectors_keep_their_digits_and_the_bytes_follow_from_the_tensors_alone() {
        let third = 1.0_f32 / 3.0;
        let kernel = Tensor {
            name: "conv.weight",
            shape: &[1, 1, 1, 3],
            values: &[third, -2.0, 0.0],
        };
        let variance = Tensor {
            name: "bn.running_var",
            shape: &[2],
            values: &[third, 1e-30],
        };
        let bytes = pack(&[kernel, variance]).unwrap();
        assert_eq!(pack(&[variance, kernel]).unwrap(), bytes);
        let file = SafeTensors::deserialize(&bytes).unwrap();
        let conv = file.tensor("conv.weight").unwrap();
        assert_eq!(
            (conv.dtype(), conv.shape()),
            (Dtype::BF16, &[1, 1, 1, 3][..])
        );
        let (pairs, _) = conv.data().as_chunks::<2>();
        let values: Vec<f32> = pairs.iter().map(|b| back(u16::from_le_bytes(*b))).collect();
        assert_eq!(values, [0.333_984_38, -2.0, 0.0]);
        let bn = file.tensor("bn.running_var").unwrap();
        assert_eq!(bn.dtype(), Dtype::F32);
        let (words, _) = bn.data().as_chunks::<4>();
        let values: Vec<f32> = words.iter().map(|b| f32::from_le_bytes(*b)).collect();
        assert_eq!(values, [third, 1e-30]);
    }

    #[test]
    fn values_that_cannot_be_packed_are_named() {
        for (shape, value) in [
            (&[1][..], f32::NAN),
            (&[1, 1], f32::INFINITY),
            (&[1, 1], f32::MAX),
        ] {
            let tensor = Tensor {
                name: "conv.weight",
                shape,
                values: &[value],
            };
            let error = pack(&[tensor]).unwrap_err().to_string();
            assert!(error.contains("`conv.weight`"), "{error}");
        }
        let short = Tensor {
            name: "a",
            shape: &[2, 2],
            values: &[1.0],
        };
        assert!(matches!(pack(&[short]), Err(Error::Tensors { .. })));
    }
}
