//! How a vehicle moved, from its own sensors.

mod bicycle;
pub mod can;
pub mod comma;
mod error;
mod fusion;
mod identify;
mod image_motion;
mod imu;
mod motion_model;
mod signal;
mod time_offset;
mod vehicle_motion;
mod vehicle_track;

pub use bicycle::Bicycle;
pub use error::{Error, Result};
pub use fusion::{FusedTrack, FusionConfig, MotionConfig, MotionParts, VehicleSensors};
pub use identify::{Estimate, Identified, IdentifyConfig, Unidentifiable, Why, identify};
pub use image_motion::{GreyFrame, ImageMotion};
pub use imu::{
    ImuConfig, ImuMount, ImuSample, ImuTrack, Standstill, StandstillConfig, standstills,
};
pub use motion_model::MotionModel;
pub use signal::Signal;
pub use time_offset::{NoTimeOffset, OffsetConfig, TimeOffset, time_offset};
pub use vehicle_motion::VehicleMotion;
pub use vehicle_track::VehicleTrack;
