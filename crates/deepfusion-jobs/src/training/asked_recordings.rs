//! The recordings of a new run: those of its configuration, of which each part may be replaced.

use std::path::PathBuf;

use deepfusion_data::{Cameras, NamedTopic};
use deepfusion_model::{
    DataConfig, DataSetConfig, Error as ModelError, ExpectedSetting, FoundSetting, Learn,
};

use super::resume::{ClockAhead, Setting};
use crate::recordings::camera_word;
use crate::{Error, Result};

/// Requested recordings, and how they are opened. What is not set comes from the configuration.
#[derive(Debug, Clone, Default)]
pub struct AskedRecordings {
    /// Training recordings.
    pub paths: Vec<PathBuf>,
    /// Validation recordings.
    pub validation: Vec<PathBuf>,
    /// The split of the training recordings.
    pub split: Option<PathBuf>,
    /// The split of the validation recordings.
    pub validation_split: Option<PathBuf>,
    /// The cameras.
    pub camera: Option<Cameras>,
    /// Whether the other camera's image is used as a view, too; if no cameras are given, both are then opened.
    pub stereo: bool,
    /// What the network learns from.
    pub learn: Option<Learn>,
    /// How far the camera's clock is ahead. If it is to be measured, the caller who opens the recordings does that.
    pub clock: Option<ClockAhead>,
    /// The topics of bags.
    pub topics: Vec<NamedTopic>,
}

impl AskedRecordings {
    /// Replaces settings of a configuration by the requested ones.
    ///
    /// # Errors
    /// [`Error::BesideSets`] for a setting that each data set has for itself; [`ModelError::Config`] if there is nothing to learn from.
    pub fn replace_in(&self, data: &mut DataConfig) -> Result<()> {
        if let Some(setting) = self.beside_sets(&data.sets) {
            return Err(Error::BesideSets { setting });
        }
        if !self.paths.is_empty() {
            data.paths.clone_from(&self.paths);
        }
        if !self.validation.is_empty() {
            data.validation.clone_from(&self.validation);
        }
        if self.split.is_some() {
            data.split.clone_from(&self.split);
        }
        if self.validation_split.is_some() {
            data.validation_split.clone_from(&self.validation_split);
        }
        if let Some(ClockAhead::Seconds(ahead_s)) = self.clock {
            data.camera_ahead_s = Some(ahead_s);
        }
        if !self.topics.is_empty() {
            data.topics = self.topics.iter().map(ToString::to_string).collect();
        }
        data.learn = self.learn.unwrap_or(data.learn);
        if let Some(camera) = self.camera {
            data.camera = camera_word(camera).into();
        } else if self.stereo {
            data.camera = camera_word(Cameras::Both).into();
        } else if data.camera.is_empty() && data.sets.is_empty() {
            data.camera = camera_word(Cameras::default()).into();
        }
        if data.paths.is_empty() && data.sets.is_empty() {
            let (expected, found) = (ExpectedSetting::Recordings, FoundSetting::Nothing);
            return Err(ModelError::config("data", expected, found).into());
        }
        Ok(())
    }

    /// The first requested setting that data sets have for themselves.
    fn beside_sets(&self, sets: &[DataSetConfig]) -> Option<Setting> {
        if sets.is_empty() {
            return None;
        }
        let asked = [
            (Setting::Data, !self.paths.is_empty()),
            (Setting::Validation, !self.validation.is_empty()),
            (Setting::Split, self.split.is_some()),
            (Setting::ValidationSplit, self.validation_split.is_some()),
            // A conflict if every set has its own camera; otherwise it is the camera of those that have none.
            (
                Setting::Camera,
                self.camera.is_some() && sets.iter().any(|set| !set.camera.is_empty()),
            ),
            (Setting::Learn, self.learn.is_some()),
            (
                Setting::Clock,
                self.clock.is_some() && sets.iter().any(|set| set.camera_ahead_s.is_some()),
            ),
            (
                Setting::Topic,
                !self.topics.is_empty() && sets.iter().any(|set| !set.topics.is_empty()),
            ),
        ];
        let mut asked = asked.into_iter();
        asked.find_map(|(setting, is_asked)| is_asked.then_some(setting))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_model::Preset;

    #[test]
    fn requested_recordings_replace_the_configured_ones() {
        let mut data = Preset::Tiny.config().data;
        let none = AskedRecordings::default();
        let error = none.replace_in(&mut data).unwrap_err().to_string();
        assert!(
            error.contains("`data`") && error.contains("none"),
            "{error}"
        );
        data.paths = vec!["street".into()];
        data.camera.clear();
        none.replace_in(&mut data).unwrap();
        assert_eq!((data.paths.len(), data.camera.as_str()), (1, "2"));
        let asked = AskedRecordings {
            paths: vec!["a".into(), "b".into()],
            validation_split: Some("val.txt".into()),
            stereo: true,
            learn: Some(Learn::Both),
            clock: Some(ClockAhead::Seconds(0.25)),
            topics: vec!["image=/camera".parse().unwrap()],
            ..none
        };
        asked.replace_in(&mut data).unwrap();
        assert_eq!(data.paths, asked.paths);
        assert_eq!(data.validation_split, asked.validation_split);
        assert_eq!((data.camera.as_str(), data.learn), ("both", Learn::Both));
        assert_eq!(data.camera_ahead_s, Some(0.25));
        assert_eq!(data.topics, ["image=/camera"]);
        let measured = AskedRecordings {
            clock: Some(ClockAhead::Measured),
            ..AskedRecordings::default()
        };
        measured.replace_in(&mut data).unwrap();
        assert_eq!(data.camera_ahead_s, Some(0.25));
    }

    #[test]
    fn settings_of_data_sets_cannot_be_requested_separately() {
        let data = || -> DataConfig {
            toml::from_str("sets = [{ name = 'road', paths = ['road'], camera = '3' }]").unwrap()
        };
        let refused = |asked: AskedRecordings| asked.replace_in(&mut data());
        let none = AskedRecordings::default;
        refused(none()).unwrap();
        let camera = Some(Cameras::Both);
        for (setting, asked) in [
            (
                Setting::Data,
                AskedRecordings {
                    paths: vec!["a".into()],
                    ..none()
                },
            ),
            (
                Setting::Split,
                AskedRecordings {
                    split: Some("split.txt".into()),
                    ..none()
                },
            ),
            (Setting::Camera, AskedRecordings { camera, ..none() }),
        ] {
            let error = refused(asked).unwrap_err();
            assert!(
                matches!(&error, Error::BesideSets { setting: found } if *found == setting),
                "{error}"
            );
        }
        // Its sets have none of their own.
        let topics = vec!["image=/camera".parse().unwrap()];
        refused(AskedRecordings { topics, ..none() }).unwrap();
    }
}
