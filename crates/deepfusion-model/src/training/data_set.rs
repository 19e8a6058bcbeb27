//! Several data sets in one run, each with its own cameras, depth range and unit of translation.

use crate::{AskedBy, Error, ExpectedDataSet, ExpectedSetting, FoundSetting, TrainConfig};
use deepfusion_geometry::{DepthRange, Intrinsics};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// What to learn from a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Learn {
    /// Depth from its own motion: one frame synthesised from another.
    #[default]
    #[serde(rename = "self")]
    OwnMotion,
    /// The depth recorded with it, image by image; needs no speed.
    Depth,
    /// Both.
    Both,
}

impl Learn {
    /// Its name, on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::OwnMotion => "self",
            Self::Depth => "depth",
            Self::Both => "both",
        }
    }

    /// Whether to learn from pairs of frames.
    #[must_use]
    pub fn from_motion(self) -> bool {
        self != Self::Depth
    }

    /// Whether to learn from known depth.
    #[must_use]
    pub fn from_depth(self) -> bool {
        self != Self::OwnMotion
    }

    pub(crate) fn is_own_motion(&self) -> bool {
        *self == Self::OwnMotion
    }
}

/// Simulated views that are rendered during training, each one new, without a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SimulatedConfig {
    /// Random seed, which decides the worlds.
    pub seed: u64,
    /// Views that count as one pass over the data.
    pub views: usize,
    /// Views of other worlds to validate on, the same each time.
    pub validation_views: usize,
    /// Views of a world before another world takes its place.
    pub views_per_world: usize,
    /// Share of the worlds that are drawn as by `simulate`: not varied, in clear weather, through a camera without noise.
    pub plain: f64,
    /// Share of the varied outdoor views whose road rises and falls ahead of the camera.
    pub hills: f64,
    /// Share of the varied views with people in them, on streets, in parks and on country roads. They ride bicycles ahead of the camera and
    /// towards it, walk along pavements and cross the road, where there is room for them.
    pub riders: f64,
    /// Whether to apply a camera's image formation (exposure, noise, blur, JPEG and so on).
    pub formation: bool,
    /// Kinds of scene, all equally often: `urban`, `park`, `garage`, `commercial`, `night`, `motorway`, `country`, `indoor`; empty: all of
    /// them, streets most often. For a robot in rooms: `["indoor"]`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scenes: Vec<String>,
    /// What to leave out of the varied views, to measure what it is worth: `camera-height`, `camera-tilt`, `lenses`, `squeeze`, `weather`,
    /// `variety`, `traffic`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<String>,
    /// Cameras of your own vehicles, which then take all views; empty: any camera.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<SimulatedCamera>,
}

/// A camera as mounted on a vehicle, through which simulated views are seen. Its image may have any size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimulatedCamera {
    /// Width of its image, in pixels.
    pub width: u32,
    /// Height of its image, in pixels.
    pub height: u32,
    /// Focal length along x, in pixels of that image.
    pub fx: f64,
    /// Focal length along y, in pixels.
    pub fy: f64,
    /// Principal point, x, in pixels.
    pub cx: f64,
    /// Principal point, y, in pixels.
    pub cy: f64,
    /// Height of the camera above the ground, in metres; absent: any height that cameras on cars have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// How far the camera looks down, in degrees.
    #[serde(default)]
    pub pitch_degrees: f64,
    /// How far the camera is rotated about its axis, clockwise in viewing direction, in degrees.
    #[serde(default)]
    pub roll_degrees: f64,
}

impl SimulatedCamera {
    /// Its lens.
    #[must_use]
    pub fn intrinsics(&self) -> Intrinsics {
        let numbers = [self.fx, self.fy, self.cx, self.cy];
        Intrinsics::from_numbers(numbers, (self.width, self.height))
    }
}

impl Default for SimulatedConfig {
    fn default() -> Self {
        Self {
            seed: 0,
            views: 4000,
            validation_views: 64,
            views_per_world: 24,
            plain: 0.0,
            hills: 0.0,
            riders: 0.0,
            formation: true,
            scenes: Vec::new(),
            without: Vec::new(),
            cameras: Vec::new(),
        }
    }
}

/// One of several data sets that a run learns from (`[[data.sets]]` in a configuration file).
///
/// The networks' raw outputs stay near one for each of them: the sigmoid spans the set's own range of depths, and a unit of PoseNet's
/// translation is the set's own mean displacement. So the networks' outputs mean metres only together with a set: [`TrainConfig::for_set`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DataSetConfig {
    /// Name by which the set is chosen.
    pub name: String,
    /// Drive folders, date folders or KITTI roots.
    pub paths: Vec<PathBuf>,
    /// Recordings to validate on; empty: the held-out end of each drive. Given for all sets or for none.
    pub validation: Vec<PathBuf>,
    /// A split file that selects the frames to train on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split: Option<PathBuf>,
    /// A split file that selects the frames to validate on, from `validation` or, if that is empty, from `paths`. Either of the two is
    /// given for all sets or for none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub validation_split: Option<PathBuf>,
    /// How far the cameras' clock is ahead of the vehicles', in seconds; absent: `data.camera_ahead_s`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera_ahead_s: Option<f64>,
    /// Which topic of its bags to use for a role, such as `image=/camera/front/image_raw`; empty: `data.topics`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub topics: Vec<String>,
    /// Which cameras to use: `2`, `3` or `both`; empty: `data.camera`.
    pub camera: String,
    /// What to learn from it.
    #[serde(skip_serializing_if = "Learn::is_own_motion")]
    pub learn: Learn,
    /// Simulated views instead of recordings; `learn` is then `depth`, and there are no `paths`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulated: Option<SimulatedConfig>,
    /// Depths that the sigmoid spans; absent: the depth network's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<DepthRange>,
    /// Metres of translation per unit of PoseNet's output; 0: the set's mean displacement per pair.
    pub metres_per_unit: f64,
}

impl DataSetConfig {
    /// Whether it has separate frames for validation.
    #[must_use]
    pub fn validates(&self) -> bool {
        !self.validation.is_empty() || self.validation_split.is_some()
    }

    /// Checks the settings of simulated views, and that no conflicting settings are given.
    fn validate_simulated(&self, simulated: &SimulatedConfig) -> Result<(), Error> {
        let set = || self.name.clone();
        if self.learn != Learn::Depth {
            let found = FoundSetting::AnotherIn { set: set() };
            return Err(Error::config(
                "data.sets.learn",
                AskedBy::NoNeighbours,
                found,
            ));
        }
        if !self.paths.is_empty() || self.validates() {
            let found = FoundSetting::SomethingIn { set: set() };
            return Err(Error::config(
                "data.sets.paths",
                AskedBy::SimulatedViews,
                found,
            ));
        }
        for (field, count) in [
            ("data.sets.simulated.views", simulated.views),
            (
                "data.sets.simulated.views_per_world",
                simulated.views_per_world,
            ),
        ] {
            if count == 0 {
                let expected = ExpectedSetting::AtLeastOne;
                return Err(Error::config(field, expected, count.to_string()));
            }
        }
        for (field, share) in [
            ("data.sets.simulated.plain", simulated.plain),
            ("data.sets.simulated.hills", simulated.hills),
            ("data.sets.simulated.riders", simulated.riders),
        ] {
            if !(0.0..=1.0).contains(&share) {
                let expected = ExpectedSetting::Within { from: 0.0, to: 1.0 };
                return Err(Error::config(field, expected, share.to_string()));
            }
        }
        Ok(())
    }
}

impl TrainConfig {
    /// The depth range, and the metres per unit of PoseNet's translation, of the data set at an index of `data.sets`; the networks' own if
    /// the run has no sets.
    #[must_use]
    pub fn factors(&self, set: usize) -> (DepthRange, f64) {
        let own = (self.depth_net.range, self.pose_net.metres_per_unit);
        self.data
            .sets
            .get(set)
            .map_or(own, |set| (set.range.unwrap_or(own.0), set.metres_per_unit))
    }

    /// The data set of the given name. Without a name: the only set; or, if all sets share one depth range, the only set whose motion is
    /// learned, since a depth means the same metres in all of them.
    pub(crate) fn selected_set(&self, name: Option<&str>) -> Option<&DataSetConfig> {
        let sets = self.data.sets.as_slice();
        if let Some(name) = name {
            return sets.iter().find(|s| s.name == name);
        }
        let range = |set: &DataSetConfig| set.range.unwrap_or(self.depth_net.range);
        let one_range = sets
            .windows(2)
            .all(|pair| range(&pair[0]) == range(&pair[1]));
        let mut moving = sets.iter().filter(|set| set.learn.from_motion());
        match (sets, moving.next(), moving.next()) {
            ([only], ..) => Some(only),
            (_, Some(only), None) if one_range => Some(only),
            _ => None,
        }
    }

    /// The configuration of a run as one of its data sets sees it, in which depths and translations mean metres of that set. A run without
    /// sets is unchanged. Without a name, the set is the only one; or, if all share one depth range, the only one whose motion is learned.
    /// The set's camera is [`crate::TrainFindings::camera_of`].
    ///
    /// # Errors
    /// [`Error::DataSet`] if the run has several sets and none of this name, or no name is given.
    pub fn for_set(mut self, name: Option<&str>) -> Result<Self, Error> {
        if self.data.sets.is_empty() && name.is_none() {
            return Ok(self);
        }
        let Some(set) = self.selected_set(name).cloned() else {
            let mut names: Vec<String> = self.data.sets.iter().map(|s| s.name.clone()).collect();
            let expected = match names.len() {
                0 => ExpectedDataSet::NoSets,
                1 => ExpectedDataSet::Only(names.remove(0)),
                _ => ExpectedDataSet::OneOf(names),
            };
            return Err(Error::DataSet {
                expected,
                found: name.unwrap_or("none").to_owned(),
            });
        };
        self.depth_net.range = set.range.unwrap_or(self.depth_net.range);
        self.pose_net.metres_per_unit = set.metres_per_unit;
        Ok(self)
    }

    /// # Errors
    /// [`Error::Config`] naming the first invalid setting of a set.
    pub(crate) fn validate_sets(&self) -> Result<(), Error> {
        let sets = &self.data.sets;
        let fail = |field, expected: ExpectedSetting, found: FoundSetting| {
            Err(Error::config(field, expected, found))
        };
        let aheads = sets.iter().filter_map(|s| s.camera_ahead_s);
        for ahead in aheads.chain(self.data.camera_ahead_s) {
            if !ahead.is_finite() {
                let found = ahead.to_string().into();
                return fail("data.camera_ahead_s", ExpectedSetting::Seconds, found);
            }
        }
        let splits = self.data.split.iter().chain(&self.data.validation_split);
        let own = self.data.paths.iter().chain(&self.data.validation);
        let beside = own.chain(splits).next();
        if !sets.is_empty() && beside.is_some() {
            let expected = AskedBy::DataSets.into();
            return fail("data.paths", expected, FoundSetting::Something);
        }
        let recorded = || sets.iter().filter(|s| s.simulated.is_none());
        let (validated, all) = (
            recorded().filter(|s| s.validates()).count(),
            recorded().count(),
        );
        if validated != 0 && validated != all {
            let found = FoundSetting::SomeSets {
                with: validated,
                of: all,
            };
            let expected = ExpectedSetting::AllSetsOrNone;
            return fail("data.sets.validation", expected, found);
        }
        for (i, set) in sets.iter().enumerate() {
            if set.name.is_empty() || sets[..i].iter().any(|s| s.name == set.name) {
                let found = format!("'{}'", set.name).into();
                return fail("data.sets.name", ExpectedSetting::OwnName, found);
            }
            if let Some(simulated) = &set.simulated {
                set.validate_simulated(simulated)?;
            }
            if set.paths.is_empty() && set.simulated.is_none() {
                let found = FoundSetting::NothingIn {
                    set: set.name.clone(),
                };
                return fail("data.sets.paths", ExpectedSetting::OneRecording, found);
            }
            if !(set.metres_per_unit >= 0.0 && set.metres_per_unit.is_finite()) {
                let (expected, found) = (ExpectedSetting::NotNegative, set.metres_per_unit);
                return fail(
                    "data.sets.metres_per_unit",
                    expected,
                    found.to_string().into(),
                );
            }
            if let Some(DepthRange { min_m, max_m }) = set.range
                && !(min_m > 0.0 && min_m < max_m && max_m.is_finite())
            {
                let found = format!("{min_m} to {max_m}").into();
                return fail("data.sets.range", ExpectedSetting::DepthRange, found);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Preset;

    const SETS: &str = r#"
        [[sets]]
        name = "road"
        paths = ["kitti"]
        camera = "both"

        [[sets]]
        name = "garage"
        paths = ["a", "b"]
        range = { min_m = 0.2, max_m = 30.0 }
        metres_per_unit = 0.1
    "#;

    fn config() -> TrainConfig {
        let mut config = Preset::Tiny.config();
        config.data = toml::from_str(SETS).unwrap();
        config.pose_net.metres_per_unit = 0.7;
        config
    }

    #[test]
    fn a_set_has_its_own_metres() {
        let config = config();
        config.validate().unwrap();
        assert_eq!(config.factors(0).0, config.depth_net.range);
        let garage = config.clone().for_set(Some("garage")).unwrap();
        assert_eq!(garage.depth_net.range.max_m, 30.0);
        assert_eq!(garage.pose_net.metres_per_unit, 0.1);
        assert_eq!(config.factors(1), (garage.depth_net.range, 0.1));
        for name in [None, Some("house")] {
            let error = config.clone().for_set(name).unwrap_err().to_string();
            assert!(error.contains("road, garage"), "{error}");
        }
        // The sets survive writing and reading the run's folder.
        let text = config.to_toml().unwrap();
        assert_eq!(toml::from_str::<TrainConfig>(&text).unwrap(), config);
    }

    /// Recorded drives beside simulated depth of the same range: no name is needed to decide which metres are meant.
    #[test]
    fn with_one_depth_range_the_default_set_is_the_one_that_learns_motion() {
        let mut config = config();
        config.data.sets[1].range = None;
        assert!(config.clone().for_set(None).is_err(), "both learn motion");
        config.data.sets[0].learn = Learn::Depth;
        let meant = config.clone().for_set(None).unwrap();
        assert_eq!(meant.pose_net.metres_per_unit, 0.1);
        config.data.sets[0].range = Some(DepthRange {
            min_m: 1.0,
            max_m: 50.0,
        });
        assert!(config.for_set(None).is_err(), "other depth range");
    }

    #[test]
    fn runs_without_sets_use_the_networks_factors() {
        let mut config = Preset::Tiny.config();
        config.pose_net.metres_per_unit = 0.7;
        assert!(!config.to_toml().unwrap().contains("sets"));
        assert_eq!(config.factors(0), (config.depth_net.range, 0.7));
        assert_eq!(config.clone().for_set(None).unwrap(), config);
        assert!(config.for_set(Some("road")).is_err());
    }

    #[test]
    fn simulated_views_are_configured_in_one_line() {
        let text = r#"
            [[sets]]
            name = "streets"
            learn = "depth"
            simulated = { seed = 1, views = 4000, hills = 0.3, riders = 0.2, without = ["weather"] }
        "#;
        let mut config = Preset::Tiny.config();
        config.data = toml::from_str(text).unwrap();
        config.validate().unwrap();
        let of = |config: &TrainConfig| config.data.sets[0].simulated.clone().unwrap();
        assert_eq!((of(&config).hills, of(&config).formation), (0.3, true));
        assert_eq!(of(&config).riders, 0.2);
        assert_eq!(of(&config).without, ["weather"]);
        let kept = config.to_toml().unwrap();
        assert_eq!(toml::from_str::<TrainConfig>(&kept).unwrap(), config);
        config.data.sets[0].simulated = Some(SimulatedConfig::default());
        assert!(!config.to_toml().unwrap().contains("without"));
        config.data.sets[0].simulated = Some(SimulatedConfig {
            hills: 1.5,
            ..SimulatedConfig::default()
        });
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("`data.sets.simulated.hills`"), "{error}");
        config.data.sets[0].simulated = Some(SimulatedConfig {
            riders: -0.1,
            ..SimulatedConfig::default()
        });
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("`data.sets.simulated.riders`"), "{error}");
    }

    #[test]
    fn simulated_views_can_have_the_users_camera() {
        let text = r#"
            [[sets]]
            name = "streets"
            learn = "depth"
            simulated = { cameras = [{ width = 1242, height = 375, fx = 721.5, fy = 720, cx = 609.6, cy = 172.9, height_m = 1.65 }] }
        "#;
        let mut config = Preset::Tiny.config();
        config.data = toml::from_str(text).unwrap();
        config.validate().unwrap();
        let camera = config.data.sets[0].simulated.as_ref().unwrap().cameras[0];
        assert_eq!((camera.height_m, camera.pitch_degrees), (Some(1.65), 0.0));
        let k = Intrinsics::from_numbers([721.5, 720.0, 609.6, 172.9], (1242, 375));
        assert_eq!(camera.intrinsics(), k);
        let kept = config.to_toml().unwrap();
        assert_eq!(toml::from_str::<TrainConfig>(&kept).unwrap(), config);
    }

    #[test]
    fn invalid_sets_are_refused() {
        type Change = fn(&mut TrainConfig);
        let cases: [(&str, Change); 8] = [
            ("data.sets.name", |c| c.data.sets[1].name = "road".into()),
            ("data.sets.paths", |c| c.data.sets[0].paths.clear()),
            ("data.paths", |c| c.data.paths.push("x".into())),
            ("data.sets.metres_per_unit", |c| {
                c.data.sets[0].metres_per_unit = -1.0;
            }),
            ("data.sets.range", |c| {
                c.data.sets[1].range = Some(DepthRange {
                    min_m: 3.0,
                    max_m: 2.0,
                });
            }),
            ("data.sets.validation", |c| {
                c.data.sets[0].validation.push("x".into());
            }),
            ("data.sets.validation", |c| {
                c.data.sets[0].validation_split = Some("x.txt".into());
            }),
            ("data.camera_ahead_s", |c| {
                c.data.sets[1].camera_ahead_s = Some(f64::NAN);
            }),
        ];
        for (field, change) in cases {
            let mut config = config();
            change(&mut config);
            let error = config.validate().unwrap_err().to_string();
            assert!(error.contains(&format!("`{field}`")), "{error}");
        }
    }
}
