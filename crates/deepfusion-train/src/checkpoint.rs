use std::path::PathBuf;

use burn::tensor::Device;
use deepfusion_model::{
    ArchitectureProblem, Checkpoint, CheckpointKind, CheckpointLacks, Error as ModelError,
    RunFolder, TrainConfig,
};
use deepfusion_nn::weights::{self, Weights};

use crate::{Adam, Error, LearnedFocal, Model};

/// Saves networks and optimiser to a run's checkpoints and loads them.
pub trait Checkpoints {
    /// Writes a checkpoint. It replaces the previous one only when it is complete.
    ///
    /// # Errors
    /// [`Error::Model`] naming the file.
    fn save(
        &self,
        kind: CheckpointKind,
        model: &Model,
        adam: Option<&Adam>,
        state: &Checkpoint,
    ) -> Result<PathBuf, Error>;

    /// The networks, the optimiser if it was saved, and the training progress.
    ///
    /// # Errors
    /// [`ModelError::Checkpoint`] for a file of another version; [`ModelError::NotResumable`] for one without the PoseNet of the
    /// configuration, or without the flow decoder that training needs; [`Error::Model`] for one of another architecture or whose moments do not fit its parameters, naming the first tensor
    /// that differs.
    fn load(
        &self,
        kind: CheckpointKind,
        config: &TrainConfig,
        device: &Device,
    ) -> Result<(Model, Option<Adam>, Checkpoint), Error>;

    /// The networks of a new run that starts from this one's, and the names of the parts that start anew because
    /// the checkpoint lacks them. If only the encoders were trained, only they are taken: the rest of the network
    /// may then differ.
    ///
    /// # Errors
    /// [`ModelError::Checkpoint`] for a file of another version, [`Error::Model`] for one of another architecture, naming
    /// the first tensor that differs.
    fn load_networks(
        &self,
        kind: CheckpointKind,
        config: &TrainConfig,
        device: &Device,
    ) -> Result<(Model, Vec<&'static str>), Error>;
}

impl Checkpoints for RunFolder {
    fn save(
        &self,
        kind: CheckpointKind,
        model: &Model,
        adam: Option<&Adam>,
        state: &Checkpoint,
    ) -> Result<PathBuf, Error> {
        let mut all = weights::collect(&model.depth_net).with_prefix("depth.");
        if let Some(pose_net) = &model.pose_net {
            all = all.merged(weights::collect(pose_net).with_prefix("pose."));
        }
        // Only training needs the flow decoder, but a new run may start from `best`.
        if let Some(decoder) = &model.flow_decoder {
            all = all.merged(weights::collect(decoder).with_prefix("flow."));
        }
        if let Some(focal) = &model.focal {
            all = all.merged(weights::collect(focal).with_prefix("focal."));
        }
        if let Some(adam) = adam {
            all = all.merged(adam.state().with_prefix("adam."));
            all.metadata
                .insert("adam_steps".into(), adam.steps().to_string());
        }
        let state = Checkpoint {
            focal_ratio: model.focal.as_ref().map(LearnedFocal::ratio),
            ..*state
        };
        all.metadata.extend(state.metadata());
        let path = self.checkpoint_path(kind);
        weights::write_safetensors(&path, &all)?;
        Ok(path)
    }

    fn load(
        &self,
        kind: CheckpointKind,
        config: &TrainConfig,
        device: &Device,
    ) -> Result<(Model, Option<Adam>, Checkpoint), Error> {
        let path = self.checkpoint_path(kind);
        let all = weights::read_safetensors_under(&path, "")?;
        let state = Checkpoint::of(&path, &all)?;
        let named = |prefix: &str| -> Weights { all.under(prefix) };
        let pose = named("pose.");
        if pose.tensors.is_empty() && !config.leaves_pose_net_out() {
            return Err(ModelError::NotResumable {
                path,
                reason: CheckpointLacks::PoseNet,
            }
            .into());
        }
        let mut model = Model::new(config, device)?;
        model.depth_net = weights::apply(model.depth_net, &named("depth."))?;
        if let Some(pose_net) = model.pose_net.take() {
            model.pose_net = Some(weights::apply(pose_net, &pose)?);
        }
        let new_decoder = take_flow_decoder(&mut model, &named("flow."))?;
        if let Some(focal) = model.focal.take() {
            model.focal = Some(weights::apply(focal, &named("focal."))?);
        }
        if !all.metadata.contains_key("adam_steps") {
            return Ok((model, None, state));
        }
        if new_decoder {
            return Err(ModelError::NotResumable {
                path,
                reason: CheckpointLacks::FlowDecoder,
            }
            .into());
        }
        let steps = Checkpoint::number(&path, &all, "adam_steps")?;
        let steps = u32::try_from(steps).unwrap_or(u32::MAX);
        let adam = Adam::restore(named("adam."), steps, &model)?;
        Ok((model, Some(adam), state))
    }

    fn load_networks(
        &self,
        kind: CheckpointKind,
        config: &TrainConfig,
        device: &Device,
    ) -> Result<(Model, Vec<&'static str>), Error> {
        let path = self.checkpoint_path(kind);
        let named = |prefix: &str| weights::read_safetensors_under(&path, prefix);
        let depth = named("depth.")?;
        let encoders_only = Checkpoint::of(&path, &depth)?.encoders_only;
        let pose = named("pose.")?;
        let mut model = Model::new(config, device)?;
        if encoders_only {
            let (depth, pose) = (depth.under("encoder."), pose.under("encoder."));
            let kind = model.depth_net.kind();
            let encoder = model.depth_net.encoder.take();
            let encoder = encoder.ok_or_else(|| deepfusion_nn::Error::UnknownArchitecture {
                origin: path.display().to_string(),
                reason: ArchitectureProblem::EncodersForOther { network: kind },
            })?;
            model.depth_net.encoder = Some(weights::apply(encoder, &depth)?);
            if let Some(pose_net) = &mut model.pose_net {
                pose_net.encoder = weights::apply(pose_net.encoder.clone(), &pose)?;
            }
            return Ok((model, vec!["everything but the encoders"]));
        }
        let (depth_net, new_head) = model.depth_net.with_weights(&depth)?;
        model.depth_net = depth_net;
        let (mut new_pose_net, mut new_masks) = (false, false);
        if let Some(pose_net) = model.pose_net.take() {
            // A run that left PoseNet out has none, nor has an imported depth network.
            new_pose_net = pose.tensors.is_empty();
            model.pose_net = Some(if new_pose_net {
                pose_net
            } else {
                let (pose_net, without_masks) = pose_net.with_weights(&pose)?;
                new_masks = without_masks;
                pose_net
            });
        }
        let new_decoder = take_flow_decoder(&mut model, &named("flow.")?)?;
        let new = [
            new_pose_net.then_some("PoseNet"),
            new_masks.then_some("the explainability masks"),
            new_decoder.then_some("the flow decoder"),
            new_head.then_some("the uncertainty head"),
        ];
        Ok((model, new.into_iter().flatten().collect()))
    }
}

/// Gives the model a checkpoint's flow decoder. Returns whether the checkpoint has none, so that the model keeps its own, new
/// one.
fn take_flow_decoder(model: &mut Model, saved: &Weights) -> Result<bool, Error> {
    let Some(decoder) = model.flow_decoder.take() else {
        return Ok(false);
    };
    let missing = saved.tensors.is_empty();
    model.flow_decoder = Some(if missing {
        decoder
    } else {
        weights::apply(decoder, saved)?
    });
    Ok(missing)
}
