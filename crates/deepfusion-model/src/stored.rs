use std::path::Path;

use deepfusion_geometry::Intrinsics;

use crate::weights::{Weights, read_bytes};
use crate::{
    CheckpointKind, Error, Int8Calibration, RunFolder, TrainConfig, UnreadableCalibration,
};

/// A trained depth network as it is stored, in a run's folder or packed without one: everything that is needed to build it.
#[derive(Debug, Clone)]
pub struct StoredNetwork {
    /// The configuration of its run, as one of its data sets sees it.
    pub config: TrainConfig,
    /// The camera it learned with, at the size of its images; `None` for imported weights.
    pub camera: Option<Intrinsics>,
    /// The depth network's weights.
    pub weights: Weights,
    /// Steps it was trained for.
    pub step: usize,
    /// What it was calibrated to for int8, where it was.
    pub int8: Result<Option<Int8Calibration>, UnreadableCalibration>,
}

impl StoredNetwork {
    /// That of a run's folder or a checkpoint in it; the folder means `best` where there is one. `set` names one of the data
    /// sets it learned from, where it learned several.
    ///
    /// # Errors
    /// As [`RunFolder::open`], [`RunFolder::load_depth_weights`] and [`TrainConfig::for_set`].
    pub fn of_run(path: &Path, set: Option<&str>) -> Result<Self, Error> {
        let (folder, kind) = RunFolder::open(path)?;
        Self::of_checkpoint(&folder, kind.unwrap_or_else(|| folder.preferred()), set)
    }

    /// That of a checkpoint; `set` as in [`Self::of_run`].
    ///
    /// # Errors
    /// [`Error::EncodersOnly`]; as [`RunFolder::load_depth_weights`] and [`TrainConfig::for_set`].
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

    /// One without a run: its configuration as the table of a run's `config.toml`, and its tensors as the bytes of a safetensors
    /// file. `origin` is what error messages call it; `set` as in [`Self::of_run`].
    ///
    /// # Errors
    /// [`Error::ConfigFile`], [`Error::Network`] for what is neither, [`TrainConfig::for_set`]'s.
    pub fn packed(
        origin: &str,
        config: toml::Table,
        bytes: &[u8],
        step: usize,
        set: Option<&str>,
    ) -> Result<Self, Error> {
        // Not validated: it has no recordings, and trains nothing.
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
    /// The configuration without the places of its recordings and of what it started from, which mean nothing elsewhere.
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

    /// Each data set keeps its name and its metres, and says no more where it lay.
    #[test]
    fn data_sets_keep_their_metres() {
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
