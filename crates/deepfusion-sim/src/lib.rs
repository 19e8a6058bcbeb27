//! A procedural drive: a generated street, a car driving along it, and the recordings of its
//! camera, scanner and inertial unit, with exact ground truth.
//!
//! ```
//! use deepfusion_sim::{SimConfig, Simulation};
//!
//! let config = SimConfig { seed: 7, frames: 2, width: 160, height: 48, ..SimConfig::default() };
//! let simulation = Simulation::new(&config)?;
//! let frame = simulation.frame(1);
//! assert_eq!(frame.rgb.dimensions(), (160, 48));
//! assert!(frame.depth.count() > 0);
//! # Ok::<(), deepfusion_sim::Error>(())
//! ```
//!
//! # Conventions
//! World: x east, y north, z up, the road at z = 0. Camera: x right, y down, z forward; depth is
//! camera z. Vehicle, IMU, velodyne: x forward, y left, z up. Metres, seconds, radians.
//!
//! # Consistency
//! Textures are attached to surfaces and never depend on the viewer, and detail smaller than a pixel is averaged, not aliased: one frame,
//! warped by its true depth and pose, gives the next one. In a varied drive ([`SimConfig::varied`]) this applies to depth, pose and
//! surfaces, but not to what air, wet ground, lens and sensor do to colours. Shadows under moving cars move with them. The mask of dynamic
//! pixels covers the moving cars and the people who ride and walk. Every dynamic object is a rigid body: nobody pedals or swings their
//! arms.

mod can;
mod config;
mod crown;
mod error;
mod files;
mod fmcw;
mod imu;
mod kitti;
mod light;
mod motion;
mod oxts;
mod primitive;
mod render;
mod riders;
mod rig;
mod road;
mod scanner;
mod scene;
mod simulation;
mod texture;
mod tracklets;
mod traffic;
mod umad;
mod varied;
mod velodyne;

pub use can::{SpeedReading, SteeringReading, WHEELBASE_M};
pub use config::{Scene, Sensors, SimConfig};
pub use error::{Error, ExpectedSetting, Result, VariedConflict};
pub use fmcw::FmcwScan;
pub use imu::ImuReading;
pub use kitti::write_kitti;
pub use oxts::OxtsReading;
pub use rig::Rig;
pub use scene::{ObjectClass, SceneObject, Variety};
pub use simulation::{SimFrame, Simulation};
pub use umad::{BagSettings, topic, write_bag};
pub use varied::{
    DrawnDrive, DrawnLight, Endless, EndlessConfig, Ingredient, MountedCamera, View, Weather,
};
