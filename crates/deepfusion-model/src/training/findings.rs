//! What a run measured in its data, separate from its configuration.

use std::path::{Path, PathBuf};

use deepfusion_geometry::Intrinsics;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::{LearnedCamera, TrainConfig};
use crate::Error;

/// Name of the table in a run's `config.toml`.
const TABLE: &str = "findings";

/// What a run measured in its data when it began. Users do not set it, and without it the networks' outputs do not mean metres.
///
/// It is the table `[findings]` of the run's `config.toml`. If that file serves as the configuration of another run, the table is ignored.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainFindings {
    /// Metres of translation per unit of PoseNet's output, if `pose_net.metres_per_unit` is 0: the mean displacement of a pair.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metres_per_unit: Option<f64>,
    /// The training camera, at the size of its images; `None` for imported weights. If there were several cameras: the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<Intrinsics>,
    /// f_c of the training, like `canonical_focal_px`, if that is absent and the training data has several focal lengths: the first
    /// camera's, in pixels of the network's input.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal_px: Option<f64>,
    /// How precisely that camera is known, if the run learned it; written when the run ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learned_camera: Option<LearnedCamera>,
    /// The findings for each of `data.sets`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sets: Vec<SetFindings>,
    /// The networks of which its weights are the mean; empty if it was trained.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub averaged: Vec<AveragedNetwork>,
}

/// One of the networks of which a run's weights are the mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AveragedNetwork {
    /// Path of a checkpoint or a packed file; with `sha256`, the name of an embedded network.
    pub path: PathBuf,
    /// SHA-256 of the embedded network's weights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// Its share of the mean; all shares sum to 1.
    pub share: f64,
}

/// What a run measured in one of its data sets.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SetFindings {
    /// The set's name in `data.sets`.
    pub name: String,
    /// Metres of translation per unit of PoseNet's output, if the set's own `metres_per_unit` is 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metres_per_unit: Option<f64>,
    /// The camera of its first sample, at the size of its images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<Intrinsics>,
}

impl TrainFindings {
    /// The findings in a configuration file, whether or not it names every key; empty if the file is not a run's.
    ///
    /// # Errors
    /// [`Error::NoSuchFile`], [`Error::Io`], [`Error::ConfigFile`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))?;
        let wrong = |e: toml::de::Error| Error::ConfigFile {
            path: path.to_owned(),
            reason: e.into(),
        };
        let mut table: Table = toml::from_str(&text).map_err(wrong)?;
        let found = Self::take_from(&mut table).map_err(wrong)?;
        Ok(found.unwrap_or_default())
    }

    /// The configuration, with the metres per unit filled in if it leaves them open.
    #[must_use]
    pub fn complete(&self, mut config: TrainConfig) -> TrainConfig {
        let fill = |open: &mut f64, found: Option<f64>| {
            if *open == 0.0 {
                *open = found.unwrap_or(0.0);
            }
        };
        fill(&mut config.pose_net.metres_per_unit, self.metres_per_unit);
        for set in &mut config.data.sets {
            fill(
                &mut set.metres_per_unit,
                self.set(&set.name).and_then(|found| found.metres_per_unit),
            );
        }
        config
    }

    /// Like [`Self::complete`], and also with the focal length to which samples are brought. For further training only: predictions use the
    /// first camera, which has this focal length.
    #[must_use]
    pub fn complete_for_training(&self, config: TrainConfig) -> TrainConfig {
        let mut config = self.complete(config);
        config.canonical_focal_px = config.canonical_focal_px.or(self.focal_px);
        config
    }

    /// The camera that a data set was trained with; `set` as for [`TrainConfig::for_set`].
    #[must_use]
    pub fn camera_of(&self, config: &TrainConfig, set: Option<&str>) -> Option<Intrinsics> {
        let selected = config.selected_set(set);
        let own = selected.and_then(|selected| self.set(&selected.name));
        own.and_then(|own| own.camera).or(self.camera)
    }

    /// Stores a learned camera, also for every data set whose motion is learned.
    pub fn learn_camera(&mut self, config: &TrainConfig, camera: Intrinsics) {
        self.camera = Some(camera);
        for set in config
            .data
            .sets
            .iter()
            .filter(|set| set.learn.from_motion())
        {
            let found = self.sets.iter_mut().find(|found| found.name == set.name);
            if let Some(found) = found {
                found.camera = Some(camera);
            }
        }
    }

    fn set(&self, name: &str) -> Option<&SetFindings> {
        self.sets.iter().find(|set| set.name == name)
    }

    /// The findings as lines to append to a configuration; empty if there are none.
    pub(crate) fn to_toml(&self) -> Result<String, toml::ser::Error> {
        let mut table = Table::new();
        self.put_into(&mut table)?;
        if table.is_empty() {
            Ok(String::new())
        } else {
            Ok(format!("\n{}", toml::to_string_pretty(&table)?))
        }
    }

    fn put_into(&self, config: &mut Table) -> Result<(), toml::ser::Error> {
        if *self != Self::default() {
            config.insert(TABLE.into(), Value::try_from(self)?);
        }
        Ok(())
    }

    /// Takes the findings out of a configuration's table: `[findings]`, or the keys that older runs have instead (`camera`, and
    /// `trained_with` of each set). `None` if there are neither.
    pub(super) fn take_from(config: &mut Table) -> Result<Option<Self>, toml::de::Error> {
        if let Some(findings) = config.remove(TABLE) {
            return findings.try_into().map(Some);
        }
        let camera = config.remove("camera").map(Value::try_into).transpose()?;
        let data = config.get_mut("data").and_then(|data| data.get_mut("sets"));
        let mut sets = Vec::new();
        for set in data.and_then(Value::as_array_mut).into_iter().flatten() {
            let Some(set) = set.as_table_mut() else {
                continue;
            };
            let name = set.get("name").and_then(Value::as_str).map(str::to_owned);
            if let Some(camera) = set.remove("trained_with") {
                sets.push(SetFindings {
                    name: name.unwrap_or_default(),
                    metres_per_unit: None,
                    camera: Some(camera.try_into()?),
                });
            }
        }
        let found = Self {
            camera,
            sets,
            ..Self::default()
        };
        Ok((found != Self::default()).then_some(found))
    }
}

impl TrainConfig {
    /// A run's configuration and findings, from the table of its `config.toml` or of an embedded network's card.
    ///
    /// # Errors
    /// An error about the first key that is unknown, missing, or of another type.
    pub fn from_run_table(mut table: Table) -> Result<(Self, TrainFindings), toml::de::Error> {
        let findings = TrainFindings::take_from(&mut table)?;
        Ok((table.try_into()?, findings.unwrap_or_default()))
    }

    /// The table of a run's configuration and findings; [`Self::from_run_table`] reads it.
    ///
    /// # Errors
    /// An error about values that have no TOML form.
    pub fn to_run_table(&self, findings: &TrainFindings) -> Result<Table, toml::ser::Error> {
        let mut table = Table::try_from(self)?;
        findings.put_into(&mut table)?;
        Ok(table)
    }

    /// Like [`Self::from_run_table`], from the text of a file.
    pub(crate) fn from_run_text(text: &str) -> Result<(Self, TrainFindings), toml::de::Error> {
        // For a configuration alone, this error names the line.
        toml::from_str(text).map_or_else(
            |error| {
                let mut table: Table = toml::from_str(text)?;
                match TrainFindings::take_from(&mut table)? {
                    Some(findings) => Ok((table.try_into()?, findings)),
                    None => Err(error),
                }
            },
            |config| Ok((config, TrainFindings::default())),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Preset;

    fn camera(fx: f64) -> Intrinsics {
        Intrinsics {
            fx,
            fy: fx,
            cx: 159.5,
            cy: 47.5,
            width: 320,
            height: 96,
        }
    }

    /// A run with two data sets; one of them sets its metres per unit.
    fn config() -> TrainConfig {
        let mut config = Preset::Tiny.config();
        config.data = toml::from_str(
            "sets = [{ name = 'road', paths = ['/road'] }, { name = 'hall', paths = ['/hall'], metres_per_unit = 0.25 }]",
        )
        .unwrap();
        config
    }

    fn findings() -> TrainFindings {
        let set = |name: &str, metres_per_unit, fx| SetFindings {
            name: name.into(),
            metres_per_unit,
            camera: Some(camera(fx)),
        };
        TrainFindings {
            metres_per_unit: Some(0.8),
            camera: Some(camera(230.4)),
            focal_px: Some(230.4),
            learned_camera: Some(LearnedCamera {
                focal_px: [230.4, 230.4],
                sigma_px: Some([3.0, 4.0]),
                step: 12,
            }),
            sets: vec![set("road", Some(1.1), 230.4), set("hall", None, 150.0)],
            averaged: vec![AveragedNetwork {
                path: "/runs/first/best.safetensors".into(),
                sha256: None,
                share: 0.25,
            }],
        }
    }

    #[test]
    fn a_runs_file_keeps_settings_and_findings_apart() {
        let (config, findings) = (config(), findings());
        let text = config.to_toml().unwrap() + &findings.to_toml().unwrap();
        assert!(text.contains("\n[findings]\n"), "{text}");
        let read = TrainConfig::from_run_text(&text).unwrap();
        assert_eq!(read, (config.clone(), findings));
        assert_eq!(read.0.pose_net.metres_per_unit, 0.0, "what was set stays");
        // Empty findings write nothing.
        let text = config.to_toml().unwrap() + &TrainFindings::default().to_toml().unwrap();
        assert!(!text.contains(TABLE));
        let wrong = text.replace("batch = 4", "batsch = 4");
        let error = TrainConfig::from_run_text(&wrong).unwrap_err().to_string();
        assert!(
            error.contains("line") && error.contains("batsch"),
            "{error}"
        );
    }

    #[test]
    fn a_files_findings_are_read_without_its_settings() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("config.toml");
        let found = findings().to_toml().unwrap();
        for settings in [config().to_toml().unwrap(), "preset = \"tiny\"\n".into()] {
            std::fs::write(&path, format!("{settings}{found}")).unwrap();
            assert_eq!(TrainFindings::read(&path).unwrap(), findings());
            std::fs::write(&path, &settings).unwrap();
            assert_eq!(
                TrainFindings::read(&path).unwrap(),
                TrainFindings::default()
            );
        }
        std::fs::write(&path, "preset =").unwrap();
        let error = TrainFindings::read(&path).unwrap_err().to_string();
        assert!(error.contains("config.toml"), "{error}");
    }

    #[test]
    fn open_values_are_filled_in_and_set_values_stay() {
        let complete = findings().complete(config());
        assert_eq!(complete.pose_net.metres_per_unit, 0.8);
        assert_eq!(complete.canonical_focal_px, None);
        let training = findings().complete_for_training(config());
        assert_eq!(training.canonical_focal_px, Some(230.4));
        let units = complete.data.sets.iter().map(|set| set.metres_per_unit);
        assert_eq!(units.collect::<Vec<_>>(), [1.1, 0.25]);
        let fx = |set| findings().camera_of(&complete, set).map(|k| k.fx);
        assert_eq!(fx(Some("hall")), Some(150.0));
        assert_eq!(fx(None), Some(230.4));
        assert_eq!(TrainFindings::default().complete(config()), config());
    }

    /// Older runs, and cards of embedded networks, without the table.
    #[test]
    fn older_runs_are_read() {
        let mut expected = config();
        expected.pose_net.metres_per_unit = 0.8;
        expected.data.sets[0].metres_per_unit = 1.1;
        let mut table = Table::try_from(&expected).unwrap();
        let value = |fx| Value::try_from(camera(fx)).unwrap();
        table.insert("camera".into(), value(230.4));
        let sets = table["data"].get_mut("sets").unwrap();
        for (set, fx) in sets.as_array_mut().unwrap().iter_mut().zip([230.4, 150.0]) {
            let set = set.as_table_mut().unwrap();
            set.insert("trained_with".into(), value(fx));
        }
        let text = toml::to_string_pretty(&table).unwrap();
        let again = expected.to_run_table(&findings()).unwrap();
        let again = TrainConfig::from_run_table(again).unwrap();
        assert_eq!(again, (expected.clone(), findings()));
        for (config, older) in [
            TrainConfig::from_run_table(table).unwrap(),
            TrainConfig::from_run_text(&text).unwrap(),
        ] {
            assert_eq!(config, expected);
            assert_eq!(older.camera, findings().camera);
            assert_eq!(
                older.camera_of(&config, Some("hall")).map(|k| k.fx),
                Some(150.0)
            );
            assert_eq!(older.complete(config), expected, "its units are set");
        }
    }
}
