//! Metric depth from one camera and a speed signal.
//!
//! DeepFusion turns each image of a vehicle's camera into depth in metres, a point cloud and 3D targets. It learns from the vehicle's own
//! video and speed, without depth labels. This crate is the library; the command `deepfusion` is built on the same crates.
//!
//! # From an image to metres
//!
//! The library embeds networks that were trained on simulated views only, so their weights carry no licence but this project's.
//! [`DepthEstimator`] runs them, or a network that you trained.
//!
//! ```
//! use deepfusion::{DepthEstimator, sim};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let street = sim::Simulation::new(&sim::SimConfig { frames: 1, ..Default::default() })?;
//! let (image, camera) = (street.frame(0).rgb, street.intrinsics()); // or data::load_photo("street.jpg")
//! let mut estimator = DepthEstimator::load("tiny")?; // or the better network "street", or a run folder
//! let depth = estimator.estimate(&image, Some(&camera))?.depth();
//! let middle = depth.data[depth.data.len() / 2 + depth.width / 2];
//! println!("{}x{} pixels, {middle:.1} m in the middle", depth.width, depth.height);
//! # assert!(middle > 0.1 && middle < 90.0);
//! # Ok(())
//! # }
//! ```
//!
//! # From a drive to a trained run
//!
//! [`Dataset`](data::Dataset) opens recordings of any known layout: KITTI, a folder of images or a video with a table of
//! speeds, a ROS bag, and more. Training needs the feature `train`, which is on by default.
//!
#![cfg_attr(feature = "train", doc = "```")]
#![cfg_attr(not(feature = "train"), doc = "```ignore")]
//! use deepfusion::data::{Dataset, OpenOptions};
//! use deepfusion::model::{Preset, RunFolder, TrainConfig};
//! use deepfusion::train::{Control, Device, SampleSet, Trainer};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let (drive, run) = ("drives/monday", "runs/monday");
//! let config = TrainConfig { steps: Some(2), ..Preset::Tiny.config() }; // it takes thousands to learn something
//! # use deepfusion::sim::{SimConfig, Simulation, write_kitti};
//! # let temporary = tempfile::tempdir()?;
//! # let small = SimConfig { frames: 12, width: 320, height: 96, ..Default::default() };
//! # let go_on = std::ops::ControlFlow::Continue(());
//! # let drive = write_kitti(&Simulation::new(&small)?, temporary.path(), &mut |_, _| go_on)?;
//! # let run = temporary.path().join("run");
//! # let mut config = config;
//! # (config.batch, config.size.width, config.validation_share) = (2, 64, 0.2);
//! # config.size.height = 64;
//! let drives = Dataset::open(drive.as_ref(), &OpenOptions::default())?;
//! let (samples, held_out, _skipped) = SampleSet::split(&config, drives, None)?;
//! let run = RunFolder::create(run.as_ref())?;
//! let mut trainer = Trainer::create(config, run, (samples, held_out), &Device::flex(), Ok)?;
//! let summary = trainer.run(&mut |_event| Control::Continue)?;
//! # assert_eq!(summary.step, 2);
//! # Ok(())
//! # }
//! ```
//!
//! # From a bag to its streams
//!
//! ```
//! use deepfusion::bags::{Bag, Selection};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let path = "drives/monday.bag";
//! # use deepfusion::sim::{BagSettings, SimConfig, Simulation, write_bag};
//! # let temporary = tempfile::tempdir()?;
//! # let small = SimConfig { frames: 4, width: 160, height: 96, ..Default::default() };
//! # let street = Simulation::new(&small)?;
//! # let go_on = std::ops::ControlFlow::Continue(());
//! # let path = write_bag(&street, temporary.path(), &BagSettings::default(), &mut |_, _| go_on)?;
//! let bag = Bag::open(path)?;
//! for topic in bag.topics()? {
//!     println!("{}  {}  {} messages", topic.name, topic.type_name, topic.count);
//! }
//! let first = bag.messages(Selection::all())?.next().transpose()?;
//! assert!(first.is_some());
//! # Ok(())
//! # }
//! ```
//!
//! # Where things are
//!
//! | Module | What it contains |
//! |---|---|
//! | [`runtime`] | running trained networks: [`DepthEstimator`] over the fused engine or ONNX Runtime, without the training framework |
//! | [`model`] | configurations, weights as safetensors, runs on disk |
//! | [`weights`] | the embedded networks |
//! | [`jobs`] | networks over whole recordings and folders: evaluation, bulk prediction, verdict, scored targets |
//! | [`eval`] | metrics, the field's protocol, evaluations side by side |
//! | [`records`] | the JSON beside predictions and targets |
//! | [`data`] | recordings as data sets, frames and ground truth |
//! | [`logs`] | speeds and turns from GPS tracks, OBD apps, phones, CAN traces, any table |
//! | [`calibrate`] | a camera's intrinsics and lens, from pictures of a checkerboard |
//! | [`doctor`] | what is wrong with a recording |
//! | [`images`] | reads, resizes and writes images; the camera from EXIF |
//! | [`video`] | frames of videos, cameras and streams, through the user's ffmpeg |
//! | [`motion`] | how a vehicle moved, from IMU, CAN and GPS |
//! | [`bags`] | reads and writes ROS 1 bags |
#![cfg_attr(
    feature = "ros2",
    doc = "| [`ros2_bags`] | reads ROS 2 bags as the messages of [`bags`] |"
)]
//! | [`perception`] | from a depth image to 3D targets, tracks and free space |
//! | [`instances`] | the objects in an image, by your ONNX segmentation model |
//! | [`geometry`] | cameras, motions, depth images; `cloud`: point clouds and their files |
//! | [`sim`] | streets with exact depth, to train and test on |
//! | [`onnx`], [`render`] | networks as ONNX files; pictures, charts and reports |
//! | [`view`] | results in the browser: the server and its page |
//! | [`infer`] | a network as a graph, and the fused engine that runs it |
#![cfg_attr(
    feature = "train",
    doc = "| [`train`], [`nn`] | training on a drive: losses, trainer, checkpoints; the networks in Burn |"
)]
//!
//! Camera axes are x right, y down, z forward, in metres. Transforms are named `target_from_source`.

pub use deepfusion_calibrate as calibrate;
pub use deepfusion_data as data;
pub use deepfusion_doctor as doctor;
pub use deepfusion_eval as eval;
pub use deepfusion_geometry as geometry;
pub use deepfusion_images as images;
pub use deepfusion_infer as infer;
pub use deepfusion_instances as instances;
pub use deepfusion_jobs as jobs;
pub use deepfusion_logs as logs;
pub use deepfusion_model as model;
pub use deepfusion_motion as motion;
#[cfg(feature = "train")]
pub use deepfusion_nn as nn;
pub use deepfusion_onnx as onnx;
pub use deepfusion_perception as perception;
pub use deepfusion_records as records;
pub use deepfusion_render as render;
#[cfg(feature = "ros2")]
pub use deepfusion_ros2bag as ros2_bags;
pub use deepfusion_rosbag as bags;
pub use deepfusion_runtime as runtime;
pub use deepfusion_sim as sim;
#[cfg(feature = "train")]
pub use deepfusion_train as train;
pub use deepfusion_video as video;
pub use deepfusion_view as view;
pub use deepfusion_weights as weights;

pub use deepfusion_hint::Hint;
pub use deepfusion_runtime::{DepthEstimator, Prediction};
