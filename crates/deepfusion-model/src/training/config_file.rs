//! Configurations written by people: a whole file, some keys over a preset, or one key on the command line.

use crate::{Compute, Error, ExpectedSetting, Preset, SettingProblem, TrainConfig, TrainFindings};
use std::path::Path;
use toml::{Table, Value};

use super::setting_key;

/// The word that removes an optional value in [`TrainConfig::set`].
const NONE: &str = "none";

impl TrainConfig {
    /// Reads a TOML file that names every key, or a `preset` and the keys that differ from it. Tables are merged key by key, lists are
    /// replaced whole.
    ///
    /// A file that names every key ignores its preset: optional keys that it leaves out are absent.
    ///
    /// # Errors
    /// [`Error::NoSuchFile`], [`Error::Io`], [`Error::ConfigFile`] naming the line or the key, and those of [`Self::validate`].
    pub fn read_over_preset(path: &Path, compute: Compute) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))?;
        let wrong = |e: toml::de::Error| Error::ConfigFile {
            path: path.to_owned(),
            reason: e.into(),
        };
        let config = match Self::from_run_text(&text) {
            Ok((whole, _)) => whole,
            Err(whole) => {
                let mut keys: Table = toml::from_str(&text).map_err(wrong)?;
                TrainFindings::take_from(&mut keys).map_err(wrong)?;
                match keys.get("preset") {
                    None => return Err(wrong(whole)),
                    Some(preset) => {
                        let preset: Preset = preset.clone().try_into().map_err(wrong)?;
                        let mut table = table_of(&preset.config_on(compute))?;
                        merge(&mut table, keys);
                        table.try_into().map_err(wrong)?
                    }
                }
            }
        };
        config.validate()?;
        Ok(config)
    }

    /// Sets one key, as in `loss.smoothness=0.01`: dots between tables, then a TOML value or a bare word; `none` removes an optional value.
    /// An element of a list is named by its index in brackets, counted from 0: `data.sets[0].learn=depth`. The number of elements changes
    /// only if the list is set as a whole. The result is not validated.
    ///
    /// # Errors
    /// [`Error::Setting`] for a key that does not exist or a value that it cannot have; [`Error::PresetAsKey`].
    pub fn set(&mut self, assignment: &str) -> Result<(), Error> {
        let wrong = |reason| Error::Setting {
            assignment: assignment.to_owned(),
            reason,
        };
        let Some((key, value)) = assignment.split_once('=') else {
            return Err(wrong(SettingProblem::NoValue));
        };
        let (key, value) = (key.trim(), value.trim());
        if key == "preset" {
            // Only its name would change, none of its settings.
            return Err(Error::PresetAsKey {
                assignment: assignment.to_owned(),
            });
        }
        let value = (value != NONE).then(|| parsed(value));
        let mut config = Value::Table(table_of(self)?);
        setting_key::put(&mut config, key, value).map_err(wrong)?;
        let changed = config.try_into::<Self>();
        *self = changed.map_err(|e| wrong(setting_key::problem(key, e)))?;
        Ok(())
    }
}

/// Parses a TOML value, or takes the text itself: `light` needs no quotes.
fn parsed(text: &str) -> Value {
    let read: Result<Table, _> = toml::from_str(&format!("value = {text}"));
    let value = read.ok().and_then(|mut table| table.remove("value"));
    value.unwrap_or_else(|| Value::String(text.to_owned()))
}

fn table_of(config: &TrainConfig) -> Result<Table, Error> {
    Table::try_from(config).map_err(|e| Error::config("config", ExpectedSetting::TomlValues, e))
}

fn merge(base: &mut Table, over: Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            (Some(Value::Table(base)), Value::Table(over)) => merge(base, over),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;

    fn read(text: &str) -> Result<TrainConfig, Error> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.toml");
        std::fs::write(&path, text).unwrap();
        TrainConfig::read_over_preset(&path, Compute::Processor)
    }

    #[test]
    fn a_few_keys_change_a_preset() {
        let config = read(
            "preset = \"light\"\nbatch = 7\n[loss]\nsmoothness = 0.5\n[loss.depth]\nweight = 2\n",
        )
        .unwrap();
        let mut expected = Preset::Light.config_on(Compute::Processor);
        expected.batch = 7;
        expected.loss.smoothness = 0.5;
        expected.loss.depth.weight = 2.0;
        assert_eq!(config, expected);
    }

    /// The paper's preset has a context encoding; a whole file that leaves it out configures a network without it.
    #[test]
    fn a_whole_file_ignores_its_preset() {
        let mut config = Preset::Paper.config();
        config.depth_net.hce = None;
        assert_eq!(read(&config.to_toml().unwrap()).unwrap(), config);
        let few = read("preset = \"paper\"\nseed = 3\n").unwrap();
        assert!(few.depth_net.hce.is_some());
    }

    #[test]
    fn errors_name_the_file_and_the_key() {
        for (text, expected) in [
            ("preset = \"light\"\nbatsch = 7\n", "batsch"),
            (
                "preset = \"light\"\n[loss]\nsmoothness = \"much\"\n",
                "smoothness",
            ),
            ("preset = \"lihgt\"\n", "lihgt"),
            ("batch = 7\n", "preset"),
            ("preset = \"light\"\nbatch = \n", "2"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(
                error.contains("run.toml") && error.contains(expected),
                "{error}"
            );
        }
        // Values are checked as in a whole file.
        let error = read("preset = \"light\"\nclip_norm = -1.0\n").unwrap_err();
        assert!(error.to_string().contains("`clip_norm`"), "{error}");
    }

    #[test]
    fn a_misspelt_key_is_named_with_a_suggestion() {
        let message = |assignment: &str| {
            let mut config = Preset::Light.config();
            config.set(assignment).unwrap_err().to_string()
        };
        for (assignment, expected) in [
            (
                "bacth=3",
                "bacth=3: unknown key `bacth`: did you mean `batch`?",
            ),
            (
                "loss.smothness=0.1",
                "loss.smothness=0.1: unknown key `loss.smothness`: did you mean `loss.smoothness`?",
            ),
            ("hope=1", "hope=1: unknown key `hope`"),
        ] {
            assert_eq!(message(assignment), expected);
        }
        // The key exists, but the value is invalid.
        assert!(!message("batch=many").contains("unknown key"));
    }

    #[test]
    fn single_keys_can_be_set() {
        let mut config = Preset::Light.config();
        for assignment in [
            "batch=3",
            "loss.depth.weight = 2",
            "view_motion=vehicle",
            "canonical_focal_px=185",
            "frames=[-1, 1]",
            "size.width=320",
            "depth_net.initial_depth_m=none",
            "init=none",
            "assumed_camera=none",
            "assumed_camera.hfov_deg=none",
            "depth_net.disp_net.base_width=none",
            "depth_net.hce.min_width=16",
        ] {
            config.set(assignment).unwrap();
        }
        let mut expected = Preset::Light.config();
        expected.batch = 3;
        expected.loss.depth.weight = 2.0;
        expected.view_motion = crate::ViewMotion::Vehicle;
        expected.canonical_focal_px = Some(185.0);
        expected.frames = vec![-1, 1];
        expected.size.width = 320;
        expected.depth_net.initial_depth_m = None;
        let hce = crate::HceConfig {
            min_width: 16,
            ..Default::default()
        };
        expected.depth_net.hce = Some(hce);
        assert_eq!(config, expected);

        for (assignment, reason) in [
            ("batch", "KEY=VALUE"),
            ("batsch=3", "batsch"),
            ("loss.depht.weight=2", "depht"),
            ("batch=many", "expected a whole number"),
            ("loss.smoothness=much", "expected a number"),
            ("batch=none", "batch"),
            ("batsch=none", "batsch"),
            ("batch.size=3", "not a table"),
        ] {
            let error = config.set(assignment).unwrap_err();
            assert!(matches!(error, Error::Setting { .. }));
            let text = error.to_string();
            assert!(text.contains(reason) && text.contains(assignment), "{text}");
            assert!(error.hint().is_some());
        }
        let of_lists = [
            ("augmentation.sizes[0].width=64", "0 elements"),
            ("frames[2]=1", "2 elements"),
            ("frames[0]=none", "one element of a list"),
            ("size[0]=64", "not a list"),
            ("frames.first=1", "such as frames[0]"),
            ("frames[*]=1", "number in brackets"),
            ("data.sets.learn=depth", "an empty list"),
            ("frames[0]=far", "far"),
        ];
        for (assignment, reason) in of_lists {
            let text = config.set(assignment).unwrap_err().to_string();
            assert!(text.contains(reason) && text.contains(assignment), "{text}");
        }
        let error = config.set("preset=tiny").unwrap_err();
        assert!(matches!(error, Error::PresetAsKey { .. }), "{error}");
        assert!(error.to_string().contains("preset=tiny"), "{error}");
        assert_eq!(config, expected, "failed assignments change nothing");
    }

    #[test]
    fn single_elements_of_lists_can_be_set() {
        let mut config = Preset::Light.config();
        for assignment in [
            "frames=[-1, 1]",
            "frames[0]=-2",
            "augmentation.sizes=[{width = 416, height = 128}, {width = 320, height = 96}]",
            "augmentation.sizes[1].width = 352",
            "data.sets=[{name = \"a\", paths = [\"drive\"]}]",
            "data.sets[0].learn=depth",
            "data.sets[0].paths[0]=other",
        ] {
            config.set(assignment).unwrap();
        }
        let mut expected = Preset::Light.config();
        expected.frames = vec![-2, 1];
        expected.augmentation.sizes = [(416, 128), (352, 96)]
            .map(|(width, height)| crate::InputSize { width, height })
            .to_vec();
        assert_eq!(config.data.sets.len(), 1);
        let set = &config.data.sets[0];
        assert_eq!((&*set.name, set.learn), ("a", crate::Learn::Depth));
        assert_eq!(set.paths, [Path::new("other")]);
        expected.data.sets.clone_from(&config.data.sets);
        assert_eq!(config, expected);
    }
}
