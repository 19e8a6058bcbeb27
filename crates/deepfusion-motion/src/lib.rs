//! A vehicle's motion from its own sensors, which gives learned depth its metric scale.
//!
//! [`VehicleSensors`] (speed, steering, inertial unit) → [`FusedTrack`] → [`VehicleMotion`] between any
//! two times → the camera's motion ([`VehicleMotion::camera0_from_camera1`]). [`MotionModel`] holds
//! either that or a [`VehicleTrack`], from a unit that measures both speed and yaw rate.
//!
//! | Equation | Here |
//! |---|---|
//! | 23–25: d_I, θ_I from the inertial unit | [`ImuTrack`] |
//! | 26–27: d_V, θ_V from speed and steering | [`Signal::integral`], [`Bicycle`] |
//! | 28–31: fusion | [`FusedTrack`], [`FusionConfig`] |
//! | 32–36: what the loss compares with | [`VehicleMotion`] |
//!
//! Further modules: [`identify`] (wheelbase, steering ratio), [`time_offset`] (the camera's clock relative to the vehicle's, from
//! [`ImageMotion`]), [`can`] (signals from CAN frames), [`comma`] (comma2k19).
//!
//! # Conventions
//! Vehicle frame: x forward, y left, z up, origin in the middle of the rear axle. Seconds, metres, radians; yaw is positive to the left.
//! Gaps of a sensor are not filled: the result is `None`. Samples that are not finite, or not later than the one before, are dropped.
//!
//! ```
//! use deepfusion_motion::{Bicycle, FusedTrack, MotionConfig, Signal, VehicleSensors};
//!
//! // 10 m/s with the road wheels at 0.1 rad, at 50 Hz.
//! let constant = |value: f64| Signal::new((0..100).map(move |i| (f64::from(i) * 0.02, value)));
//! let sensors = VehicleSensors {
//!     speed_mps: constant(10.0),
//!     steering_rad: Some(constant(0.1)),
//!     imu: None,
//! };
//! let config = MotionConfig { bicycle: Some(Bicycle::new(2.7)), ..MotionConfig::default() };
//! let track = FusedTrack::new(&sensors, &config)?;
//! let motion = track.motion(0.5, 0.6).unwrap();
//! assert!((motion.distance_m - 1.0).abs() < 1e-9);
//! assert!((motion.yaw_rad - 1.0 * 0.1_f64.tan() / 2.7).abs() < 1e-9);
//! # Ok::<(), deepfusion_motion::Error>(())
//! ```

mod bicycle;
pub mod can;
pub mod comma;
mod error;
mod fusion;
mod identify;
mod image_motion;
mod imu;
mod motion_model;
mod positions;
mod road_height;
mod scale_correction;
mod scale_monitor;
mod scene_scale;
mod signal;
mod time_offset;
mod vehicle_motion;
mod vehicle_track;
mod yaw_error;

pub use deepfusion_fs::FileError;

pub use bicycle::Bicycle;
pub use error::{Error, ExpectedSetting, Result};
pub use fusion::{
    FusedTrack, FusionConfig, MotionConfig, MotionParts, SPEED_SCALES, VehicleSensors,
};
pub use identify::{
    Estimate, Identified, IdentifyConfig, Unidentifiable, UnidentifiableReason, identify,
};
pub use image_motion::{GreyFrame, ImageMotion, image_motions};
pub use imu::{
    ImuConfig, ImuMount, ImuSample, ImuTrack, Standstill, StandstillConfig, standstills,
};
pub use motion_model::MotionModel;
pub use positions::{COURSE_MPS, Fix, FixSpeed, FixSpeedSource, course_rates, speeds_of_fixes};
pub use road_height::{
    GreyImage, GroundPair, RoadCosts, RoadTexture, SWEEP_M, SWEEP_RATIO, implied_camera_height,
};
pub use scale_correction::ScaleCorrection;
pub use scale_monitor::{ScaleMonitor, ScaleMonitorConfig, ScaleReading, ScaleState};
pub use scene_scale::{Alignment, DepthImage, GreyPyramid, SceneFactor, View, align, scene_points};
pub use signal::Signal;
pub use time_offset::{NoTimeOffset, OffsetConfig, TimeOffset, VehicleRates, time_offset};
pub use vehicle_motion::VehicleMotion;
pub use vehicle_track::VehicleTrack;
