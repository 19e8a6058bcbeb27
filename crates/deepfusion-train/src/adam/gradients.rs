//! Gradients of a step, in main memory or on their device.

use super::values::{Values, to_vec};
use burn::module::{Module, ModuleVisitor, Param};
use burn::tensor::{Gradients, Tensor};
use deepfusion_kernels::sum_of_squares;
use deepfusion_nn::ops::{self, has_kernels};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Number of values read from a device in one transfer: 32 MB, within the memory and the largest buffer of a small GPU.
const AT_ONCE: usize = 8 << 20;

/// A step's gradients by parameter name.
#[derive(Debug, Default)]
pub struct NamedGradients {
    pub(super) by_name: BTreeMap<String, Values>,
    /// Whether gradients on the processor are kept as tensors, too, instead of plain values for its kernels.
    as_tensors: bool,
}

impl NamedGradients {
    /// No gradients yet. All of them will be tensors on the device, which a step that the device decides about requires.
    pub(crate) fn on_device() -> Self {
        Self {
            as_tensors: true,
            ..Self::default()
        }
    }

    /// Adds the gradients of the module's parameters, named with `prefix`, times `scale`.
    pub fn add<M: Module>(
        &mut self,
        prefix: &str,
        module: &M,
        gradients: &mut Gradients,
        scale: f32,
    ) {
        module.visit(&mut Collect {
            path: vec![prefix.to_owned()],
            gradients,
            into: self,
            scale,
        });
    }

    /// Adds to a parameter's gradient.
    pub(super) fn insert(&mut self, name: String, gradient: Values) {
        match self.by_name.entry(name) {
            Entry::Vacant(entry) => {
                entry.insert(gradient);
            }
            Entry::Occupied(mut entry) => entry.get_mut().add(gradient),
        }
    }

    /// All values one after the other, in the order of the names.
    pub(crate) fn append_to(&self, flat: &mut Vec<f32>) {
        // Values on the device are read in few transfers.
        let mut read = Vec::new();
        let mut waiting: Vec<Tensor<1>> = Vec::new();
        for values in self.by_name.values() {
            let Values::Device(values) = values else {
                continue;
            };
            let together: usize = waiting.iter().map(|tensor| tensor.dims()[0]).sum();
            if together > 0 && together + values.dims()[0] > AT_ONCE {
                read.extend(to_vec(Tensor::cat(std::mem::take(&mut waiting), 0)));
            }
            waiting.push(values.clone());
        }
        if !waiting.is_empty() {
            read.extend(to_vec(Tensor::cat(waiting, 0)));
        }
        let mut rest = read.as_slice();
        for values in self.by_name.values() {
            match values {
                Values::Host(values) => flat.extend_from_slice(values),
                Values::Device(values) => {
                    let (own, others) = rest.split_at(values.dims()[0]);
                    flat.extend_from_slice(own);
                    rest = others;
                }
            }
        }
    }

    /// Replaces all values by those of `flat`, in the order of [`Self::append_to`].
    pub(crate) fn take_from(&mut self, flat: &[f32]) {
        let mut rest = flat;
        for values in self.by_name.values_mut() {
            let (own, others) = rest.split_at(values.len());
            match values {
                Values::Host(values) => values.copy_from_slice(own),
                Values::Device(values) => *values = Tensor::from_data(own, &values.device()),
            }
            rest = others;
        }
    }

    pub(crate) fn norm(&self) -> f64 {
        let (on_host, on_device) = self.squares();
        let on_device = on_device.map_or(0.0, |sum| f64::from(sum.into_scalar::<f32>()));
        (on_host + on_device).sqrt()
    }

    /// The sum of squares of the values in main memory, and that of the values on the device, if there are any, as one value there.
    pub(crate) fn squares(&self) -> (f64, Option<Tensor<1>>) {
        let mut on_host = 0.0;
        let mut on_device = Vec::new();
        for values in self.by_name.values() {
            match values {
                Values::Host(values) => on_host += sum_of_squares(values),
                Values::Device(values) => on_device.push(values.clone()),
            }
        }
        let on_device = (!on_device.is_empty()).then(|| ops::sum_of_squares(&on_device));
        (on_host, on_device)
    }
}

struct Collect<'a> {
    path: Vec<String>,
    gradients: &'a mut Gradients,
    into: &'a mut NamedGradients,
    scale: f32,
}

impl ModuleVisitor for Collect<'_> {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let Some(gradient) = param.val().grad_remove(self.gradients) else {
            return;
        };
        let count = gradient.shape().num_elements();
        let found = if has_kernels(&gradient) && !self.into.as_tensors {
            let mut values = to_vec(gradient);
            if self.scale != 1.0 {
                values.iter_mut().for_each(|v| *v *= self.scale);
            }
            Values::Host(values)
        } else {
            let gradient = gradient.reshape([count]);
            Values::Device(match self.scale {
                1.0 => gradient,
                scale => gradient.mul_scalar(scale),
            })
        };
        self.into.insert(self.path.join("."), found);
    }
}
