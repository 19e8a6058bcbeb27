use crate::error::{check, within};
use crate::rig::CAMERA_HEIGHT;
use crate::{Error, ExpectedSetting as Expected, Result, VariedConflict};
use serde::{Deserialize, Serialize};

/// The kind of scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Scene {
    /// A street of houses, shops, gardens and parks, by day.
    #[default]
    Urban,
    /// An enclosed park: a narrow road between lawns and trees, few cars, slowly driven.
    Park,
    /// An underground car park: dark, near walls, pillars, a low ceiling, at walking speed.
    Garage,
    /// A shopping street: large houses on both sides, wide pavements, many parked cars.
    Commercial,
    /// The urban street by night, under its lamps.
    Night,
    /// A carriageway of several lanes, guard rails, embankments. Varied worlds only.
    Motorway,
    /// A road without pavements between fields, trees and banks. Varied worlds only.
    Country,
    /// Rooms and corridors. Varied worlds only.
    Indoor,
}

impl Scene {
    /// UMAD's five scenarios.
    pub const ALL: [Self; 5] = [
        Self::Urban,
        Self::Park,
        Self::Garage,
        Self::Commercial,
        Self::Night,
    ];

    /// The scenes of varied worlds: UMAD's five, and three that only varied worlds have.
    pub const EVERY: [Self; 8] = [
        Self::Urban,
        Self::Park,
        Self::Garage,
        Self::Commercial,
        Self::Night,
        Self::Motorway,
        Self::Country,
        Self::Indoor,
    ];

    /// Its name, in one word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Urban => "urban",
            Self::Park => "park",
            Self::Garage => "garage",
            Self::Commercial => "commercial",
            Self::Night => "night",
            Self::Motorway => "motorway",
            Self::Country => "country",
            Self::Indoor => "indoor",
        }
    }

    /// The scene with this name, also one of varied worlds.
    ///
    /// # Errors
    /// [`Error::Config`] for an unknown name.
    pub fn of_varied(name: &str) -> Result<Self> {
        let found = Self::EVERY.into_iter().find(|scene| scene.name() == name);
        found.ok_or_else(|| Error::Config {
            field: "scenes",
            value: name.to_owned(),
            expected: Expected::OneOf(Self::EVERY.map(Self::name).to_vec()),
        })
    }

    /// Whether people ride and walk there.
    pub(crate) fn has_riders(self) -> bool {
        !matches!(self, Self::Garage | Self::Motorway | Self::Indoor)
    }

    /// Speed of the drive, as a share of the speed on a street.
    pub(crate) fn pace(self) -> f64 {
        match self {
            Self::Garage | Self::Indoor => 0.3,
            Self::Park => 0.6,
            _ => 1.0,
        }
    }
}

impl std::str::FromStr for Scene {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|scene| scene.name() == name);
        found.ok_or_else(|| Error::Config {
            field: "scene",
            value: name.to_owned(),
            expected: Expected::OneOf(Self::ALL.map(Self::name).to_vec()),
        })
    }
}

/// The sensors of the car.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sensors {
    /// KITTI's camera, velodyne and inertial unit.
    #[default]
    Kitti,
    /// UMAD's camera, FMCW LiDAR, 6-axis unit and CAN.
    Umad,
}

impl Sensors {
    /// Its name, in one word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Kitti => "kitti",
            Self::Umad => "umad",
        }
    }
}

/// Longest drive, seconds: its street still fits into memory, and its coordinates into f32.
const LONGEST_DRIVE_S: f64 = 1800.0;

/// The configuration of a simulation. Equal configurations give equal drives, byte for byte.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimConfig {
    /// Seed of the street, its appearance, the light and the driving.
    pub seed: u64,
    /// Number of frames, at least 1.
    pub frames: usize,
    /// Width of the pictures, in pixels.
    pub width: u32,
    /// Height of the pictures, in pixels.
    pub height: u32,
    /// Number of moving cars. A varied drive leaves out cars whose way is blocked.
    pub moving_cars: usize,
    /// Number of people who ride bicycles in traffic, walk along pavements and cross the road; fewer where a street has no room for
    /// them.
    pub riders: usize,
    /// Frames per second; the actual intervals vary by ±1 ms around 1 / `fps`.
    pub fps: f64,
    /// The kind of scene.
    pub scene: Scene,
    /// The sensors of the car, and their mounts.
    pub sensors: Sensors,
    /// Whether the camera (lens, height, pitch, roll, imaging), the light, the weather and the world's materials and people are drawn from
    /// the seed, once for the drive; [`crate::Simulation::drawn`] returns what was drawn.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub varied: bool,
    /// Height of the camera above the road, in metres; must keep its default in a varied drive.
    pub camera_height_m: f64,
    /// Distance of a second camera to the right of the first, metres. [`crate::write_kitti`] also writes its pictures; 0: no second camera.
    pub stereo_baseline_m: f64,
    /// [`crate::write_kitti`] writes a velodyne scan for every n-th frame; 0 writes none.
    pub scan_every: usize,
    /// Angle between two columns of a velodyne scan, in degrees.
    pub scan_step_deg: f64,
}

impl Default for SimConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            frames: 100,
            width: 640,
            height: 192,
            moving_cars: 0,
            riders: 0,
            fps: 10.0,
            scene: Scene::Urban,
            sensors: Sensors::Kitti,
            varied: false,
            camera_height_m: CAMERA_HEIGHT,
            stereo_baseline_m: 0.0,
            scan_every: 1,
            scan_step_deg: 0.3,
        }
    }
}

impl SimConfig {
    /// Checks every field; [`crate::Simulation::new`] also checks the scene.
    ///
    /// # Errors
    /// [`Error::Config`] naming the first field out of range; [`Error::Varied`] for a setting that a varied drive cannot have.
    pub fn validate(&self) -> Result<()> {
        let metres = |field, value: f64, from: f64, to: f64| {
            check(
                (from..=to).contains(&value),
                field,
                value.to_string(),
                Expected::Metres { from, to },
            )
        };
        within("frames", self.frames as f64, 1.0, 100_000.0)?;
        within("width", f64::from(self.width), 16.0, 8192.0)?;
        within("height", f64::from(self.height), 16.0, 8192.0)?;
        within("moving_cars", self.moving_cars as f64, 0.0, 1000.0)?;
        within("riders", self.riders as f64, 0.0, 1000.0)?;
        check(
            self.riders == 0 || self.scene.has_riders(),
            "riders",
            self.riders.to_string(),
            Expected::NoRiders,
        )?;
        within("fps", self.fps, 2.0, 100.0)?;
        check(
            self.frames as f64 / self.fps <= LONGEST_DRIVE_S,
            "frames",
            format!("{} at {} a second", self.frames, self.fps),
            Expected::DriveUpTo {
                minutes: LONGEST_DRIVE_S / 60.0,
            },
        )?;
        metres("camera_height_m", self.camera_height_m, 0.3, 4.0)?;
        metres("stereo_baseline_m", self.stereo_baseline_m, 0.0, 5.0)?;
        within("scan_step_deg", self.scan_step_deg, 0.05, 5.0)?;
        if self.varied {
            self.check_varied()?;
        }
        Ok(())
    }

    /// Checks that no setting contradicts `varied`.
    fn check_varied(&self) -> Result<()> {
        let why = if self.camera_height_m != CAMERA_HEIGHT {
            VariedConflict::CameraHeight
        } else if self.stereo_baseline_m > 0.0 {
            VariedConflict::SecondCamera
        } else if self.scene == Scene::Indoor {
            VariedConflict::Rooms
        } else {
            return Ok(());
        };
        Err(self.conflict(why))
    }

    /// Checks that a drive can lead through the scene.
    ///
    /// # Errors
    /// [`Error::Varied`].
    pub(crate) fn check_scene(&self) -> Result<()> {
        match self.scene {
            Scene::Indoor => Err(self.conflict(VariedConflict::Rooms)),
            scene if self.varied || Scene::ALL.contains(&scene) => Ok(()),
            _ => Err(self.conflict(VariedConflict::OnlyVaried)),
        }
    }

    fn conflict(&self, why: VariedConflict) -> Error {
        let value = match why {
            VariedConflict::CameraHeight => self.camera_height_m.to_string(),
            VariedConflict::SecondCamera => self.stereo_baseline_m.to_string(),
            VariedConflict::Rooms | VariedConflict::OnlyVaried => self.scene.name().to_owned(),
        };
        Error::Varied { value, why }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;

    #[test]
    fn every_bad_field_is_named() {
        let base = SimConfig::default;
        let bad = [
            (
                SimConfig {
                    frames: 30_000,
                    ..base()
                },
                "frames",
            ),
            (
                SimConfig {
                    frames: 0,
                    ..base()
                },
                "frames",
            ),
            (SimConfig { width: 0, ..base() }, "width"),
            (
                SimConfig {
                    height: 9000,
                    ..base()
                },
                "height",
            ),
            (
                SimConfig {
                    moving_cars: 5000,
                    ..base()
                },
                "moving_cars",
            ),
            (
                SimConfig {
                    riders: 5000,
                    ..base()
                },
                "riders",
            ),
            (
                SimConfig {
                    riders: 1,
                    scene: Scene::Garage,
                    ..base()
                },
                "riders",
            ),
            (
                SimConfig {
                    camera_height_m: f64::NAN,
                    ..base()
                },
                "camera_height_m",
            ),
            (
                SimConfig {
                    fps: f64::NAN,
                    ..base()
                },
                "fps",
            ),
            (
                SimConfig {
                    scan_step_deg: 0.0,
                    ..base()
                },
                "scan_step_deg",
            ),
        ];
        for (config, name) in bad {
            let error = config.validate().unwrap_err();
            assert!(error.to_string().contains(name), "{error}");
            assert!(error.hint().is_some_and(|hint| hint.contains(name)));
        }
        assert!(base().validate().is_ok());
    }

    #[test]
    fn settings_that_a_varied_drive_cannot_have_are_named() {
        let varied = || SimConfig {
            varied: true,
            ..SimConfig::default()
        };
        assert!(varied().validate().is_ok() && varied().check_scene().is_ok());
        let bad = [
            (
                SimConfig {
                    camera_height_m: 1.2,
                    ..varied()
                },
                "`camera_height_m` is 1.2",
            ),
            (
                SimConfig {
                    stereo_baseline_m: 0.53,
                    ..varied()
                },
                "`stereo_baseline_m` is 0.53",
            ),
            (
                SimConfig {
                    scene: Scene::Indoor,
                    ..varied()
                },
                "`scene` is indoor",
            ),
        ];
        for (config, expected) in bad {
            let error = config.validate().unwrap_err();
            assert!(error.to_string().contains(expected), "{error}");
            assert!(error.hint().is_some());
        }
        for scene in Scene::EVERY {
            let is_ok = |varied| {
                let config = SimConfig {
                    scene,
                    varied,
                    ..SimConfig::default()
                };
                config.check_scene().is_ok()
            };
            assert_eq!(is_ok(false), Scene::ALL.contains(&scene));
            assert_eq!(is_ok(true), scene != Scene::Indoor);
        }
    }

    #[test]
    fn the_error_for_an_unknown_scene_lists_the_known_ones() {
        let error = "moon".parse::<Scene>().unwrap_err();
        assert_eq!(
            error.to_string(),
            "simulator setting `scene` is moon, expected urban, park, garage, commercial or night"
        );
        for scene in Scene::ALL {
            assert_eq!(scene.name().parse::<Scene>().ok(), Some(scene));
        }
    }
}
