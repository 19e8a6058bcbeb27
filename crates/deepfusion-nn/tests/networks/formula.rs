//! The formula for weights in files and networks. `tests/reference/networks.py` computes it, too. The tests of `deepfusion-train` include
//! this file.

#![allow(clippy::unwrap_used, reason = "a test's panic is its message")]

use std::path::Path;

use burn::module::Module;
use deepfusion_nn::weights::{self, WeightTensor, Weights};
use safetensors::tensor::{Dtype, TensorView};

/// `count` values in [−1, 1) from a hash of the name and the index. With a period they repeat, and their mean is removed.
pub(crate) fn uniform(name: &str, count: usize, period: Option<usize>) -> Vec<f32> {
    let seed = name.bytes().fold(0x811C_9DC5_u32, |seed, byte| {
        (seed ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    });
    let hash = |index: usize| {
        let mut x = seed.wrapping_add((index as u32).wrapping_mul(0x9E37_79B9));
        x = (x ^ (x >> 16)).wrapping_mul(0x7FEB_352D);
        x = (x ^ (x >> 15)).wrapping_mul(0x846C_A68B);
        (x ^ (x >> 16)) >> 8
    };
    let step = 2.0_f32.powi(-23);
    match period.filter(|&period| count > period) {
        Some(period) => {
            let mean = (0..period).map(|i| u64::from(hash(i))).sum::<u64>() as f64 / period as f64;
            let once: Vec<f32> = (0..period)
                .map(|i| ((f64::from(hash(i)) - mean) * f64::from(step)) as f32)
                .collect();
            once.into_iter().cycle().take(count).collect()
        }
        // Fewer values than a period do not repeat.
        None => (0..count).map(|i| hash(i) as f32 * step - 1.0).collect(),
    }
}

/// The weights of the tensor `name`.
pub(crate) fn formula(name: &str, shape: &[usize], period: Option<usize>) -> Vec<f32> {
    let v = uniform(name, shape.iter().product(), period);
    let affine = |offset: f32, factor: f32| v.iter().map(|v| offset + factor * v).collect();
    if name.ends_with("running_var") {
        affine(1.0, 0.3)
    } else if shape.len() == 1 && name.ends_with("weight") {
        let last_of_a_branch = name.contains(".bn2.") || name.contains(".bn3.");
        affine(if last_of_a_branch { 0.4 } else { 1.0 }, 0.2)
    } else if shape.len() == 1 {
        affine(0.0, 0.1)
    } else {
        let gain = if shape[0] == 1 { 0.2 } else { 1.0 };
        let fan_in = shape[1..].iter().product::<usize>() as f64;
        affine(0.0, (gain * (6.0 / fan_in).sqrt()) as f32)
    }
}

/// The module with the formula's weights.
pub(crate) fn filled<M: Module>(module: M) -> M {
    let mut weights: Weights = weights::collect(&module);
    for (name, tensor) in &mut weights.tensors {
        *tensor = WeightTensor {
            values: formula(name, &tensor.shape, None),
            shape: tensor.shape.clone(),
        };
    }
    weights::apply(module, &weights).unwrap()
}

/// A file's tensors in PyTorch's order: name, shape, type.
pub(crate) type Listing = Vec<(String, Vec<usize>, String)>;

/// Writes a safetensors file with the names, shapes and types of a real one and the formula's weights.
pub(crate) fn write_listed(path: &Path, listing: &Listing) {
    let bytes: Vec<Vec<u8>> = listing
        .iter()
        .map(|(name, shape, kind)| match kind.as_str() {
            "f32" => formula(name, shape, None)
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
            _ => vec![0; 8 * shape.iter().product::<usize>()],
        })
        .collect();
    let views = listing
        .iter()
        .zip(&bytes)
        .map(|((name, shape, kind), bytes)| {
            let dtype = if kind == "f32" {
                Dtype::F32
            } else {
                Dtype::I64
            };
            (name, TensorView::new(dtype, shape.clone(), bytes).unwrap())
        });
    safetensors::serialize_to_file(views, None, path).unwrap();
}
