//! Weights that training leaves unchanged.

use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::Tensor;
use deepfusion_model::{Error as ModelError, ExpectedSetting};

use crate::{Error, Model, SampleSet, TrainConfig};

/// Freezes the weights that `config.freeze` names: their gradients are not computed. A name is that of a weight
/// (`depth.encoder.conv1.weight`) or of a module that contains it (`depth.encoder`), as in [`crate::Adam::state`].
///
/// # Errors
/// [`ModelError::Config`] for a name that no weight has, or if nothing is left to learn from the videos or from the images with
/// known depth in `train`.
pub(crate) fn freeze(
    model: Model,
    config: &TrainConfig,
    train: &SampleSet,
) -> Result<Model, Error> {
    let names = &config.freeze;
    if names.is_empty() {
        return Ok(model);
    }
    let mut freeze = Freeze {
        config,
        path: Vec::new(),
        names: names.iter().map(|name| (name.as_str(), false)).collect(),
        from_video: 0,
        from_depth: 0,
    };
    let model = Model {
        depth_net: freeze.under("depth", model.depth_net),
        pose_net: model.pose_net.map(|net| freeze.under("pose", net)),
        flow_decoder: model.flow_decoder.map(|net| freeze.under("flow", net)),
        ..model
    };
    let wrong = |expected: ExpectedSetting, found: String| {
        Error::from(ModelError::config("freeze", expected, found))
    };
    let left_out = |name: &str| {
        let part = name.strip_prefix(TrainConfig::POSE_NET);
        let of_pose_net = part.is_some_and(|part| part.is_empty() || part.starts_with('.'));
        of_pose_net && config.leaves_pose_net_out()
    };
    if let Some((name, _)) = freeze
        .names
        .iter()
        .find(|(name, found)| !found && !left_out(name))
    {
        return Err(wrong(ExpectedSetting::Weights, (*name).to_owned()));
    }
    if !train.samples.is_empty() && freeze.from_video == 0 {
        return Err(wrong(ExpectedSetting::LeftForVideo, names.join(", ")));
    }
    if !train.depth.is_empty() && freeze.from_depth == 0 {
        return Err(wrong(ExpectedSetting::LeftForDepth, names.join(", ")));
    }
    Ok(model)
}

struct Freeze<'a> {
    config: &'a TrainConfig,
    path: Vec<String>,
    /// The names in `config.freeze`, and whether a weight matched each of them.
    names: Vec<(&'a str, bool)>,
    /// Number of weights that still learn from video.
    from_video: usize,
    /// Number of weights that still learn from known depth.
    from_depth: usize,
}

impl Freeze<'_> {
    fn under<M: Module>(&mut self, prefix: &str, module: M) -> M {
        self.path = vec![prefix.to_owned()];
        module.map(self)
    }

    fn is_uncertainty(&self) -> bool {
        self.path[0] == "depth" && self.path.get(1).is_some_and(|part| part == "uncertainty")
    }

    /// PoseNet learns, too: where its poses do not warp the views, it has a loss of its own (`loss.speed`).
    fn learns_from_video(&self) -> bool {
        !self.is_uncertainty()
    }

    fn learns_from_depth(&self) -> bool {
        // At weight 0 only the uncertainty head learns: see `Model::learn_depth`.
        self.path[0] == "depth" && (self.config.loss.depth.weight > 0.0 || self.is_uncertainty())
    }
}

impl ModuleMapper for Freeze<'_> {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }
    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        if !param.is_require_grad() {
            // Running statistics are not weights.
            return param;
        }
        let weight = self.path.join(".");
        let of = |name: &str| {
            let rest = weight.strip_prefix(name);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        let mut frozen = false;
        for (name, found) in &mut self.names {
            if of(name) {
                (*found, frozen) = (true, true);
            }
        }
        if frozen {
            return param.set_require_grad(false);
        }
        self.from_video += usize::from(self.learns_from_video());
        self.from_depth += usize::from(self.learns_from_depth());
        param
    }
}
