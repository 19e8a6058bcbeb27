//! Collects a module's weights, and applies weights to a module.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Tensor, TensorData};

use super::{WeightTensor, Weights};
use crate::Error;

/// All float tensors of the module by their paths, with the running statistics of batch norms.
pub fn collect<M: Module>(module: &M) -> Weights {
    struct Collect {
        path: Vec<String>,
        weights: Weights,
    }
    impl ModuleVisitor for Collect {
        fn enter_module(&mut self, name: &str, _container_type: &str) {
            self.path.push(name.to_owned());
        }
        fn exit_module(&mut self, _name: &str, _container_type: &str) {
            self.path.pop();
        }
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            let tensor = param.val();
            let shape = tensor.dims().to_vec();
            let values = tensor.into_data().iter::<f32>().collect();
            self.weights
                .tensors
                .insert(self.path.join("."), WeightTensor { shape, values });
        }
    }
    let mut collect = Collect {
        path: Vec::new(),
        weights: Weights::new("the network"),
    };
    module.visit(&mut collect);
    collect.weights
}

/// The module with the given weights, which must have exactly the module's names and shapes, and be finite.
///
/// A module shares its running statistics with its clones (Burn keeps them behind a lock), so earlier clones get the new ones, too.
///
/// # Errors
/// [`Error::MissingTensor`], [`Error::UnexpectedTensor`], [`Error::TensorShape`] naming the first such tensor, [`Error::NotFinite`]. The
/// module is then dropped unchanged.
pub fn apply<M: Module>(module: M, weights: &Weights) -> Result<M, Error> {
    check(&shapes(&module), weights)?;
    Ok(module.map(&mut Apply {
        path: Vec::new(),
        weights,
    }))
}

/// As [`apply`], except for tensors whose names begin with `part`. If the weights lack them, the module keeps its own; if the module lacks
/// them, the weights' are ignored. Returns whether the module kept its own, which are new.
///
/// # Errors
/// As [`apply`].
pub fn apply_but_for<M: Module>(
    module: M,
    weights: &Weights,
    part: &str,
) -> Result<(M, bool), Error> {
    let has = |weights: &Weights| weights.tensors.keys().any(|n| n.starts_with(part));
    let own = collect(&module);
    let is_new = match (has(&own), has(weights)) {
        (true, true) | (false, false) => return Ok((apply(module, weights)?, false)),
        (own_alone, _) => own_alone,
    };
    let mut weights = weights.clone();
    weights.tensors.retain(|name, _| !name.starts_with(part));
    if is_new {
        let part = own.tensors.into_iter().filter(|(n, _)| n.starts_with(part));
        weights.tensors.extend(part);
    }
    Ok((apply(module, &weights)?, is_new))
}

/// Names and shapes of the module's tensors, in the module's order.
fn shapes<M: Module>(module: &M) -> Vec<(String, Vec<usize>)> {
    struct Shapes {
        path: Vec<String>,
        found: Vec<(String, Vec<usize>)>,
    }
    impl ModuleVisitor for Shapes {
        fn enter_module(&mut self, name: &str, _container_type: &str) {
            self.path.push(name.to_owned());
        }
        fn exit_module(&mut self, _name: &str, _container_type: &str) {
            self.path.pop();
        }
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            self.found
                .push((self.path.join("."), param.val().dims().to_vec()));
        }
    }
    let mut shapes = Shapes {
        path: Vec::new(),
        found: Vec::new(),
    };
    module.visit(&mut shapes);
    shapes.found
}

fn check(wanted: &[(String, Vec<usize>)], weights: &Weights) -> Result<(), Error> {
    let origin = || weights.origin.clone();

    let differing: Vec<_> = wanted
        .iter()
        .filter_map(|(name, shape)| Some((name, shape, weights.tensors.get(name)?)))
        .filter(|(_, shape, tensor)| tensor.shape != **shape)
        .collect();
    if let Some((name, expected, tensor)) = differing.first() {
        return Err(Error::TensorShape {
            origin: origin(),
            name: (*name).clone(),
            expected: (*expected).clone(),
            found: tensor.shape.clone(),
            others: differing.len() - 1,
        });
    }

    let missing: Vec<_> = wanted
        .iter()
        .filter(|(name, _)| !weights.tensors.contains_key(name))
        .collect();
    if let Some((name, shape)) = missing.first() {
        return Err(Error::MissingTensor {
            origin: origin(),
            name: name.clone(),
            expected: shape.clone(),
            others: missing.len() - 1,
        });
    }

    let unexpected: Vec<_> = weights
        .tensors
        .iter()
        .filter(|(name, _)| !wanted.iter().any(|(wanted, _)| wanted == *name))
        .collect();
    if let Some((name, tensor)) = unexpected.first() {
        return Err(Error::UnexpectedTensor {
            origin: origin(),
            name: (*name).clone(),
            found: tensor.shape.clone(),
            others: unexpected.len() - 1,
        });
    }

    for (name, tensor) in &weights.tensors {
        let count = tensor.values.iter().filter(|v| !v.is_finite()).count();
        if count > 0 {
            return Err(Error::NotFinite {
                origin: origin(),
                name: name.clone(),
                count,
            });
        }
    }
    Ok(())
}

struct Apply<'a> {
    path: Vec<String>,
    weights: &'a Weights,
}

impl ModuleMapper for Apply<'_> {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let Some(tensor) = self.weights.tensors.get(&self.path.join(".")) else {
            return param; // `check` requires every name.
        };
        param.map(|old| {
            let data = TensorData::new(tensor.values.clone(), tensor.shape.clone());
            let new = Tensor::from_data(data, &old.device());
            if old.is_require_grad() {
                new.require_grad()
            } else {
                new
            }
        })
    }
}
