//! One pass over a bag: the times of images and scans, and the vehicle's measurements.

use super::can::Can;
use super::config::BagConfig;
use super::fixes::Fixes;
use super::frames::Frames;
use super::odometry_poses::{PoseMotion, motion_of};
use super::packet::{VideoTopic, packet};
use super::readings::{Reading, reading, steering};
use super::topics::Topics;
use super::world_axes::are_world_axes;
use crate::logs::samples::Samples;
use crate::{DataWarning, Error, ImageProblem, MotionWarning, Result, TopicRole};
use deepfusion_geometry::Se3;
use deepfusion_motion::ImuSample;
use deepfusion_rosbag::msg::{
    CameraInfo, Float32, Float64, Frame, Imu, NavSatFix, Odometry, OldTFMessage, TFMessage,
};
use deepfusion_rosbag::{Message, MessageSource, Selection, Time};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::path::Path;

/// The position of a message that is read again on request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MessageRef {
    /// Time of recording, by which it is found again.
    pub(super) recorded: Time,
    /// Time of measurement on the sensor's clock, nanoseconds since 1970.
    pub(super) stamp_ns: i64,
}

/// The message nearest to a time, at most `within_s` away; `places` are ordered by time.
pub(super) fn nearest(
    places: &[(MessageRef, f64)],
    time_s: f64,
    within_s: f64,
) -> Option<&(MessageRef, f64)> {
    let after = places.partition_point(|p| p.1 < time_s);
    let around = places[after.saturating_sub(1)..].iter().take(2);
    let apart = |p: &&(MessageRef, f64)| (p.1 - time_s).abs();
    let nearest = around.min_by(|a, b| apart(a).total_cmp(&apart(b)));
    nearest.filter(|p| apart(p) <= within_s)
}

/// Everything found in one pass. Times of the vehicle's streams are nanoseconds.
#[derive(Debug, Default)]
pub(super) struct Index {
    pub(super) images: Vec<MessageRef>,
    /// Packets of a camera whose messages are a video stream.
    pub(super) video: Option<VideoTopic>,
    pub(super) scans: Vec<MessageRef>,
    /// Messages with the dynamic points.
    pub(super) dynamic: Vec<MessageRef>,
    pub(super) camera_info: Option<CameraInfo>,
    /// One speed per message, or the speeds that [`Fixes::speeds`] computes from GPS positions.
    pub(super) speed_mps: Vec<(i64, f64)>,
    /// One lateral velocity per twist, for the entries of `speed_mps`.
    across_mps: Vec<f64>,
    /// One `world_from_body` per odometry message without a twist.
    poses: Vec<(i64, Se3)>,
    /// GPS positions, if they are the source of the speed.
    pub(super) fixes: Fixes,
    /// Standard deviations of the speeds from positions.
    pub(super) sigmas_mps: Option<Samples>,
    /// Rates of turn of the course from positions.
    pub(super) course_rates_radps: Option<Samples>,
    /// Yaw rates in the messages with the speed, rad/s; not every publisher fills them in.
    pub(super) yaw_rate: Vec<(i64, f64)>,
    /// Roll and pitch rate, in rad/s, if a twist has all three rates.
    pub(super) tilt_rates: Vec<(i64, [f64; 2])>,
    /// Roll and pitch, in radians, if the speeds are computed from poses.
    pub(super) tilts_rad: Vec<(i64, [f64; 2])>,
    pub(super) steering_rad: Vec<(i64, f64)>,
    pub(super) imu: Vec<(i64, ImuSample)>,
    /// Whether a message of the inertial unit marks its rates as missing.
    rates_marked_missing: bool,
    /// `world_from_vehicle`, exact.
    pub(super) truth: Vec<(i64, Se3)>,
    /// The transforms between frames.
    pub(super) frames: Frames,
    /// The frame of the images, from the first message that names one; likewise for the other sensors.
    pub(super) image_frame: Option<String>,
    pub(super) camera_info_frame: Option<String>,
    pub(super) lidar_frame: Option<String>,
    pub(super) imu_frame: Option<String>,
    /// The frame that the speed refers to.
    pub(super) speed_frame: Option<String>,
    /// Errors about chunks or messages that could not be read, as text.
    pub(super) lost: Vec<String>,
    /// Warnings about CAN signals without any value.
    pub(super) silent: Vec<DataWarning>,
    /// Warnings about how speeds were computed.
    pub(super) computed: Vec<DataWarning>,
    /// Number of messages without a time in their header, by topic; their time of recording is used instead.
    pub(super) unstamped: BTreeMap<String, usize>,
}

impl Index {
    /// Whether the messages with the speed have a yaw rate. Publishers without one write zeros or NaN. Poses always give one.
    pub(super) fn has_yaw_rates(&self) -> bool {
        let turns = |rate: f64| rate.is_finite() && rate != 0.0;
        !self.tilts_rad.is_empty() || self.yaw_rate.iter().any(|(_, rate)| turns(*rate))
    }

    /// Reads the topics' stamps and the vehicle's values. Images and clouds are not decoded. Unreadable parts are
    /// counted and left out, since other chunks of the bag can still be used.
    ///
    /// # Errors
    /// [`Error::Bag`] if reading cannot begin; [`Error::Config`] for missing units or signals.
    pub(super) fn read(
        bag: &dyn MessageSource,
        topics: &Topics,
        config: &BagConfig,
    ) -> Result<Self> {
        let can = Can::of(config)?;
        let mut index = Self::default();
        for message in bag.messages(Selection::topics(topics.names()))? {
            let read = message
                .map_err(Error::from)
                .and_then(|message| index.add(bag, &message, topics, config, &can));
            match read {
                Ok(()) => {}
                Err(error @ (Error::Config { .. } | Error::Video(_))) => return Err(error),
                Err(error) => index.lost.push(error.to_string()),
            }
        }
        if !index.fixes.is_empty() {
            let topic = topics.of(TopicRole::Speed).unwrap_or_default();
            let most = config.vehicle.max_gap_s;
            let found = index.fixes.speeds(topic, most, &mut index.computed);
            index.speed_mps = found.speeds_mps;
            index.sigmas_mps = found.sigmas_mps;
            index.course_rates_radps = found.course_rates_radps;
        }
        index.take_poses(bag.path(), topics);
        index.take_lengths(topics);
        index.leave_out_rateless(topics);
        let beyond = can.keep_measured(&mut index.speed_mps, &mut index.steering_rad);
        // The only place where the vehicle's speeds are scaled, for all types of messages.
        let scale = config.vehicle.speed_scale.unwrap_or(1.0);
        index.speed_mps.iter_mut().for_each(|(_, v)| *v *= scale);
        if let Some(sigmas) = &mut index.sigmas_mps {
            sigmas.values.iter_mut().for_each(|v| *v *= scale);
        }
        index.silent = can.silent(index.speed_mps.len(), index.steering_rad.len());
        index.silent.extend(beyond);
        if let Some(video) = &mut index.video {
            if video.count != index.images.len() {
                return Err(Error::Image {
                    path: bag.path().to_owned(),
                    problem: ImageProblem::Mixed {
                        topic: video.name.clone(),
                    },
                });
            }
            video.order = (0..index.images.len() as u64).collect();
            let stamp_ns = |packet: &u64| index.images[*packet as usize].stamp_ns;
            video.order.sort_by_key(stamp_ns);
        }
        index.images.sort_by_key(|p| p.stamp_ns);
        index.scans.sort_by_key(|p| p.stamp_ns);
        index.dynamic.sort_by_key(|p| p.stamp_ns);
        index.truth.sort_by_key(|p| p.0);
        Ok(index)
    }

    /// Computes speed and turns from the poses of an odometry whose twists are all 0. If the poses are of a body with other axes,
    /// the speed is unknown: the zeros would mean a vehicle that stands still.
    fn take_poses(&mut self, bag: &Path, topics: &Topics) {
        let poses = std::mem::take(&mut self.poses);
        if poses.is_empty() || poses.len() != self.speed_mps.len() {
            return;
        }
        let topic = topics.of(TopicRole::Speed).unwrap_or_default().to_owned();
        let warning = match motion_of(bag, poses) {
            PoseMotion::Standing => return,
            PoseMotion::OtherAxes => {
                self.speed_mps.clear();
                self.yaw_rate.clear();
                MotionWarning::PosesOfOtherAxes { topic }
            }
            PoseMotion::Moving(log) if log.speeds_mps.ns.is_empty() => {
                self.speed_mps.clear();
                self.yaw_rate.clear();
                MotionWarning::PosesFarApart { topic }
            }
            PoseMotion::Moving(log) => {
                self.speed_mps = pairs(log.speeds_mps);
                self.yaw_rate = log.yaw_rates_radps.map(pairs).unwrap_or_default();
                self.tilts_rad = log.tilts_rad;
                MotionWarning::OfPoses { topic }
            }
        };
        self.tilt_rates.clear();
        self.across_mps.clear();
        self.computed.push(warning.into());
    }

    /// Uses the length of velocities in world axes as speed, since they do not show the vehicle's heading.
    fn take_lengths(&mut self, topics: &Topics) {
        let across = std::mem::take(&mut self.across_mps);
        let ahead = self.speed_mps.iter().map(|(_, ahead)| *ahead);
        if across.len() != self.speed_mps.len()
            || !are_world_axes(ahead.zip(across.iter().copied()))
        {
            return;
        }
        for ((_, speed), across) in self.speed_mps.iter_mut().zip(across) {
            *speed = speed.hypot(across);
        }
        let topic = topics.of(TopicRole::Speed).unwrap_or_default().to_owned();
        self.computed
            .push(MotionWarning::WorldAxes { topic }.into());
    }

    /// Leaves out an inertial unit without angular rates: its zeros do not mean a straight drive, nor does a constant rate that is marked
    /// as missing. Some drivers publish gyroscope and accelerometer as separate topics, others only fill in the accelerations.
    fn leave_out_rateless(&mut self, topics: &Topics) {
        let Some(topic) = topics.of(TopicRole::Imu) else {
            return;
        };
        let Some((_, first)) = self.imu.first() else {
            return;
        };
        let idle = if self.rates_marked_missing {
            first.angular_rate_radps
        } else {
            Vector3::zeros()
        };
        let measures = |(_, sample): &(i64, ImuSample)| sample.angular_rate_radps != idle;
        if self.imu.iter().any(measures) {
            return;
        }
        self.imu.clear();
        self.imu_frame = None;
        let topic = topic.to_owned();
        self.computed.push(MotionWarning::NoRates { topic }.into());
    }

    fn add_frames(&mut self, message: &Message<'_>) -> Result<()> {
        let transforms = if message.is::<OldTFMessage>() {
            message.decode::<OldTFMessage>()?.transforms
        } else {
            message.decode::<TFMessage>()?.transforms
        };
        transforms.iter().for_each(|t| self.frames.add(t));
        Ok(())
    }

    fn add(
        &mut self,
        bag: &dyn MessageSource,
        message: &Message<'_>,
        topics: &Topics,
        config: &BagConfig,
        can: &Can,
    ) -> Result<()> {
        if topics.has_frames(message.topic()) {
            return self.add_frames(message);
        }
        let at_ns = stamp(message);
        let mut timed = false;
        for role in topics.roles(message.topic()) {
            if role == TopicRole::Image
                && let Some((codec, packet)) = packet(bag.path(), message)?
                && !VideoTopic::add(&mut self.video, message.topic(), (codec, &packet))
            {
                continue;
            }
            timed |= role != TopicRole::CameraInfo;
            match role {
                TopicRole::Image | TopicRole::Lidar | TopicRole::Dynamic => {
                    let place = MessageRef {
                        recorded: message.time(),
                        stamp_ns: at_ns,
                    };
                    let (places, frame) = match role {
                        TopicRole::Image => (&mut self.images, Some(&mut self.image_frame)),
                        TopicRole::Dynamic => (&mut self.dynamic, None),
                        _ => (&mut self.scans, Some(&mut self.lidar_frame)),
                    };
                    places.push(place);
                    if let Some(frame @ None) = frame {
                        *frame = message.header_frame();
                    }
                }
                TopicRole::CameraInfo if self.camera_info.is_none() => {
                    self.camera_info = Some(message.decode::<CameraInfo>()?);
                    self.camera_info_frame = message.header_frame();
                }
                TopicRole::CameraInfo => {}
                TopicRole::Imu => {
                    let imu: Imu = message.decode()?;
                    // By the message's definition, there are no angular rates then; but some drivers write this with valid rates.
                    self.rates_marked_missing |= imu.angular_velocity_covariance[0] == -1.0;
                    let (a, w) = (imu.linear_acceleration, imu.angular_velocity);
                    let sample = ImuSample {
                        time_s: 0.0,
                        acceleration_mps2: Vector3::new(a.x, a.y, a.z),
                        angular_rate_radps: Vector3::new(w.x, w.y, w.z),
                    };
                    self.imu.push((at_ns, sample));
                    if self.imu_frame.is_none() {
                        self.imu_frame = Some(imu.header.frame_id).filter(|f| !f.is_empty());
                    }
                }
                TopicRole::Speed if message.is::<NavSatFix>() => {
                    self.fixes.add(at_ns, &message.decode()?);
                }
                TopicRole::Speed => {
                    let Reading {
                        speed_mps,
                        across_mps,
                        rates,
                        frame,
                        pose,
                    } = reading(message, config)?;
                    if self.speed_frame.is_none() {
                        self.speed_frame = frame.filter(|f| !f.is_empty());
                    }
                    self.speed_mps.push((at_ns, speed_mps));
                    self.across_mps.extend(across_mps);
                    self.poses.extend(pose.map(|pose| (at_ns, pose)));
                    if let Some([roll, pitch, yaw]) = rates {
                        self.yaw_rate.push((at_ns, yaw));
                        self.tilt_rates.push((at_ns, [roll, pitch]));
                    }
                }
                TopicRole::Steering => {
                    self.steering_rad.push((at_ns, steering(message)?));
                }
                TopicRole::Can => {
                    let frame: Frame = message.decode()?;
                    let values = can.read(&frame, at_ns);
                    self.speed_mps.extend(values.speed_mps);
                    self.steering_rad.extend(values.steering_rad);
                }
                TopicRole::Truth => {
                    let odometry: Odometry = message.decode()?;
                    let (p, q) = (odometry.pose.pose.position, odometry.pose.pose.orientation);
                    let place = Vector3::new(p.x, p.y, p.z);
                    let pose = Se3::from_quaternion([q.w, q.x, q.y, q.z], place);
                    self.truth.push((at_ns, pose));
                }
            }
        }
        if timed && has_header(message) && message.header_stamp().is_none() {
            let topic = message.topic().to_owned();
            *self.unstamped.entry(topic).or_default() += 1;
        }
        Ok(())
    }
}

/// Values with their times.
fn pairs(samples: Samples) -> Vec<(i64, f64)> {
    samples.ns.into_iter().zip(samples.values).collect()
}

/// A message's time of measurement, in nanoseconds: the stamp in its header, or the time of recording if it has no header or
/// the stamp is not set. Unset stamps would put all messages of a topic at the same time.
pub(super) fn stamp(message: &Message<'_>) -> i64 {
    let stamp = has_header(message).then(|| message.header_stamp());
    nanos(stamp.flatten().unwrap_or(message.time()))
}

/// Whether a message of a type that is read here begins with a header: all do except plain numbers and lists of transforms.
fn has_header(message: &Message<'_>) -> bool {
    let frames = message.is::<TFMessage>() || message.is::<OldTFMessage>();
    !frames && !message.is::<Float32>() && !message.is::<Float64>()
}

pub(super) fn nanos(time: Time) -> i64 {
    i64::try_from(time.nanos()).unwrap_or(i64::MAX)
}
