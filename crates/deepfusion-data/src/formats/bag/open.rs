//! Opens bags as data sets: topics, then one pass over them, then the camera, the vehicle's motion and the scans.

use super::config::BagConfig;
use super::dynamic::DynamicPoints;
use super::index::{Index, MessageRef};
use super::mounts::Mounts;
use super::packet::VideoTopic;
use super::recording::BagRecording;
use super::scans::BagScans;
use super::streams::{damage_of, oddities_of, streams};
use super::topics::Topics;
use super::video::BagVideo;
use super::{camera, image, sensors, source};
use crate::logs::clock::{on_the_vehicles_clock, seconds};
use crate::logs::frame_times::numbers_by_time;
use crate::logs::speed_log::receiver;
use crate::{
    Camera, CameraWarning, DataWarning, Dataset, DatasetParts, Error, Frame, FrameImage,
    IncompleteWarning, MotionModel, MountWarning, NoFramesReason, OpenOptions, Result, TopicRole,
};
use deepfusion_geometry::{StampedPose, Trajectory};
use deepfusion_rosbag::MessageSource;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Opens each bag as a data set.
///
/// # Errors
/// Those of [`Dataset::open`].
pub(crate) fn open(path: &Path, bags: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let (mut datasets, mut without_camera) = (Vec::<Dataset>::new(), Vec::new());
    let mut refused = None;
    for bag in bags {
        let opened = open_bag(source::open(bag)?, options);
        match opened.and_then(|dataset| dataset.select(path, options)) {
            Ok(dataset) => datasets.push(dataset),
            Err(error @ Error::SplitSelectsNothing { .. }) => refused = Some(error),
            // Each computer of the vehicle may have recorded its own bag, so the others may have images.
            Err(error @ Error::NoFrames { .. }) => {
                without_camera.push(source::name(bag));
                refused = refused.or(Some(error));
            }
            Err(other) => return Err(other),
        }
    }
    match (datasets.first_mut(), refused) {
        (None, Some(error)) => Err(error),
        (Some(first), _) if !without_camera.is_empty() => {
            first.warn(IncompleteWarning::NoImages {
                camera: None,
                recordings: without_camera,
            });
            Ok(datasets)
        }
        _ => Ok(datasets),
    }
}

/// Opens a recording of messages as a data set, with the settings of the file beside it.
///
/// # Errors
/// Those of [`Dataset::open`].
pub(crate) fn open_bag(bag: Arc<dyn MessageSource>, options: &OpenOptions) -> Result<Dataset> {
    let path = bag.path();
    let config = BagConfig::of(path, options)?;
    let topics = Topics::find(bag.as_ref(), &config)?;
    let index = Index::read(bag.as_ref(), &topics, &config)?;
    let first = first_image(bag.as_ref(), &index)?;
    let clock = Clock::from_image(&first, &config, options);
    let damage = damage_of(bag.as_ref(), &index);
    let mut warnings = damage.clone();
    warnings.extend(oddities_of(&topics, &index));

    let video = BagVideo::of(path, &index, &config)?;
    let picture = match &video {
        Some(video) => video.first(bag.as_ref())?,
        None => {
            let topic = topics.of(TopicRole::Image).unwrap_or_default();
            image::decode(bag.as_ref(), &image::message(bag.as_ref(), topic, &first)?)?
        }
    };
    let size = picture.dimensions();
    let (lens, calibration, assumed) =
        camera::find(bag.as_ref(), &topics, &index, size, &config, options)?;
    if assumed {
        let k = lens.intrinsics();
        warnings.push(CameraWarning::Assumed { fx: k.fx, fy: k.fy }.into());
    }
    let implausible = lens.intrinsics().implausible();
    warnings.extend(implausible.map(|why| DataWarning::from(CameraWarning::from(why))));
    let mounts = Mounts::find(path, &config, &index, &mut warnings)?;
    let (cam_from_vehicle, mount_assumed) = (mounts.cam_from_vehicle, mounts.camera_assumed);
    let imu = mounts.vehicle_from_imu.as_ref();
    let motion = sensors::motion(path, &index, &config, imu, clock.origin_ns)?;
    let yaw_known = motion.as_ref().is_some_and(|m| m.yaw_known);
    let track = motion.map(|m| m.track);

    let simulated = config.simulated.unwrap_or(topics.simulated);
    let name = source::name(path);
    let parts = DatasetParts {
        name: name.clone(),
        split_name: name.clone(),
        camera: Camera::Left,
        frames: frames(path, &name, &clock.timed(&index.images), track.as_ref()),
        intrinsics: lens.intrinsics(),
        cam_from_vehicle: Some(cam_from_vehicle),
        track: track.clone(),
        yaw_known,
        origin_ns: Some(clock.origin_ns),
        camera_ahead_s: clock.camera_ahead_s,
        scenario: config.scenario.clone(),
    };
    let scans = match (topics.of(TopicRole::Lidar), mounts.cam_from_lidar) {
        (Some(topic), Some(cam_from_lidar)) => Some(Arc::new(BagScans {
            bag: Arc::clone(&bag),
            topic: topic.to_owned(),
            places: clock.timed(&index.scans),
            dynamic: topics.of(TopicRole::Dynamic).map(|topic| DynamicPoints {
                topic: topic.to_owned(),
                places: clock.timed(&index.dynamic),
            }),
            lidar: config.lidar.clone(),
            within_s: config.clock.scan_within_s,
            cam_from_lidar,
            cam_from_vehicle,
            intrinsics: lens.intrinsics(),
            track,
        })),
        (Some(_), None) => {
            warnings.push(MountWarning::LidarUnknown.into());
            None
        }
        _ => None,
    };
    let receiver = receiver(
        index.course_rates_radps.as_ref(),
        index.sigmas_mps.as_ref(),
        clock.origin_ns,
    );
    let recording = BagRecording {
        streams: streams(bag.as_ref(), &topics, &index)?,
        folder: if path.is_dir() {
            path.to_owned()
        } else {
            path.parent().unwrap_or(path).to_owned()
        },
        bag: Arc::clone(&bag),
        topics,
        truth: truth(&index, clock.origin_ns),
        images: index.images,
        video,
        lens,
        mounts: mounts.known,
        damage,
        warnings,
        cam_from_vehicle,
        scans,
        calibration,
    };
    let dataset = Dataset::new(parts, Arc::new(recording));
    Ok(dataset
        .with_receiver(receiver)
        .with_camera_assumed(assumed)
        .with_mount_assumed(mount_assumed)
        .with_simulated(simulated))
}

/// The first image, at which the data set's time begins.
fn first_image(bag: &dyn MessageSource, index: &Index) -> Result<MessageRef> {
    if let Some(first) = index.images.first() {
        return Ok(*first);
    }
    if let Some(VideoTopic {
        name: topic,
        before,
        ..
    }) = &index.video
    {
        return Err(Error::NoFrames {
            path: bag.path().to_owned(),
            reason: NoFramesReason::NoKeyFrame {
                topic: topic.clone(),
                messages: *before,
            },
        });
    }
    let topics = bag.topics()?.into_iter().map(|t| t.name).collect();
    Err(Error::NoFrames {
        path: bag.path().to_owned(),
        reason: NoFramesReason::NoImageTopic { topics },
    })
}

/// The data set's clock: the vehicle's, counted from the first image. Camera and LiDAR have their own clock, which is ahead of it.
struct Clock {
    origin_ns: i64,
    camera_ahead_s: f64,
}

impl Clock {
    fn from_image(first: &MessageRef, config: &BagConfig, options: &OpenOptions) -> Self {
        let given = options.camera_ahead_s;
        let camera_ahead_s = given.unwrap_or(config.clock.camera_ahead_s);
        Self {
            origin_ns: on_the_vehicles_clock(first.stamp_ns, camera_ahead_s),
            camera_ahead_s,
        }
    }

    /// Messages of camera or LiDAR, each with its time in seconds.
    fn timed(&self, places: &[MessageRef]) -> Vec<(MessageRef, f64)> {
        let time_s = |place: &MessageRef| {
            let ns = on_the_vehicles_clock(place.stamp_ns, self.camera_ahead_s);
            seconds(ns, self.origin_ns)
        };
        places.iter().map(|place| (*place, time_s(place))).collect()
    }
}

/// The frames. In a pause, as many numbers are left out as frames are missing, so that the frames on both sides are not neighbours.
fn frames(
    path: &Path,
    drive: &str,
    images: &[(MessageRef, f64)],
    track: Option<&MotionModel>,
) -> Vec<Frame> {
    let stamps: Vec<i64> = images.iter().map(|(place, _)| place.stamp_ns).collect();
    let numbers = numbers_by_time(&stamps);
    let times_s = images.iter().map(|(_, time_s)| *time_s);
    let frame = |((index, number), time_s)| Frame {
        drive: drive.to_owned(),
        number,
        time_s: Some(time_s),
        image: FrameImage::Within {
            file: path.to_owned(),
            index,
        },
        speed_mps: track.and_then(|t| t.speed_at(time_s)),
    };
    (0..).zip(numbers).zip(times_s).map(frame).collect()
}

/// The vehicle's exact poses in a simulated drive, on the vehicle's clock.
fn truth(index: &Index, origin_ns: i64) -> Trajectory {
    let poses = index.truth.iter().map(|(ns, pose)| StampedPose {
        time_s: (ns - origin_ns) as f64 * 1e-9,
        world_from_body: *pose,
    });
    Trajectory::new(poses.collect())
}
