//! The file beside a bag, `<bag>.toml`, or `bag.toml` for all bags of a folder: settings for what the bag does not contain.

use super::can_config::{CanConfig, SpeedUnit};
use super::profile;
use crate::dataset_toml::MOST_GAP_S;
use crate::{ConfigProblem, Error, ExpectedValue, NamedTopic, OpenOptions, Result, TopicRole};
use deepfusion_geometry::{Intrinsics, Se3};
use deepfusion_motion::{FusionConfig, SPEED_SCALES};
use nalgebra::Vector3;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Name of the file for every bag in a folder that has no file of its own.
const FOR_FOLDER: &str = "bag.toml";

/// All settings. Every key is optional; docs/reference/bag-toml.md explains them.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct BagConfig {
    /// Name of a data set's published calibration, used for what the bag does not have: `umad`.
    pub(super) profile: Option<String>,
    /// The kind of drive; an evaluation has a row for each.
    pub(super) scenario: Option<String>,
    /// Whether the bag is simulated; if not set, its topics decide.
    pub(super) simulated: Option<bool>,
    /// Topics by name, if their types are ambiguous.
    pub(super) topics: TopicNames,
    /// A camera without distortion, if there is no CameraInfo.
    pub(super) camera: Option<CameraConfig>,
    /// Path of the folder for a video stream's decoded frames, relative to this file's folder.
    pub(super) cache: Option<PathBuf>,
    /// Path of a calibration file, relative to this file's folder.
    pub(super) calibration: Option<PathBuf>,
    /// Frames of `/tf_static` and `/tf` by name, if they are neither in the messages nor have usual names.
    pub(super) frames: FrameNames,
    /// The transform from the LiDAR to the camera.
    pub(super) cam_from_lidar: Option<Transform>,
    /// The transform from the vehicle (middle of the rear axle; x forward, y left, z up) to the camera.
    pub(super) cam_from_vehicle: Option<Transform>,
    /// The transform from the inertial unit to the vehicle.
    pub(super) vehicle_from_imu: Option<Transform>,
    /// The vehicle's geometry and speed.
    pub(super) vehicle: VehicleConfig,
    /// How to read the LiDAR's scans.
    pub(super) lidar: LidarConfig,
    /// The clock offset, and the largest time between a scan and its frame.
    pub(super) clock: ClockConfig,
    /// Signals of CAN frames.
    pub(super) can: Option<CanConfig>,
    /// Weights of the sensors in the motion.
    pub(super) fusion: FusionConfig,
    /// The profile's camera, used if there is no other.
    #[serde(skip)]
    pub(super) profile_camera: Option<CameraConfig>,
    /// The profile's mounts that the file does not have; the bag's own frames take precedence.
    #[serde(skip)]
    pub(super) profile_mounts: MountConfig,
    /// The roles whose topics the caller named.
    #[serde(skip)]
    pub(super) given_topics: Vec<TopicRole>,
    /// Path from which it was read, or at which it would be if it existed.
    #[serde(skip)]
    pub(super) path: PathBuf,
}

/// The sensors' mounts.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct MountConfig {
    pub(super) cam_from_lidar: Option<Transform>,
    pub(super) cam_from_vehicle: Option<Transform>,
    pub(super) vehicle_from_imu: Option<Transform>,
}

/// Names of frames.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct FrameNames {
    /// The vehicle's frame, at or below the middle of the rear axle; x forward, y left, z up.
    pub(super) vehicle: Option<String>,
    pub(super) camera: Option<String>,
    pub(super) lidar: Option<String>,
    pub(super) imu: Option<String>,
}

/// Names of topics; [`NamedTopic::NONE`] to read none.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct TopicNames {
    pub(super) image: Option<String>,
    pub(super) camera_info: Option<String>,
    pub(super) lidar: Option<String>,
    pub(super) dynamic: Option<String>,
    pub(super) imu: Option<String>,
    pub(super) speed: Option<String>,
    pub(super) steering: Option<String>,
    pub(super) can: Option<String>,
    pub(super) truth: Option<String>,
}

impl TopicNames {
    /// The topic's name for a role.
    pub(super) fn of(&self, role: TopicRole) -> Option<&str> {
        let name = match role {
            TopicRole::Image => &self.image,
            TopicRole::CameraInfo => &self.camera_info,
            TopicRole::Lidar => &self.lidar,
            TopicRole::Dynamic => &self.dynamic,
            TopicRole::Imu => &self.imu,
            TopicRole::Speed => &self.speed,
            TopicRole::Steering => &self.steering,
            TopicRole::Can => &self.can,
            TopicRole::Truth => &self.truth,
        };
        name.as_deref()
    }

    /// Whether no topic is to be read for a role.
    pub(super) fn is_none(&self, role: TopicRole) -> bool {
        role.is_optional() && self.of(role) == Some(NamedTopic::NONE)
    }
}

/// A camera given by four intrinsics and the image size.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraConfig {
    pub(super) fx: f64,
    pub(super) fy: f64,
    pub(super) cx: f64,
    pub(super) cy: f64,
    pub(super) width: u32,
    pub(super) height: u32,
}

/// A rigid transform: translation in metres, rotation as an axis-angle vector in radians.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Transform {
    pub(super) translation: [f64; 3],
    #[serde(default)]
    pub(super) rotation: [f64; 3],
}

/// The vehicle's geometry, and how to read its speed.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct VehicleConfig {
    pub(super) wheelbase_m: Option<f64>,
    /// True speed / measured speed: worn tyres give too high a speed.
    pub(super) speed_scale: Option<f64>,
    /// Angle of the steering wheel / angle of the road wheels; if not set, the signal is the road wheels' angle.
    pub(super) steering_ratio: Option<f64>,
    pub(super) steering_offset_rad: f64,
    /// Unit of the speed; required if its messages are Float32 or Float64.
    pub(super) speed_unit: Option<SpeedUnit>,
    /// Longest gap between GPS positions across which the speed is interpolated linearly, in seconds.
    pub(super) max_gap_s: Option<f64>,
}

/// How to read the LiDAR's scans.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct LidarConfig {
    /// Name of the field of the radial velocity; if not set, the usual names are tried.
    pub(super) velocity_field: Option<String>,
    /// Name of the field of the points' own times, for scans that are not compensated for the vehicle's motion.
    pub(super) time_field: Option<String>,
    /// The sign of a receding point's velocity.
    pub(super) receding: Sign,
    /// Whether the sensor already subtracts its own velocity.
    pub(super) over_ground: bool,
    /// Speed over ground along the ray from which a point counts as moving, m/s.
    pub(super) moving_mps: f64,
}

impl Default for LidarConfig {
    fn default() -> Self {
        Self {
            velocity_field: None,
            time_field: None,
            receding: Sign::Positive,
            over_ground: false,
            moving_mps: 0.5,
        }
    }
}

/// A sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Sign {
    Positive,
    Negative,
}

/// Offset and tolerance of the clocks.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ClockConfig {
    /// How far the clock of camera and LiDAR is ahead of the vehicle's, in seconds; subtracted from their stamps.
    /// [`crate::OpenOptions::camera_ahead_s`] takes precedence.
    pub(super) camera_ahead_s: f64,
    /// Largest time between a frame and its scan, in seconds.
    pub(super) scan_within_s: f64,
}

impl Default for ClockConfig {
    fn default() -> Self {
        Self {
            camera_ahead_s: 0.0,
            scan_within_s: 0.025,
        }
    }
}

/// Whether the file beside a bag marks the bag as simulated; false if the file cannot be read.
pub(crate) fn marked_as_simulated(bag: &Path) -> bool {
    BagConfig::of(bag, &OpenOptions::default()).is_ok_and(|config| config.simulated == Some(true))
}

impl BagConfig {
    /// Reads the file beside a bag, if any; the caller's options take precedence.
    ///
    /// # Errors
    /// [`Error::Config`], [`Error::File`].
    pub(super) fn of(bag: &Path, options: &OpenOptions) -> Result<Self> {
        let mut config = Self::beside(bag)?;
        options.topics.iter().for_each(|topic| config.name(topic));
        config.given_topics = options.topics.iter().map(|topic| topic.role).collect();
        Ok(config)
    }

    /// Sets a topic's name. A CAN signal in the file for the same quantity is then not read.
    fn name(&mut self, NamedTopic { role, topic }: &NamedTopic) {
        let names = &mut self.topics;
        let place = match role {
            TopicRole::Image => &mut names.image,
            TopicRole::CameraInfo => &mut names.camera_info,
            TopicRole::Lidar => &mut names.lidar,
            TopicRole::Dynamic => &mut names.dynamic,
            TopicRole::Imu => &mut names.imu,
            TopicRole::Speed => &mut names.speed,
            TopicRole::Steering => &mut names.steering,
            TopicRole::Can => &mut names.can,
            TopicRole::Truth => &mut names.truth,
        };
        *place = Some(topic.clone());
        if let Some(can) = &mut self.can {
            match role {
                TopicRole::Speed => can.speed = None,
                TopicRole::Steering => can.steering = None,
                _ => {}
            }
        }
    }

    fn beside(bag: &Path) -> Result<Self> {
        let mut candidates = Self::candidates(bag);
        // If there is no file beside a link, use the one beside its target.
        if let Ok(real) = bag.canonicalize() {
            candidates.extend(Self::candidates(&real));
        }
        let there = candidates.iter().find(|path| path.is_file());
        // Without any file, use the path of the first candidate.
        let path = there.or(candidates.first()).cloned().unwrap_or_default();
        // Read it without the profile first, so that an error names its line.
        let mut config: Self = crate::dataset_toml::read_or_default(&path)?;
        if let Some(name) = &config.profile {
            let own = crate::dataset_toml::read_or_default(&path)?;
            if let Some(filled) = Self::with_profile(own, name) {
                config = filled.map_err(|e| Error::Config {
                    path: path.clone(),
                    problem: e.into(),
                })?;
            }
        }
        config.path = path;
        config.validate()?;
        Ok(config)
    }

    /// A bag's file completed by the profile of this name; `None` if there is no such profile.
    ///
    /// # Errors
    /// If the result is not a valid configuration.
    pub(super) fn with_profile(
        own: toml::Table,
        name: &str,
    ) -> Option<std::result::Result<Self, toml::de::Error>> {
        let completed = profile::complete(own, name)?;
        Some(completed.and_then(|completed| {
            let mut config: Self = completed.table.try_into()?;
            config.profile_camera = completed.camera.map(toml::Value::try_into).transpose()?;
            config.profile_mounts = completed.mounts.try_into()?;
            Ok(config)
        }))
    }

    /// Paths at which a bag's file is looked for, in this order.
    pub(super) fn candidates(bag: &Path) -> Vec<PathBuf> {
        let shared = bag.with_file_name(FOR_FOLDER);
        if !bag.is_dir() {
            return vec![bag.with_extension("toml"), shared];
        }
        // A ROS 2 bag is a folder: the file is in it, beside it under its full name, or for all bags of the folder above.
        let mut own = bag.as_os_str().to_owned();
        own.push(".toml");
        vec![bag.join(FOR_FOLDER), PathBuf::from(own), shared]
    }

    fn validate(&self) -> Result<()> {
        let numbers = [
            ("lidar.moving_mps", self.lidar.moving_mps, true),
            ("clock.scan_within_s", self.clock.scan_within_s, true),
            ("clock.camera_ahead_s", self.clock.camera_ahead_s, false),
        ];
        let scale = self.vehicle.speed_scale.unwrap_or(1.0);
        if !SPEED_SCALES.contains(&scale) {
            return Err(self.wrong(crate::dataset_toml::bad_speed_scale(scale)));
        }
        if let Some(gap) = self.vehicle.max_gap_s
            && !(gap > 0.0 && gap <= MOST_GAP_S)
        {
            return Err(self.wrong(ConfigProblem::Value {
                key: "vehicle.max_gap_s",
                value: gap,
                expected: ExpectedValue::TimeUpTo(MOST_GAP_S),
            }));
        }
        for (key, value, positive) in numbers {
            if !value.is_finite() || (positive && value <= 0.0) {
                return Err(self.wrong(ConfigProblem::Value {
                    key,
                    value,
                    expected: ExpectedValue::AsNamed,
                }));
            }
        }
        for (key, transform) in [
            ("cam_from_lidar", self.cam_from_lidar),
            ("cam_from_vehicle", self.cam_from_vehicle),
            ("vehicle_from_imu", self.vehicle_from_imu),
        ] {
            let Some(t) = transform else { continue };
            let all = t.translation.iter().chain(&t.rotation);
            if !all.clone().all(|x| x.is_finite()) {
                return Err(self.wrong(ConfigProblem::NotFinite { key }));
            }
        }
        if self.camera.is_some() && self.calibration.is_some() {
            return Err(self.wrong(ConfigProblem::CameraAndCalibration));
        }
        let mut known = profile::names();
        match &self.profile {
            Some(asked) if !known.any(|name| name == asked) => {
                let known = profile::names().collect();
                Err(self.wrong(ConfigProblem::NoProfile { known }))
            }
            _ => Ok(()),
        }
    }

    /// The folder to which the paths in this file are relative.
    pub(super) fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(&self.path)
    }

    pub(super) fn wrong(&self, problem: impl Into<ConfigProblem>) -> Error {
        Error::Config {
            path: self.path.clone(),
            problem: problem.into(),
        }
    }
}

impl Transform {
    pub(super) fn se3(&self) -> Se3 {
        Se3::from_axis_angle(
            Vector3::from(self.rotation),
            Vector3::from(self.translation),
        )
    }
}

impl CameraConfig {
    pub(super) fn intrinsics(&self) -> Intrinsics {
        let pinhole = [self.fx, self.fy, self.cx, self.cy];
        Intrinsics::from_numbers(pinhole, (self.width, self.height))
    }
}
