//! The file beside a bag, `<bag>.toml` or `bag.toml` for all bags of a folder: what the bag does not say.

use super::can_config::{CanConfig, SpeedUnit};
use super::profile;
use crate::dataset_toml::MOST_GAP_S;
use crate::{ConfigProblem, Error, ExpectedValue, NamedTopic, OpenOptions, Result, TopicRole};
use deepfusion_geometry::{Intrinsics, Se3};
use deepfusion_motion::{FusionConfig, SPEED_SCALES};
use nalgebra::Vector3;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// The file for every bag of a folder that has none of its own.
const OF_FOLDER: &str = "bag.toml";

/// Everything that can be said. All of it is optional; docs/reference/bag-toml.md explains each key.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct BagConfig {
    /// A data set's published numbers, where the bag has none: `umad`.
    pub(super) profile: Option<String>,
    /// The kind of drive, for one row each in the evaluation.
    pub(super) scenario: Option<String>,
    /// Whether a simulator wrote the bag; where nothing is said, its topics decide.
    pub(super) simulated: Option<bool>,
    /// Topics by name, where the type does not decide.
    pub(super) topics: TopicNames,
    /// A camera without distortion, where there is no CameraInfo.
    pub(super) camera: Option<CameraConfig>,
    /// Where the frames of a video stream are kept once decoded, from this file's folder.
    pub(super) cache: Option<PathBuf>,
    /// A calibration tool's file, from this one's folder.
    pub(super) calibration: Option<PathBuf>,
    /// Frames of `/tf_static` and `/tf` by name, where neither messages nor usual names decide.
    pub(super) frames: FrameNames,
    /// A point of the LiDAR in the camera.
    pub(super) cam_from_lidar: Option<Transform>,
    /// A point of the vehicle (middle of the rear axle; x forward, y left, z up) in the camera.
    pub(super) cam_from_vehicle: Option<Transform>,
    /// A point of the inertial unit in the vehicle.
    pub(super) vehicle_from_imu: Option<Transform>,
    /// The vehicle's geometry.
    pub(super) vehicle: VehicleConfig,
    /// The LiDAR's ways.
    pub(super) lidar: LidarConfig,
    /// Clocks and how near in time two sensors must be.
    pub(super) clock: ClockConfig,
    /// Signals of CAN frames.
    pub(super) can: Option<CanConfig>,
    /// Weights of the sensors in the motion.
    pub(super) fusion: FusionConfig,
    /// The profile's camera, where nothing else says one.
    #[serde(skip)]
    pub(super) profile_camera: Option<CameraConfig>,
    /// The profile's mounts that the file does not have: they go behind the bag's own frames.
    #[serde(skip)]
    pub(super) profile_mounts: MountConfig,
    /// The roles whose topics the caller named.
    #[serde(skip)]
    pub(super) given_topics: Vec<TopicRole>,
    /// Where it was read from; the path it would have where there is none.
    #[serde(skip)]
    pub(super) path: PathBuf,
}

/// Where the sensors are.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct MountConfig {
    pub(super) cam_from_lidar: Option<Transform>,
    pub(super) cam_from_vehicle: Option<Transform>,
    pub(super) vehicle_from_imu: Option<Transform>,
}

/// Frames by name.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct FrameNames {
    /// Below or at the middle of the rear axle; x forward, y left, z up.
    pub(super) vehicle: Option<String>,
    pub(super) camera: Option<String>,
    pub(super) lidar: Option<String>,
    pub(super) imu: Option<String>,
}

/// Topics by name; [`NamedTopic::NONE`] for none.
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
    /// The name for a role.
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

    /// Whether nothing is to be read for a role.
    pub(super) fn is_none(&self, role: TopicRole) -> bool {
        role.is_optional() && self.of(role) == Some(NamedTopic::NONE)
    }
}

/// A camera by four numbers and its image's size.
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

/// A rigid motion: metres, and an axis-angle vector in radians.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Transform {
    pub(super) translation: [f64; 3],
    #[serde(default)]
    pub(super) rotation: [f64; 3],
}

/// The vehicle's geometry, and the unit of a bare number as its speed.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct VehicleConfig {
    pub(super) wheelbase_m: Option<f64>,
    /// True speed over the vehicle's: worn tyres read too fast.
    pub(super) speed_scale: Option<f64>,
    /// Steering wheel's angle over road wheels'; without it the signal is the road wheels' angle.
    pub(super) steering_ratio: Option<f64>,
    pub(super) steering_offset_rad: f64,
    /// Needed where the speed is a Float32 or Float64.
    pub(super) speed_unit: Option<SpeedUnit>,
    /// Longest gap between satellite positions across which their speed is a straight line, in seconds.
    pub(super) max_gap_s: Option<f64>,
}

/// The LiDAR's ways.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct LidarConfig {
    /// The field of the radial velocity; without it the usual names are tried.
    pub(super) velocity_field: Option<String>,
    /// The field of the points' own times, where the vehicle's motion is still in a scan.
    pub(super) time_field: Option<String>,
    /// The sign of a point that recedes.
    pub(super) receding: Sign,
    /// Whether the sensor already took its own velocity out.
    pub(super) over_ground: bool,
    /// Speed over ground along the ray from which a point moves, m/s.
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

/// Clocks.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ClockConfig {
    /// How far the clock of camera and LiDAR is ahead of the vehicle's, in seconds; taken off their stamps.
    /// [`crate::OpenOptions::camera_ahead_s`] goes before it.
    pub(super) camera_ahead_s: f64,
    /// A scan belongs to a frame if they are no farther apart, in seconds.
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

/// Whether the file beside a bag says that the bag is simulated. One that cannot be read says nothing.
pub(crate) fn says_simulated(bag: &Path) -> bool {
    BagConfig::of(bag, &OpenOptions::default()).is_ok_and(|config| config.simulated == Some(true))
}

impl BagConfig {
    /// Reads the file beside a bag, with what a caller says in its place; where there is none, nothing is said.
    ///
    /// # Errors
    /// [`Error::Config`], [`Error::File`].
    pub(super) fn of(bag: &Path, options: &OpenOptions) -> Result<Self> {
        let mut config = Self::beside(bag)?;
        options.topics.iter().for_each(|topic| config.name(topic));
        config.given_topics = options.topics.iter().map(|topic| topic.role).collect();
        Ok(config)
    }

    /// Names a topic. A signal that the file has for the same quantity is not read then.
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
        // Of a link, the file beside what it leads to, where the link has none beside itself.
        if let Ok(real) = bag.canonicalize() {
            candidates.extend(Self::candidates(&real));
        }
        let there = candidates.iter().find(|path| path.is_file());
        // Where there is none, the first is where one would be looked for.
        let path = there.or(candidates.first()).cloned().unwrap_or_default();
        // Read alone first: what is wrong with it is then reported with its line.
        let mut config: Self = crate::dataset_toml::read_or_default(&path)?;
        if let Some(name) = &config.profile {
            let own = crate::dataset_toml::read_or_default(&path)?;
            if let Some(filled) = Self::over_profile(own, name) {
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

    /// The table of a bag's file over the profile of this name; `None` where there is no such profile.
    ///
    /// # Errors
    /// What of either is no such file.
    pub(super) fn over_profile(
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

    /// Where a bag's file is looked for, in this order.
    pub(super) fn candidates(bag: &Path) -> Vec<PathBuf> {
        let shared = bag.with_file_name(OF_FOLDER);
        if !bag.is_dir() {
            return vec![bag.with_extension("toml"), shared];
        }
        // A bag of ROS 2 is a folder: within it, beside it under its whole name, or for all of the folder above.
        let mut own = bag.as_os_str().to_owned();
        own.push(".toml");
        vec![bag.join(OF_FOLDER), PathBuf::from(own), shared]
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

    /// Where files that it names are looked for.
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
