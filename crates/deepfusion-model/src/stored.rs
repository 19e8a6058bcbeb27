use std::path::Path;

use deepfusion_geometry::Intrinsics;

use crate::weights::{Weights, read_bytes};
use crate::{
    CheckpointKind, Error, Int8Calibration, RunFolder, TrainConfig, UnreadableCalibration,
};

/// A trained depth network as stored in a run's folder or packed without one: everything needed to build it.
#[derive(Debug, Clone)]
pub struct StoredNetwork {
    /// The configuration of its run, as one of its data sets sees it.
    pub config: TrainConfig,
    /// The camera it was trained with, at the size of its images; `None` for imported weights.
    pub camera: Option<Intrinsics>,
    /// The depth network's weights.
    pub weights: Weights,
    /// Number of steps it was trained for.
    pub step: usize,
    /// Its calibration for int8, if it has one.
    pub int8: Result<Option<Int8Calibration>, UnreadableCalibration>,
}

impl StoredNetwork {
    /// Reads the network of a run. `path` is the run's folder, which means `best` if it exists, or a checkpoint in it. `set` names one of
    /// the data sets it was trained on, if there are several.
    ///
    /// # Errors
    /// As for [`RunFolder::open`], [`RunFolder::load_depth_weights`] and [`TrainConfig::for_set`].
    pub fn of_run(path: &Path, set: Option<&str>) -> Result<Self, Error> {
        let (folder, kind) = RunFolder::open(path)?;
        Self::of_checkpoint(&folder, kind.unwrap_or_else(|| folder.preferred()), set)
    }

    /// Reads the network of a checkpoint; `set` as in [`Self::of_run`].
    ///
    /// # Errors
    /// [`Error::EncodersOnly`], and those of [`RunFolder::load_depth_weights`] and [`TrainConfig::for_set`].
    pub fn of_checkpoint(
        folder: &RunFolder,
        kind: CheckpointKind,
        set: Option<&str>,
    ) -> Result<Self, Error> {
        let config = folder.read_config()?.for_set(set)?;
        let (weights, state) = folder.load_depth_weights(kind)?;
        state.require_trained(&folder.checkpoint_path(kind))?;
        Ok(Self {
            config,
            camera: folder.camera_of(&state, set)?,
            weights,
            step: state.step,
            int8: Int8Calibration::of_run(folder.path(), state.step),
        })
    }

    /// Reads a network stored without a run: its configuration as the table of a run's `config.toml`, and its tensors as the bytes of a
    /// safetensors file. Error messages call it `origin`; `set` as in [`Self::of_run`].
    ///
    /// # Errors
    /// [`Error::ConfigFile`] or [`Error::Network`] for invalid content, and those of [`TrainConfig::for_set`].
    pub fn packed(
        origin: &str,
        config: toml::Table,
        bytes: &[u8],
        step: usize,
        set: Option<&str>,
    ) -> Result<Self, Error> {
        // Not validated, as it has no recordings and is not for training.
        let read = TrainConfig::from_run_table(config);
        let (config, findings) = read.map_err(|e| Error::ConfigFile {
            path: origin.into(),
            reason: e.into(),
        })?;
        Ok(Self {
            camera: findings.camera_of(&config, set),
            config: findings.complete(config).for_set(set)?,
            weights: read_bytes(origin, bytes)?,
            step,
            int8: Ok(None),
        })
    }
}

impl TrainConfig {
    /// The configuration without the paths of recordings and initial weights, which are meaningless elsewhere.
    #[must_use]
    pub fn without_places(&self) -> Self {
        let mut config = self.clone();
        (config.init, config.init_sha256) = (None, None);
        let data = &mut config.data;
        data.paths.clear();
        data.validation.clear();
        (data.split, data.validation_split) = (None, None);
        for set in &mut data.sets {
            set.paths.clear();
            set.validation.clear();
            (set.split, set.validation_split) = (None, None);
        }
        config
    }
}

#[cfg(test)]
mod tests {
    use crate::Preset;

    /// Each data set keeps its name and its depth range, but not its paths.
    #[test]
    fn data_sets_keep_their_depth_ranges() {
        let mut config = Preset::Tiny.config();
        config.data = toml::from_str(
            "sets = [{ name = 'road', paths = ['/road'] }, { name = 'hall', paths = ['/hall'], range = { min_m = 0.2, max_m = 10.0 } }]",
        )
        .unwrap();
        let bare = config.without_places();
        assert!(!bare.to_toml().unwrap().contains("/hall"));
        let hall = bare.for_set(Some("hall")).unwrap();
        assert_eq!(hall.depth_net.range.max_m, 10.0);
    }
}
