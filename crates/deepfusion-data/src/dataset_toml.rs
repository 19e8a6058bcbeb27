//! `dataset.toml`: what a recording's own files do not say.

use crate::{ConfigProblem, Error, ExpectedValue, OpenOptions, Result};
use deepfusion_geometry::{HFOV_DEG, Se3};
use deepfusion_motion::{Bicycle, ImuConfig, ImuMount, MotionConfig, SPEED_SCALES};
use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Longest gap between speeds that can be asked to be bridged, in seconds: nobody knows how a car drove for longer.
pub(crate) const MOST_GAP_S: f64 = 60.0;

/// A recording's `dataset.toml`. Every key is optional; docs/reference/dataset-toml.md lists them.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FolderConfig {
    /// Folder of the images.
    pub(crate) images: Option<PathBuf>,
    /// The video file.
    pub(crate) video: Option<PathBuf>,
    /// Where a video's frames are kept once decoded.
    pub(crate) cache: Option<PathBuf>,
    /// The table of speeds.
    pub(crate) speed: Option<PathBuf>,
    /// The column of times of another program's table, by its header.
    pub(crate) time_column: Option<String>,
    /// The column of speeds of another program's table; the signal of a CAN trace.
    pub(crate) speed_column: Option<String>,
    /// What the frames of a CAN trace hold.
    pub(crate) dbc: Option<PathBuf>,
    /// Longest time between two speeds that is bridged, in seconds.
    pub(crate) max_gap_s: Option<f64>,
    /// The table of the IMU.
    pub(crate) imu: Option<PathBuf>,
    /// The calibration file.
    pub(crate) calibration: Option<PathBuf>,
    /// fx, fy, cx, cy of a camera without distortion.
    pub(crate) intrinsics: Option<[f64; 4]>,
    /// The field of view from left to right of a camera without distortion, in degrees.
    pub(crate) hfov_deg: Option<f64>,
    /// Frames a second, where nothing says the frames' times.
    pub(crate) fps: Option<f64>,
    /// The first frame's time on the speeds' clock, in seconds, for frames whose times count from 0.
    pub(crate) start_s: Option<f64>,
    /// Unit of columns of time without one.
    pub(crate) time_unit: Option<String>,
    /// Unit of a column `speed` without one.
    pub(crate) speed_unit: Option<String>,
    /// Unit of a yaw rate's column without one.
    pub(crate) yaw_rate_unit: Option<String>,
    /// Folder of the depth images.
    pub(crate) depth: Option<PathBuf>,
    /// Metres of one step of a depth image.
    pub(crate) depth_unit_m: Option<f64>,
    /// A value of the depth images, besides 0, that means none.
    pub(crate) depth_invalid: Option<u16>,
    /// Whether the images are a simulator's.
    #[serde(default)]
    pub(crate) simulated: bool,
    /// Where the camera is on the vehicle.
    pub(crate) mount: Option<Mount>,
    /// A point of the inertial unit in the vehicle.
    pub(crate) vehicle_from_imu: Option<ImuPlace>,
    /// The vehicle's geometry.
    #[serde(default)]
    pub(crate) vehicle: Vehicle,
    /// The camera's clock.
    #[serde(default)]
    pub(crate) clock: Clock,
    /// Whether what is said here is said of the recordings in the folders here, too, where their own files say nothing.
    #[serde(default)]
    pub(crate) for_folders: bool,
    /// Where the file is.
    #[serde(skip)]
    pub(crate) path: PathBuf,
    /// The one in the folder above, where that is for the folders there.
    #[serde(skip)]
    pub(crate) above: Option<Box<FolderConfig>>,
}

/// The camera's place on the vehicle: x forward, y left, z up from where the speed is measured (the rear
/// axle for wheel speeds), in metres; its turns in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Mount {
    forward_m: f64,
    left_m: f64,
    up_m: f64,
    /// To the left.
    yaw_deg: f64,
    /// Down.
    pitch_deg: f64,
    /// To the right: clockwise as the camera looks.
    roll_deg: f64,
}

/// The inertial unit's place on the vehicle (x forward, y left, z up): metres, and an axis-angle vector in radians.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct ImuPlace {
    translation: [f64; 3],
    rotation: [f64; 3],
}

/// What of a vehicle its steering angle needs to tell a turn.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Vehicle {
    wheelbase_m: Option<f64>,
    /// Steering wheel's angle over road wheels'.
    steering_ratio: Option<f64>,
    steering_offset_rad: f64,
    /// True speed over the vehicle's: worn tyres read too fast.
    pub(crate) speed_scale: Option<f64>,
}

/// The camera's clock against the vehicle's.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Clock {
    /// How far the camera's clock is ahead of the vehicle's, in seconds; taken off the images' times.
    pub(crate) camera_ahead_s: f64,
}

/// What is wrong with a `vehicle.speed_scale`.
pub(crate) fn bad_speed_scale(scale: f64) -> ConfigProblem {
    ConfigProblem::Value {
        key: "vehicle.speed_scale",
        value: scale,
        expected: ExpectedValue::SpeedScale,
    }
}

/// What is wrong with a clock or a scale of the speed, if something is.
pub(crate) fn check_clock_and_scale(
    clock: Clock,
    speed_scale: Option<f64>,
) -> std::result::Result<(), ConfigProblem> {
    let scale = speed_scale.unwrap_or(1.0);
    if !SPEED_SCALES.contains(&scale) {
        return Err(bad_speed_scale(scale));
    }
    match clock.camera_ahead_s {
        ahead if ahead.is_finite() => Ok(()),
        value => Err(ConfigProblem::Value {
            key: "clock.camera_ahead_s",
            value,
            expected: ExpectedValue::Time,
        }),
    }
}

/// A TOML file's settings; where there is no such file, those of an empty one.
///
/// # Errors
/// [`Error::Config`], [`Error::File`].
pub(crate) fn read_or_default<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => String::new(),
        Err(e) => return Err(Error::file(path, e)),
    };
    toml::from_str(&text).map_err(|e| Error::Config {
        path: path.to_owned(),
        problem: e.into(),
    })
}

/// Whether a folder has settings as a recording: its own `dataset.toml`, or one in the folder above that is for the folders there, whatever is wrong with
/// it.
#[must_use]
pub fn has_settings(folder: &Path) -> bool {
    let is_above = |folder: &Path| {
        let above = folder.parent().map(FolderConfig::read_for_folders);
        above.is_some_and(|found| !matches!(found, Ok(None)))
    };
    folder.join(FolderConfig::NAME).exists()
        || std::path::absolute(folder).is_ok_and(|folder| is_above(&folder))
}

/// Whether a line of TOML sets the key `for_folders`, or one that was meant to be it: `for_folder`, `for-folders`.
fn is_for_folders(line: &str) -> bool {
    let Some((key, _)) = line.split_once('=') else {
        return false;
    };
    let letters = key.chars().filter(|c| c.is_ascii_alphabetic() || *c == '#');
    let key = letters.collect::<String>().to_ascii_lowercase();
    // Not `format_folder`, which may stand in another program's file.
    let of = key.strip_prefix("for").unwrap_or_default();
    ["fold", "allfold", "subfold"]
        .iter()
        .any(|word| of.starts_with(word))
}

impl FolderConfig {
    pub(crate) const NAME: &str = "dataset.toml";

    /// Reads `dataset.toml` in a folder, and the one in the folder above where that is for the folders there; without one, nothing is said.
    ///
    /// # Errors
    /// [`Error::Config`], [`Error::File`].
    pub(crate) fn read(folder: &Path) -> Result<Self> {
        let own = Self::read_alone(folder)?;
        let above = folder.parent().map(Self::read_for_folders);
        Ok(match above.transpose()?.flatten() {
            Some(above) => own.completed(above),
            None => own,
        })
    }

    /// The settings of a folder for the folders in it. A file that has no such key may be another program's, or of a recording: it is not looked at.
    /// One with a key that is nearly this is: the key is then an error, as an unknown one of a recording's own file is.
    ///
    /// # Errors
    /// [`Error::Config`], [`Error::File`].
    pub(crate) fn read_for_folders(folder: &Path) -> Result<Option<Self>> {
        let text = std::fs::read_to_string(folder.join(Self::NAME));
        if !text.is_ok_and(|text| text.lines().any(is_for_folders)) {
            return Ok(None);
        }
        let config = Self::read_alone(folder)?;
        Ok(Some(config).filter(|config| config.for_folders))
    }

    /// With what the file above says of everything that is not said here, but for what is a single recording's: its files, its clocks, whether
    /// it is simulated. The camera is looked for above by `find_camera`, as a calibration here goes before it.
    fn completed(self, above: Self) -> Self {
        let text = |own: Option<String>, above: &Option<String>| own.or_else(|| above.clone());
        let own_vehicle = self.vehicle != Vehicle::default();
        Self {
            time_column: text(self.time_column, &above.time_column),
            speed_column: text(self.speed_column, &above.speed_column),
            time_unit: text(self.time_unit, &above.time_unit),
            speed_unit: text(self.speed_unit, &above.speed_unit),
            yaw_rate_unit: text(self.yaw_rate_unit, &above.yaw_rate_unit),
            max_gap_s: self.max_gap_s.or(above.max_gap_s),
            fps: self.fps.or(above.fps),
            depth_unit_m: self.depth_unit_m.or(above.depth_unit_m),
            depth_invalid: self.depth_invalid.or(above.depth_invalid),
            mount: self.mount.or(above.mount),
            vehicle_from_imu: self.vehicle_from_imu.or(above.vehicle_from_imu),
            vehicle: if own_vehicle {
                self.vehicle
            } else {
                above.vehicle
            },
            above: Some(Box::new(above)),
            ..self
        }
    }

    /// Reads the file of a folder alone.
    ///
    /// # Errors
    /// [`Error::Config`], [`Error::File`].
    fn read_alone(folder: &Path) -> Result<Self> {
        let path = folder.join(Self::NAME);
        let mut config: Self = read_or_default(&path)?;
        config.path = path;
        let numbers = [
            ("fps", config.fps),
            ("depth_unit_m", config.depth_unit_m),
            ("max_gap_s", config.max_gap_s),
        ];
        for (key, value) in numbers {
            if let Some(bad) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
                return Err(config.bad(key, bad, ExpectedValue::Positive));
            }
        }
        if let Some(bad) = config.max_gap_s.filter(|v| *v > MOST_GAP_S) {
            return Err(config.bad("max_gap_s", bad, ExpectedValue::GapUpTo(MOST_GAP_S)));
        }
        if config.intrinsics.is_some() && config.hfov_deg.is_some() {
            return Err(config.error(ConfigProblem::IntrinsicsAndView));
        }
        let (least, most) = HFOV_DEG;
        if let Some(bad) = config.hfov_deg.filter(|v| !(*v > least && *v < most)) {
            return Err(config.bad("hfov_deg", bad, ExpectedValue::Between(least, most)));
        }
        let place = config.vehicle_from_imu.unwrap_or_default();
        let mut numbers = place.translation.iter().chain(&place.rotation);
        if !numbers.all(|x| x.is_finite()) {
            let key = "vehicle_from_imu";
            return Err(config.error(ConfigProblem::NotFinite { key }));
        }
        let mount = config.mount.unwrap_or_default();
        if let Some((key, bad)) = mount.numbers().into_iter().find(|(_, x)| !x.is_finite()) {
            return Err(config.bad(key, bad, ExpectedValue::AsNamed));
        }
        if let Some(bad) = config.start_s.filter(|v| v.is_nan() || v.abs() > 9e9) {
            return Err(config.bad("start_s", bad, ExpectedValue::Time));
        }
        match check_clock_and_scale(config.clock, config.vehicle.speed_scale) {
            Ok(()) => Ok(config),
            Err(problem) => Err(config.error(problem)),
        }
    }

    /// How far the camera's clock is ahead of the vehicle's, in seconds: as it is given, else as this file says.
    pub(crate) fn camera_ahead_s(&self, options: &OpenOptions) -> f64 {
        options.camera_ahead_s.unwrap_or(self.clock.camera_ahead_s)
    }

    /// True speed over the vehicle's.
    pub(crate) fn speed_scale(&self) -> f64 {
        self.vehicle.speed_scale.unwrap_or(1.0)
    }

    /// How the vehicle's sensors become its motion (the speeds are scaled where they are read); `imu` is where the inertial unit is taken to be where nothing says it.
    pub(crate) fn motion(&self, imu: ImuMount) -> MotionConfig {
        let vehicle = &self.vehicle;
        let place = self.vehicle_from_imu.map(|place| ImuMount {
            rotation_rad: place.rotation,
            translation_m: place.translation,
        });
        MotionConfig {
            bicycle: vehicle.wheelbase_m.map(|wheelbase_m| Bicycle {
                steering_ratio: vehicle.steering_ratio.unwrap_or(1.0),
                steering_offset_rad: vehicle.steering_offset_rad,
                ..Bicycle::new(wheelbase_m)
            }),
            imu: ImuConfig {
                vehicle_from_imu: place.unwrap_or(imu),
                ..ImuConfig::default()
            },
            ..MotionConfig::default()
        }
    }

    /// An error about this file.
    pub(crate) fn error(&self, problem: ConfigProblem) -> Error {
        Error::Config {
            path: self.path.clone(),
            problem,
        }
    }

    fn bad(&self, key: &'static str, value: f64, expected: ExpectedValue) -> Error {
        self.error(ConfigProblem::Value {
            key,
            value,
            expected,
        })
    }

    /// The folder that it lies in.
    pub(crate) fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new("."))
    }

    /// A file that is named here, or is there under a usual name. A named one must be there.
    ///
    /// # Errors
    /// [`Error::Config`] where a named one is not.
    pub(crate) fn find(
        &self,
        folder: &Path,
        key: &'static str,
        named: Option<&PathBuf>,
        usual: &[&str],
    ) -> Result<Option<PathBuf>> {
        if let Some(name) = named {
            let path = folder.join(name);
            return if path.exists() {
                Ok(Some(path))
            } else {
                Err(self.error(ConfigProblem::NoFile { key, path }))
            };
        }
        let mut paths = usual.iter().map(|name| folder.join(name));
        Ok(paths.find(|path| path.exists()))
    }

    /// The files and folders that are named here, of a recording in this folder, whether they are there or not.
    pub(crate) fn places(&self, folder: &Path) -> Vec<PathBuf> {
        let video = self.video.as_ref().map(|named| folder.join(named));
        // A cache is named from where the video lies.
        let beside = video.as_deref().and_then(Path::parent).unwrap_or(folder);
        let cache = self.cache.as_ref().map(|named| beside.join(named));
        let others = [
            &self.images,
            &self.speed,
            &self.dbc,
            &self.imu,
            &self.calibration,
            &self.depth,
        ];
        let others = others.into_iter().flatten().map(|named| folder.join(named));
        others.chain(cache).chain(video).collect()
    }

    /// A point of the vehicle in the camera; looking straight ahead at the vehicle's origin where nothing
    /// is said (the camera then moves as the vehicle does).
    pub(crate) fn cam_from_vehicle(&self) -> Se3 {
        self.mount.unwrap_or_default().cam_from_vehicle()
    }
}

impl Mount {
    /// Its numbers by their keys.
    fn numbers(&self) -> [(&'static str, f64); 6] {
        [
            ("mount.forward_m", self.forward_m),
            ("mount.left_m", self.left_m),
            ("mount.up_m", self.up_m),
            ("mount.yaw_deg", self.yaw_deg),
            ("mount.pitch_deg", self.pitch_deg),
            ("mount.roll_deg", self.roll_deg),
        ]
    }

    fn cam_from_vehicle(&self) -> Se3 {
        // The camera's axes in the vehicle's: x is right (-y), y is down (-z), z is ahead (x).
        let ahead = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
        // About x, y, z of the vehicle, roll first: nose down is positive about y (left).
        let turn = Rotation3::from_euler_angles(
            self.roll_deg.to_radians(),
            self.pitch_deg.to_radians(),
            self.yaw_deg.to_radians(),
        );
        let place = Vector3::new(self.forward_m, self.left_m, self.up_m);
        Se3::from_parts(&(turn.matrix() * ahead), place).inverse()
    }
}

#[cfg(test)]
#[path = "dataset_toml_tests.rs"]
mod tests;
