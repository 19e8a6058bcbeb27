//! `dataset.toml`: settings for what is missing from a recording's own files.

use crate::{ConfigProblem, Error, ExpectedValue, OpenOptions, Result};
use deepfusion_geometry::{HFOV_DEG, Se3};
use deepfusion_motion::{Bicycle, ImuConfig, ImuMount, MotionConfig, SPEED_SCALES};
use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Largest allowed `max_gap_s`, in seconds: across longer gaps between speeds, interpolation is meaningless.
pub(crate) const MOST_GAP_S: f64 = 60.0;

/// A recording's `dataset.toml`. Every key is optional; docs/reference/dataset-toml.md lists them.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FolderConfig {
    /// Path of the folder of images.
    pub(crate) images: Option<PathBuf>,
    /// Path of the video.
    pub(crate) video: Option<PathBuf>,
    /// Path of the folder for a video's decoded frames.
    pub(crate) cache: Option<PathBuf>,
    /// Path of the table or log of speeds.
    pub(crate) speed: Option<PathBuf>,
    /// Header of the column of times in another program's table.
    pub(crate) time_column: Option<String>,
    /// Header of the column of speeds in another program's table, or the signal in a CAN trace.
    pub(crate) speed_column: Option<String>,
    /// Path of the DBC file with the signals of a CAN trace.
    pub(crate) dbc: Option<PathBuf>,
    /// Longest gap between two speeds that is bridged, in seconds.
    pub(crate) max_gap_s: Option<f64>,
    /// Path of the IMU's table.
    pub(crate) imu: Option<PathBuf>,
    /// Path of the calibration file.
    pub(crate) calibration: Option<PathBuf>,
    /// fx, fy, cx, cy of a camera without distortion.
    pub(crate) intrinsics: Option<[f64; 4]>,
    /// Horizontal field of view of a camera without distortion, in degrees.
    pub(crate) hfov_deg: Option<f64>,
    /// Frames per second, if the frames have no times.
    pub(crate) fps: Option<f64>,
    /// The first frame's time on the speeds' clock, in seconds, for frames whose times count from 0.
    pub(crate) start_s: Option<f64>,
    /// Unit of columns of times without a unit in their header.
    pub(crate) time_unit: Option<String>,
    /// Unit of a speed column without a unit in its header.
    pub(crate) speed_unit: Option<String>,
    /// Unit of a yaw rate column without a unit in its header.
    pub(crate) yaw_rate_unit: Option<String>,
    /// Path of the folder of depth images.
    pub(crate) depth: Option<PathBuf>,
    /// Metres per unit of the depth images' values.
    pub(crate) depth_unit_m: Option<f64>,
    /// A value in the depth images, besides 0, that means no depth.
    pub(crate) depth_invalid: Option<u16>,
    /// Whether the recording is simulated.
    #[serde(default)]
    pub(crate) simulated: bool,
    /// The camera's mount on the vehicle.
    pub(crate) mount: Option<Mount>,
    /// The transform from the inertial unit to the vehicle.
    pub(crate) vehicle_from_imu: Option<ImuPlace>,
    /// The vehicle's geometry and speed scale.
    #[serde(default)]
    pub(crate) vehicle: Vehicle,
    /// The camera's clock.
    #[serde(default)]
    pub(crate) clock: Clock,
    /// Whether these settings also apply to the recordings in the subfolders, where their own files do not set a key.
    #[serde(default)]
    pub(crate) for_folders: bool,
    /// Path of this file.
    #[serde(skip)]
    pub(crate) path: PathBuf,
    /// The file in the folder above, if it applies to subfolders.
    #[serde(skip)]
    pub(crate) above: Option<Box<FolderConfig>>,
}

/// The camera's mount on the vehicle: position x forward, y left, z up from where the speed is measured (the rear
/// axle for wheel speeds), in metres; orientation in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Mount {
    forward_m: f64,
    left_m: f64,
    up_m: f64,
    /// Yaw, positive to the left.
    yaw_deg: f64,
    /// Pitch, positive down.
    pitch_deg: f64,
    /// Roll, positive to the right (clockwise in the viewing direction).
    roll_deg: f64,
}

/// The inertial unit's mount on the vehicle (x forward, y left, z up): translation in metres, rotation as an axis-angle vector in radians.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct ImuPlace {
    translation: [f64; 3],
    rotation: [f64; 3],
}

/// What is needed of a vehicle to compute turns from its steering angle, and to correct its speed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Vehicle {
    wheelbase_m: Option<f64>,
    /// Angle of the steering wheel / angle of the road wheels.
    steering_ratio: Option<f64>,
    steering_offset_rad: f64,
    /// True speed / measured speed: worn tyres give too high a speed.
    pub(crate) speed_scale: Option<f64>,
}

/// The camera's clock relative to the vehicle's.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Clock {
    /// How far the camera's clock is ahead of the vehicle's, in seconds; subtracted from the images' times.
    pub(crate) camera_ahead_s: f64,
}

/// The error about a `vehicle.speed_scale` outside its range.
pub(crate) fn bad_speed_scale(scale: f64) -> ConfigProblem {
    ConfigProblem::Value {
        key: "vehicle.speed_scale",
        value: scale,
        expected: ExpectedValue::SpeedScale,
    }
}

/// Checks the ranges of the clock's offset and the speed scale.
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

/// A TOML file's settings; those of an empty file if it does not exist.
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

/// Whether a folder has settings for a recording: its own `dataset.toml`, or one in the folder above that applies to subfolders, even an
/// invalid one.
#[must_use]
pub fn has_settings(folder: &Path) -> bool {
    let is_above = |folder: &Path| {
        let above = folder.parent().map(FolderConfig::read_for_folders);
        above.is_some_and(|found| !matches!(found, Ok(None)))
    };
    folder.join(FolderConfig::NAME).exists()
        || std::path::absolute(folder).is_ok_and(|folder| is_above(&folder))
}

/// Whether a line of TOML sets the key `for_folders`, or a misspelling of it, such as `for_folder` or `for-folders`.
fn is_for_folders(line: &str) -> bool {
    let Some((key, _)) = line.split_once('=') else {
        return false;
    };
    let letters = key.chars().filter(|c| c.is_ascii_alphabetic() || *c == '#');
    let key = letters.collect::<String>().to_ascii_lowercase();
    // Exclude `format_folder`, which another program's file may contain.
    let of = key.strip_prefix("for").unwrap_or_default();
    ["fold", "allfold", "subfold"]
        .iter()
        .any(|word| of.starts_with(word))
}

impl FolderConfig {
    pub(crate) const NAME: &str = "dataset.toml";

    /// Reads `dataset.toml` in a folder, and the one in the folder above if it applies to subfolders. Without any file, no key is set.
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

    /// A folder's settings for its subfolders. A file without the key `for_folders` may belong to another program or to a recording, so it
    /// is ignored. A misspelling of the key is an error, like any unknown key in a recording's own file.
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

    /// These settings, completed by those of the file above, except for settings of a single recording: its files, its clocks, whether
    /// it is simulated. `find_camera` looks for the camera above by itself, because a calibration file here takes precedence.
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

    /// Reads only the folder's own file.
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

    /// How far the camera's clock is ahead of the vehicle's, in seconds: from the options, otherwise from this file.
    pub(crate) fn camera_ahead_s(&self, options: &OpenOptions) -> f64 {
        options.camera_ahead_s.unwrap_or(self.clock.camera_ahead_s)
    }

    /// True speed / measured speed.
    pub(crate) fn speed_scale(&self) -> f64 {
        self.vehicle.speed_scale.unwrap_or(1.0)
    }

    /// The settings for computing the vehicle's motion from its sensors. Speeds are scaled when they are read. `imu` is the inertial unit's
    /// mount if none is set.
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

    /// The folder that contains this file.
    pub(crate) fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new("."))
    }

    /// The file named here, which must exist, or else the first existing one of the usual names.
    ///
    /// # Errors
    /// [`Error::Config`] if a named file does not exist.
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

    /// All files and folders that are named here, for a recording in this folder, whether or not they exist.
    pub(crate) fn places(&self, folder: &Path) -> Vec<PathBuf> {
        let video = self.video.as_ref().map(|named| folder.join(named));
        // The cache's path is relative to the video's folder.
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

    /// The transform from the vehicle to the camera. Without a mount, the camera looks straight ahead from the
    /// vehicle's origin, so that it moves like the vehicle.
    pub(crate) fn cam_from_vehicle(&self) -> Se3 {
        self.mount.unwrap_or_default().cam_from_vehicle()
    }
}

impl Mount {
    /// Its numbers, with their keys.
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
        // The camera's axes in the vehicle's: x right (-y), y down (-z), z forward (x).
        let ahead = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
        // About x, y, z of the vehicle, roll first; nose down is positive about y (left).
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
