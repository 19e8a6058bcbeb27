//! What the tests against PyTorch share: the names and shapes of real files, and the expected values. The counterpart is
//! `tests/reference/networks.py`.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use burn::module::{Module, ModuleVisitor, Param};
use burn::tensor::{Device, Gradients, Tensor, TensorData};
use deepfusion_nn::weights::{self, Weights};
use flate2::read::GzDecoder;

pub(crate) use crate::networks::formula::{Listing, filled, formula, uniform, write_listed};

/// Batch, height and width of the reference images.
pub(crate) const BATCH: usize = 2;
pub(crate) const HEIGHT: usize = 64;
pub(crate) const WIDTH: usize = 96;
/// Number of values after which the weights in the `.pth` files repeat.
pub(crate) const PERIOD: usize = 101;

pub(crate) fn reference(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/reference")
        .join(file)
}

/// The images of the reference, `[BATCH, channels, HEIGHT, WIDTH]` in [0, 1).
pub(crate) fn images(name: &str, channels: usize, device: &Device) -> Tensor<4> {
    let values: Vec<f32> = uniform(name, BATCH * channels * HEIGHT * WIDTH, None)
        .iter()
        .map(|v| v * 0.5 + 0.5)
        .collect();
    Tensor::from_data(
        TensorData::new(values, [BATCH, channels, HEIGHT, WIDTH]),
        device,
    )
}

/// The listings of the real files, by `model/file`.
pub(crate) fn manifest() -> BTreeMap<String, Listing> {
    serde_json::from_str(&fs::read_to_string(reference("manifest.json")).unwrap()).unwrap()
}

/// Unpacks `tests/reference/<name>.gz.gz` into the folder.
pub(crate) fn unpack(name: &str, folder: &Path) -> PathBuf {
    let packed = fs::File::open(reference(&format!("{name}.gz.gz"))).unwrap();
    let target = folder.join(name);
    let mut file = fs::File::create(&target).unwrap();
    std::io::copy(&mut GzDecoder::new(GzDecoder::new(packed)), &mut file).unwrap();
    target
}

/// The expected values, by name.
pub(crate) fn expected() -> Weights {
    weights::read(&reference("expected.safetensors")).unwrap()
}

/// The largest |actual − expected|, and the root mean square of the expected values. Only every `step`-th actual value is compared, as in
/// the reference.
pub(crate) fn largest_difference(
    expected: &Weights,
    name: &str,
    actual: &[f32],
    step: usize,
) -> (f32, f32) {
    let values = &expected.tensors[name].values;
    assert_eq!(actual.len().div_ceil(step), values.len(), "{name}");
    let rms = (values.iter().map(|v| v * v).sum::<f32>() / values.len() as f32).sqrt();
    let differences = actual.iter().step_by(step).zip(values).map(|(a, e)| {
        assert!(a.is_finite(), "{name}: {a} for {e}");
        (a - e).abs()
    });
    (differences.fold(0.0, f32::max), rms)
}

/// The largest |actual − expected| over max(1, rms of the expected values), as [`largest_difference`].
pub(crate) fn largest_error(expected: &Weights, name: &str, actual: &[f32], step: usize) -> f32 {
    let (difference, rms) = largest_difference(expected, name, actual, step);
    difference / rms.max(1.0)
}

pub(crate) fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

/// The loss of the references' training step: Σ_k mean(σ_k · pattern_k).
pub(crate) fn pattern_loss(
    disparities: impl IntoIterator<Item = Tensor<4>>,
    device: &Device,
) -> Tensor<1> {
    let parts = disparities
        .into_iter()
        .enumerate()
        .map(|(index, disparity)| {
            let shape = disparity.dims();
            let pattern = uniform(&format!("pattern{index}"), shape.iter().product(), None);
            let pattern = Tensor::<4>::from_data(TensorData::new(pattern, shape), device);
            disparity.mul(pattern).mean()
        });
    parts.reduce(Tensor::add).unwrap()
}

/// The gradient of every weight of a network that has one, by its name.
pub(crate) fn gradients(net: &impl Module, loss: Tensor<1>) -> Vec<(String, Vec<f32>)> {
    take_gradients(net, &mut loss.backward())
}

/// As [`gradients`], from computed gradients.
pub(crate) fn take_gradients(
    net: &impl Module,
    gradients: &mut Gradients,
) -> Vec<(String, Vec<f32>)> {
    struct Collect<'a> {
        path: Vec<String>,
        gradients: &'a mut Gradients,
        found: Vec<(String, Vec<f32>)>,
    }
    impl ModuleVisitor for Collect<'_> {
        fn enter_module(&mut self, name: &str, _: &str) {
            self.path.push(name.to_owned());
        }
        fn exit_module(&mut self, _: &str, _: &str) {
            self.path.pop();
        }
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            if let Some(gradient) = param.val().grad_remove(self.gradients) {
                self.found.push((self.path.join("."), values(gradient)));
            }
        }
    }
    let mut collect = Collect {
        path: Vec::new(),
        gradients,
        found: Vec::new(),
    };
    net.visit(&mut collect);
    collect.found
}

/// Checks gradients against those of a reference, whose tensors `theirs` names: each to 1e-4 of its root mean square, and the norm of all.
/// If the reference has the error of PyTorch's own float32 gradient (`…/float32`, in the same measure), the tolerance is three times that.
pub(crate) fn check_gradients(
    expected: &Weights,
    found: Vec<(String, Vec<f32>)>,
    theirs: impl Fn(&str) -> String,
) {
    let names = expected.tensors.keys();
    let norms = names.filter(|name| name.ends_with("/norm")).count();
    assert_eq!(found.len(), norms);
    let (mut worst, mut total, mut exact) = ((0.0, String::new()), 0.0, 0.0);
    for (name, gradient) in found {
        let theirs = theirs(&name);
        let norm = expected.tensors[&format!("{theirs}/norm")].values[0];
        let rms = norm / (gradient.len() as f32).sqrt();
        let square = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>();
        total += square;
        exact += f64::from(norm).powi(2);
        let step = (gradient.len() / 11).max(1) | 1;
        let name = format!("{theirs}/gradient");
        let (off, _) = largest_difference(expected, &name, &gradient, step);
        // A gradient of nothing but rounding errors (a bias before a norm) is compared with 1e-6 of the norm of all.
        let error = off / rms.max(1e-6 * (exact as f32).sqrt());
        let theirs = expected.tensors.get(&format!("{theirs}/float32"));
        let allowed = theirs.map_or(1e-4, |t| t.values[0].mul_add(3.0, 1e-4));
        if error / allowed > worst.0 {
            worst = (
                error / allowed,
                format!("{name}: {error:.1e} of {allowed:.1e}"),
            );
        }
    }
    println!("worst gradient {worst:?}");
    assert!(worst.0 < 1.0, "{worst:?}");
    let theirs = expected.tensors.get("float32_total");
    let allowed = theirs.map_or(1e-4, |t| t.values[0].mul_add(3.0, 1e-4));
    let off = (total / exact - 1.0).abs();
    assert!(
        off < f64::from(allowed),
        "{total} for {exact}: {off:.1e} of {allowed:.1e}"
    );
}
