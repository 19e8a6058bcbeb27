mod values;

use crate::{Error, Model};
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Gradients, Tensor, TensorData};
use deepfusion_kernels::{AdamStep, adam, sum_of_squares};
use deepfusion_nn::ops::{self, has_kernels};
use deepfusion_nn::weights::{self, WeightTensor, Weights};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use values::{Values, to_vec, update_on_device};

/// A parameter's moments, in the same place as its gradient.
#[derive(Debug, Clone)]
struct Moments {
    first: Values,
    second: Values,
}

/// Adam (Kingma and Ba), β₁ = 0.9, β₂ = 0.999, ε = 1e-8, with the gradient clipped by its norm.
///
/// The moments are kept by the parameters' names. On the processor the update is one pass over parameter, gradient and moments. On a GPU
/// all of them stay there, and a step needs one number from it, the gradient's norm: it decides whether there is a step, and by how much the
/// gradient is shortened.
#[derive(Debug, Clone, Default)]
pub struct Adam {
    moments: BTreeMap<String, Moments>,
    steps: u32,
}

/// The outcome of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StepOutcome {
    /// The parameters were updated.
    Done {
        /// Norm of the gradient before clipping.
        gradient_norm: f64,
    },
    /// The gradient was not finite; nothing changed.
    Skipped,
}

/// Values that are read from a device at once: 32 MB, so that neither memory nor the largest buffer of a small GPU is exceeded.
const AT_ONCE: usize = 8 << 20;

/// A step's gradients by parameter name.
#[derive(Debug, Default)]
pub struct NamedGradients(BTreeMap<String, Values>);

impl NamedGradients {
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

    /// Adds a parameter's gradient to what there is of it.
    fn insert(&mut self, name: String, gradient: Values) {
        match self.0.entry(name) {
            Entry::Vacant(entry) => {
                entry.insert(gradient);
            }
            Entry::Occupied(mut entry) => entry.get_mut().add(gradient),
        }
    }

    /// All values one after the other, in the order of the names.
    pub(crate) fn append_to(&self, flat: &mut Vec<f32>) {
        // Those on the device in few transfers.
        let mut read = Vec::new();
        let mut waiting: Vec<Tensor<1>> = Vec::new();
        for values in self.0.values() {
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
        for values in self.0.values() {
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

    /// Takes the values back from where [`Self::append_to`] put them.
    pub(crate) fn take_from(&mut self, flat: &[f32]) {
        let mut rest = flat;
        for values in self.0.values_mut() {
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

    /// The sum of squares: of the values in main memory, and, if there are any, of those on the device, one value there.
    pub(crate) fn squares(&self) -> (f64, Option<Tensor<1>>) {
        let mut on_host = 0.0;
        let mut on_device = Vec::new();
        for values in self.0.values() {
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
        let found = if has_kernels(&gradient) {
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

impl Adam {
    /// Steps made.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Prepares a step: computes the factor that clips the gradient to `clip_norm` (0: no limit), or decides to skip the
    /// step. `weight_decay` is decoupled (AdamW, Loshchilov and Hutter) and applies to matrices and kernels only, not to
    /// biases and the weights of norms.
    #[must_use]
    pub fn begin(
        &mut self,
        gradients: &NamedGradients,
        learning_rate: f64,
        clip_norm: f64,
        weight_decay: f64,
    ) -> (StepOutcome, Option<AdamStep>) {
        self.begin_with_norm(gradients.norm(), learning_rate, clip_norm, weight_decay)
    }

    /// The same where the gradient's norm is known.
    pub(crate) fn begin_with_norm(
        &mut self,
        norm: f64,
        learning_rate: f64,
        clip_norm: f64,
        weight_decay: f64,
    ) -> (StepOutcome, Option<AdamStep>) {
        if !norm.is_finite() {
            return (StepOutcome::Skipped, None);
        }
        self.steps += 1;
        let (beta1, beta2) = (0.9_f64, 0.999_f64);
        let scale = if clip_norm > 0.0 && norm > clip_norm {
            clip_norm / norm
        } else {
            1.0
        };
        let step = AdamStep {
            learning_rate: learning_rate as f32,
            beta1: beta1 as f32,
            beta2: beta2 as f32,
            epsilon: 1e-8,
            correction1: (1.0 - beta1.powi(self.steps as i32)) as f32,
            correction2: (1.0 - beta2.powi(self.steps as i32)) as f32,
            gradient_scale: scale as f32,
            weight_decay: weight_decay as f32,
        };
        let outcome = StepOutcome::Done {
            gradient_norm: norm,
        };
        (outcome, Some(step))
    }

    /// Updates the parameters of one module, named with `prefix`.
    #[must_use]
    pub fn apply<M: Module>(
        &mut self,
        step: &AdamStep,
        prefix: &str,
        module: M,
        gradients: &NamedGradients,
    ) -> M {
        module.map(&mut Update {
            path: vec![prefix.to_owned()],
            step,
            gradients,
            moments: &mut self.moments,
        })
    }

    /// The moments as named tensors, `m.` and `v.` before the parameters' names.
    #[must_use]
    pub fn state(&self) -> Weights {
        let mut weights = Weights::new("the optimiser");
        for (name, moments) in &self.moments {
            for (prefix, values) in [("m", &moments.first), ("v", &moments.second)] {
                let tensor = WeightTensor {
                    shape: vec![values.len()],
                    values: values.to_vec(),
                };
                weights.tensors.insert(format!("{prefix}.{name}"), tensor);
            }
        }
        weights
    }

    /// The optimiser that [`Self::state`] came from, after `steps` steps with this model.
    ///
    /// # Errors
    /// [`Error::Model`] naming the first moment that differs in length from its parameter, has no parameter, or
    /// has no counterpart (`m.` without `v.`).
    pub fn restore(state: Weights, steps: u32, model: &Model) -> Result<Self, Error> {
        let lengths = parameter_lengths(model);
        let Weights {
            origin, tensors, ..
        } = state;
        let mut moments: BTreeMap<String, Moments> = BTreeMap::new();
        for (name, tensor) in tensors {
            let found = vec![tensor.values.len()];
            let parameter = name.strip_prefix("m.").or(name.strip_prefix("v."));
            let known = parameter.and_then(|p| Some((p, *lengths.get(p)?)));
            let Some((parameter, length)) = known else {
                return Err(Error::from(deepfusion_nn::Error::UnexpectedTensor {
                    origin,
                    name: format!("adam.{name}"),
                    found,
                    others: 0,
                }));
            };
            if found != [length] {
                return Err(Error::from(deepfusion_nn::Error::TensorShape {
                    origin,
                    name: format!("adam.{name}"),
                    expected: vec![length],
                    found,
                    others: 0,
                }));
            }
            let moments = moments.entry(parameter.to_owned()).or_insert(Moments {
                first: Values::Host(Vec::new()),
                second: Values::Host(Vec::new()),
            });
            let values = Values::Host(tensor.values);
            if name.starts_with("m.") {
                moments.first = values
            } else {
                moments.second = values
            }
        }
        for (name, moments) in &moments {
            let missing = match (moments.first.len(), moments.second.len()) {
                (0, _) => "m",
                (_, 0) => "v",
                _ => continue,
            };
            return Err(Error::from(deepfusion_nn::Error::MissingTensor {
                origin,
                name: format!("adam.{missing}.{name}"),
                expected: vec![lengths[name]],
                others: 0,
            }));
        }
        Ok(Self { moments, steps })
    }
}

/// How many values each parameter of a model has, by its name among the moments.
fn parameter_lengths(model: &Model) -> BTreeMap<String, usize> {
    let mut lengths = BTreeMap::new();
    let mut note = |prefix: &str, module: Weights| {
        let named = module.with_prefix(prefix).tensors.into_iter();
        lengths.extend(named.map(|(name, tensor)| (name, tensor.values.len())));
    };
    note("depth.", weights::collect(&model.depth_net));
    if let Some(pose_net) = &model.pose_net {
        note("pose.", weights::collect(pose_net));
    }
    if let Some(decoder) = &model.flow_decoder {
        note("flow.", weights::collect(decoder));
    }
    if let Some(focal) = &model.focal {
        note("focal.", weights::collect(focal));
    }
    lengths
}

struct Update<'a> {
    path: Vec<String>,
    step: &'a AdamStep,
    gradients: &'a NamedGradients,
    moments: &'a mut BTreeMap<String, Moments>,
}

impl ModuleMapper for Update<'_> {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let name = self.path.join(".");
        let Some(gradient) = self.gradients.0.get(&name) else {
            return param;
        };
        // A parameter's first step makes its moments; those of a file were held against it when they were read.
        let moments = self.moments.entry(name).or_insert_with(|| Moments {
            first: gradient.zeros(),
            second: gradient.zeros(),
        });
        let step = AdamStep {
            weight_decay: if D > 1 { self.step.weight_decay } else { 0.0 },
            ..*self.step
        };
        let Moments { first, second } = moments;
        param.map(|tensor| match gradient {
            Values::Host(gradient) => {
                let (shape, device) = (tensor.dims(), tensor.device());
                let mut values = to_vec(tensor.inner());
                let (mut m, mut v) = (first.take(), second.take());
                adam(&step, &mut values, gradient, &mut m, &mut v);
                (*first, *second) = (Values::Host(m), Values::Host(v));
                Tensor::from_data(TensorData::new(values, shape), &device).require_grad()
            }
            Values::Device(gradient) => {
                let moments = [&*first, &*second].map(|moment| moment.beside(gradient));
                let (moved, [m, v]) = update_on_device(&step, tensor, gradient.clone(), moments);
                (*first, *second) = (Values::Device(m), Values::Device(v));
                moved
            }
        })
    }
}

#[cfg(test)]
mod tests;
