mod corrections;
mod gradients;
mod undecided;
mod values;

use crate::{Error, Model};
use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::{Bool, Tensor, TensorData};
use corrections::{BETA1, BETA2, corrections};
use deepfusion_kernels::{AdamStep, adam};
use deepfusion_nn::ops::AdamFactors;
use deepfusion_nn::weights::{self, WeightTensor, Weights};
use std::collections::BTreeMap;
use undecided::Undecided;
use values::{Values, to_vec, update_on_device};

pub use gradients::NamedGradients;
pub(crate) use undecided::MOST_UNDECIDED;

/// A parameter's moments, on the same device as its gradient.
#[derive(Debug, Clone)]
struct Moments {
    first: Values,
    second: Values,
}

/// Adam (Kingma and Ba), β₁ = 0.9, β₂ = 0.999, ε = 1e-8, with the gradient clipped by its norm.
///
/// The moments are stored by parameter name. On the processor the update is one pass over parameter, gradient and moments. On a GPU all
/// three stay on the device. The gradient's norm decides whether a step is made, and how far the gradient is clipped. A run with one worker
/// lets the GPU decide both, and reads only every few steps which of them were made.
#[derive(Debug, Clone, Default)]
pub struct Adam {
    moments: BTreeMap<String, Moments>,
    /// Steps made, without those in `undecided`.
    steps: u32,
    undecided: Option<Undecided>,
}

/// A step that [`Adam::begin`] prepared, to be applied to the parameters.
#[derive(Debug, Clone)]
pub struct PreparedStep {
    pub(crate) settings: AdamStep,
    /// The factors that the device computed; they replace those in `settings`.
    pub(crate) factors: Option<AdamFactors>,
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

impl Adam {
    /// Steps known to have been made. Those that a device decided about since the last read are not counted yet.
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
    ) -> (StepOutcome, Option<PreparedStep>) {
        let norm = gradients.norm();
        if !norm.is_finite() {
            return (StepOutcome::Skipped, None);
        }
        self.steps += 1;
        let scale = if clip_norm > 0.0 && norm > clip_norm {
            clip_norm / norm
        } else {
            1.0
        };
        let [correction1, correction2] = corrections(self.steps);
        let step = PreparedStep {
            settings: AdamStep {
                correction1,
                correction2,
                gradient_scale: scale as f32,
                ..settings(learning_rate, weight_decay)
            },
            factors: None,
        };
        let outcome = StepOutcome::Done {
            gradient_norm: norm,
        };
        (outcome, Some(step))
    }

    /// As [`Self::begin`], but the device decides and nothing is read from it. `squares`, `[1]`, is the sum of the gradients' squares. The
    /// step is made if `squares` and `losses` are finite. Returns whether it is made, `[1]`. Once that has been read, [`Self::settle`] must
    /// be called, at the latest after [`MOST_UNDECIDED`] steps.
    #[must_use]
    pub(crate) fn begin_on_device(
        &mut self,
        (losses, squares): (Tensor<1>, Tensor<1>),
        learning_rate: f64,
        clip_norm: f64,
        weight_decay: f64,
    ) -> (Tensor<1, Bool>, PreparedStep) {
        let steps = self.steps;
        let undecided = self
            .undecided
            .get_or_insert_with(|| Undecided::after(steps, &squares.device()));
        let is_made = Tensor::cat(vec![losses, squares.clone()], 0)
            .is_finite()
            .all();
        let scale = if clip_norm > 0.0 {
            // min(1, clip_norm / norm); the clamp avoids a division by zero where the gradient is zero.
            let norm = squares.clamp_min(f32::MIN_POSITIVE).sqrt();
            norm.recip().mul_scalar(clip_norm).clamp_max(1.0)
        } else {
            squares.ones_like()
        };
        let corrections = undecided.begin(&is_made);
        let step = PreparedStep {
            settings: settings(learning_rate, weight_decay),
            factors: Some(AdamFactors::decided(scale, corrections, is_made.clone())),
        };
        (is_made, step)
    }

    /// Counts the steps that were made of those begun on a device, once the outcome of all of them has been read.
    pub(crate) fn settle(&mut self, made: u32) {
        self.steps += made;
        self.undecided = None;
    }

    /// Updates the parameters of one module, named with `prefix`.
    #[must_use]
    pub fn apply<M: Module>(
        &mut self,
        step: &PreparedStep,
        prefix: &str,
        module: M,
        gradients: &NamedGradients,
    ) -> M {
        module.map(&mut Update {
            path: vec![prefix.to_owned()],
            step: &step.settings,
            factors: step.factors.clone(),
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
        Ok(Self {
            moments,
            steps,
            undecided: None,
        })
    }
}

/// Settings of a step without gradient scaling and without bias correction.
fn settings(learning_rate: f64, weight_decay: f64) -> AdamStep {
    AdamStep {
        learning_rate: learning_rate as f32,
        beta1: BETA1 as f32,
        beta2: BETA2 as f32,
        epsilon: 1e-8,
        correction1: 1.0,
        correction2: 1.0,
        gradient_scale: 1.0,
        weight_decay: weight_decay as f32,
    }
}

/// The number of values of each of a model's parameters, by its name among the moments.
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
    /// The step's factors on the device: computed there, or copied there for the first parameter that needs them.
    factors: Option<AdamFactors>,
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
        let Some(gradient) = self.gradients.by_name.get(&name) else {
            return param;
        };
        // A parameter's first step creates its moments. Those read from a file have already been checked against the parameter.
        let moments = self.moments.entry(name).or_insert_with(|| Moments {
            first: gradient.zeros(),
            second: gradient.zeros(),
        });
        let step = AdamStep {
            weight_decay: if D > 1 { self.step.weight_decay } else { 0.0 },
            ..*self.step
        };
        let Moments { first, second } = moments;
        let factors = &mut self.factors;
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
                let known = || AdamFactors::of(&step, &gradient.device());
                let factors = factors.get_or_insert_with(known);
                let learned = (gradient.clone(), moments);
                let (moved, [m, v]) = update_on_device(&step, factors, tensor, learned);
                (*first, *second) = (Values::Device(m), Values::Device(v));
                moved
            }
        })
    }
}

#[cfg(test)]
mod tests;
