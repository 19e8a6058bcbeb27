//! Masks of a user's model, for the perception.

use std::path::Path;

use deepfusion_data::RgbImage;
use deepfusion_geometry::DepthMap;
use deepfusion_instances::InstanceModel;
use deepfusion_perception::{Instance, Run};

use crate::cli::InstanceArgs;
use crate::failure::Result;

/// Finds things by their look, where the user gave a model for that.
pub(super) struct InstanceFinder(Option<InstanceModel>);

impl InstanceFinder {
    /// Loads the model; `library` is the ONNX Runtime library that was named.
    pub(super) fn of(args: &InstanceArgs, library: Option<&Path>) -> Result<Self> {
        let load = |path: &Path| InstanceModel::load(path, library, 0, args.limits());
        Ok(Self(args.instances.as_deref().map(load).transpose()?))
    }

    /// The things in an image, in the size of its depth.
    pub(super) fn find(&mut self, image: &RgbImage, depth: &DepthMap) -> Result<Vec<Instance>> {
        let Some(model) = &mut self.0 else {
            return Ok(Vec::new());
        };
        let found = model.find(image, [depth.width, depth.height])?;
        let instance = |thing: deepfusion_instances::Instance| Instance {
            class: thing.class,
            score: thing.score,
            drawn: thing.drawn,
            runs: thing
                .mask
                .runs
                .into_iter()
                .map(|[v, from, to]| Run { v, from, to })
                .collect(),
        };
        Ok(found.into_iter().map(instance).collect())
    }
}
