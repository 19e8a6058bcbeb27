//! Opens a comma2k19 segment: `processed_log` and `global_pose` as NumPy arrays without a file extension, and `video.hevc`.

use super::shared::files::name_of;
use super::shared::plain::PlainParts;
use super::video::frames_of;
use crate::camera::{Pictures, find_camera};
use crate::dataset_toml::FolderConfig;
use crate::logs::clock::{on_the_vehicles_clock, seconds};
use crate::logs::frame_times::{TimedImage, numbers_by_time};
use crate::logs::samples::Samples;
use crate::logs::speed_log::SpeedLog;
use crate::logs::vehicle_log::VehicleLog;
use crate::{
    Camera, DataWarning, Dataset, DatasetKind, DriveInspection, Error, Inspection, MissingPart,
    MotionWarning, OpenOptions, Result, SegmentProblem, SpeedRange, Stream, TimesWarning,
};
use deepfusion_motion::{ImuMount, comma};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const VIDEO: &str = "video.hevc";
const SPEED: &str = "processed_log/CAN/speed";
const FRAME_TIMES: &str = "global_pose/frame_times";

/// Streams other than the images: their folder, which contains `t`, and their kind.
const STREAMS: [(&str, &str); 5] = [
    (SPEED, "speed"),
    ("processed_log/CAN/wheel_speed", "speed"),
    ("processed_log/CAN/steering_angle", "steering"),
    ("processed_log/IMU/accelerometer", "imu"),
    ("processed_log/IMU/gyro", "imu"),
];

/// Whether a folder is a segment.
pub(crate) fn is_segment(folder: &Path) -> bool {
    folder.join(SPEED).join("t").is_file() || folder.join(FRAME_TIMES).is_file()
}

/// Whether a segment has its video.
pub(crate) fn has_video(folder: &Path) -> bool {
    folder.join(VIDEO).is_file()
}

/// Opens a segment.
pub(crate) fn open(folder: &Path, options: &OpenOptions) -> Result<Dataset> {
    if !has_video(folder) {
        return Err(Error::NoSegmentVideo {
            path: folder.join(VIDEO),
        });
    }
    let config = FolderConfig::read(folder)?;
    let mut warnings = Vec::new();
    let video = frames_of(&folder.join(VIDEO), &config, &mut warnings)?;
    let calibration = find_camera(
        folder,
        &config,
        options,
        video.size(),
        DatasetKind::Comma2k19,
        Pictures::Images(&[]),
        &mut warnings,
    )?;
    let times = frame_times(folder)?;
    if times.len() != video.count() {
        let other_count = TimesWarning::OtherCount {
            list: FRAME_TIMES,
            times: times.len(),
            video: VIDEO,
            frames: video.count(),
        };
        warnings.push(other_count.into());
    }
    let numbers = numbers_by_time(&times);
    let images = numbers.into_iter().zip(&times).take(video.count());
    let image = |(number, ns): (u64, &i64)| TimedImage {
        number,
        path: video.file().to_owned(),
        ns: Some(*ns),
    };
    let mut streams = streams(folder)?;
    // The stream of speeds is added with the speeds.
    streams.retain(|s| s.name != SPEED);
    PlainParts {
        kind: DatasetKind::Comma2k19,
        folder: folder.to_owned(),
        name: name_of(folder),
        images: images.map(image).collect(),
        image_size: video.size(),
        video: Some(video),
        calibration,
        camera_ahead_s: config.camera_ahead_s(options),
        mount_assumed: config.mount.is_none(),
        speeds: speeds(folder, &config)?,
        cam_from_vehicle: config.cam_from_vehicle(),
        camera: Camera::Left,
        truth: None,
        world_from_cam: BTreeMap::new(),
        streams,
        warnings,
        untimed_poses: false,
    }
    .into_dataset()
    .map(|dataset| dataset.with_simulated(config.simulated))
}

/// Inspects a segment without its video.
pub(crate) fn inspect(folder: &Path, options: &OpenOptions) -> Result<Inspection> {
    let config = FolderConfig::read(folder)?;
    let camera_ahead_s = config.camera_ahead_s(options);
    let times: Vec<i64> = frame_times(folder)?
        .into_iter()
        .map(|ns| on_the_vehicles_clock(ns, camera_ahead_s))
        .collect();
    let speeds = speeds(folder, &config)?;
    let origin = times.first().copied().unwrap_or_default();
    let motion = speeds.as_ref().map(|log| log.motion(origin));
    let (track, yaw_known) = match motion.transpose()? {
        Some((track, yaw_known)) => (Some(track), yaw_known),
        None => (None, false),
    };
    let at: Vec<f64> = times.iter().map(|t| seconds(*t, origin)).collect();
    let at_frames = at.iter().filter_map(|t| track.as_ref()?.speed_at(*t));
    let speed_mps = SpeedRange::of(at_frames);
    let ends = at.first().zip(at.last());
    let (mut distance_m, mut turn_rad) = (None, None);
    for pair in at.windows(2) {
        if let Some(motion) = track.as_ref().and_then(|t| t.motion(pair[0], pair[1])) {
            *distance_m.get_or_insert(0.0) += motion.distance_m.abs();
            if yaw_known {
                *turn_rad.get_or_insert(0.0) += motion.yaw_rad;
            }
        }
    }
    let duration_s = ends.map(|(first, last)| last - first);
    let mut streams = streams(folder)?;
    streams.push(Stream::new(FRAME_TIMES, "pose", at.len(), &at));
    Ok(Inspection {
        kind: DatasetKind::Comma2k19,
        frames: 0,
        size: None,
        intrinsics: None,
        streams,
        speed_mps,
        distance_m,
        duration_s,
        drives: vec![DriveInspection {
            mounts: Vec::new(),
            name: name_of(folder),
            camera: crate::Camera::Left.number(),
            frames: 0,
            missing_frames: Vec::new(),
            usable_pairs: 0,
            why_no_pairs: Some(format!("{VIDEO} is missing, so the segment has no images")),
            scans: 0,
            speed_mps,
            distance_m,
            turn_rad,
            duration_s,
            camera_ahead_s,
            time_offset: None,
            warnings: Vec::new(),
        }],
        unreadable: Vec::new(),
    })
}

/// The times of the frames, on the logs' clock, in nanoseconds.
fn frame_times(folder: &Path) -> Result<Vec<i64>> {
    match folder.join(FRAME_TIMES) {
        path if path.is_file() => nanoseconds(&path),
        path => Err(Error::Missing {
            path,
            part: MissingPart::SegmentTimes,
        }),
    }
}

fn speeds(folder: &Path, config: &FolderConfig) -> Result<Option<SpeedLog>> {
    let place = folder.join(SPEED);
    if !place.join("t").is_file() {
        return Ok(None);
    }
    let ns = nanoseconds(&place.join("t"))?;
    let path = place.join("value");
    let values = column(&path)?;
    if values.len() != ns.len() {
        let problem = SegmentProblem::Length {
            values: values.len(),
            times: ns.len(),
        };
        return Err(array_error(&path, problem));
    }
    if let Some(row) = values.iter().position(|v| !v.is_finite()) {
        let value = values[row];
        return Err(array_error(&path, SegmentProblem::NotASpeed { row, value }));
    }
    let origin = ns.first().copied().unwrap_or_default();
    let at: Vec<f64> = ns.iter().map(|t| seconds(*t, origin)).collect();
    let values = values.iter().map(|v| v * config.speed_scale()).collect();
    let vehicle = vehicle(folder, config)?;
    let warnings = match &vehicle {
        Some(_) => Vec::new(),
        None => vec![DataWarning::from(MotionWarning::SegmentWithoutTurns)],
    };
    Ok(Some(SpeedLog {
        vehicle,
        path,
        streams: vec![Stream::new(SPEED, "speed", at.len(), &at)],
        speeds_mps: Samples { ns, values },
        yaw_rates_radps: None,
        course_rates_radps: None,
        sigmas_mps: None,
        tilts_rad: Vec::new(),
        warnings,
    }))
}

/// The segment's inertial unit, and its steering angle if `dataset.toml` has the vehicle's wheelbase.
fn vehicle(folder: &Path, config: &FolderConfig) -> Result<Option<VehicleLog>> {
    let sensors = comma::sensors(folder).map_err(|source| Error::Motion {
        path: folder.to_owned(),
        source,
    })?;
    let config = config.motion(ImuMount::forward_right_down());
    let ns = |time_s: f64| (time_s * 1e9).round() as i64;
    let imu = sensors.imu.unwrap_or_default().into_iter();
    let imu: Vec<_> = imu.map(|sample| (ns(sample.time_s), sample)).collect();
    let steering = sensors.steering_rad.filter(|_| config.bicycle.is_some());
    let steering_rad = steering.map(|signal| Samples {
        ns: signal.times_s().iter().map(|t| ns(*t)).collect(),
        values: signal.values().to_vec(),
    });
    let known = !imu.is_empty() || steering_rad.is_some();
    Ok(known.then_some(VehicleLog {
        imu,
        steering_rad,
        config,
    }))
}

fn streams(folder: &Path) -> Result<Vec<Stream>> {
    let mut streams = Vec::new();
    for (name, kind) in STREAMS {
        let path = folder.join(name).join("t");
        if path.is_file() {
            let times = column(&path)?;
            streams.push(Stream::new(name, kind, times.len(), &times));
        }
    }
    Ok(streams)
}

/// The times in an array of seconds, which must not decrease, in nanoseconds.
fn nanoseconds(path: &Path) -> Result<Vec<i64>> {
    let times = column(path)?;
    let mut last = f64::NEG_INFINITY;
    for (row, time) in times.iter().enumerate() {
        if !time.is_finite() || time.abs() > 9e9 || *time < last {
            let problem = SegmentProblem::NotATime {
                row,
                time_s: *time,
                last_s: last,
            };
            return Err(array_error(path, problem));
        }
        last = *time;
    }
    Ok(times.iter().map(|t| (t * 1e9).round() as i64).collect())
}

/// The numbers of an array with the shape N or N×1.
fn column(path: &Path) -> Result<Vec<f64>> {
    comma::numbers(path).map_err(|error| match error {
        deepfusion_motion::Error::ArrayFile(error) => Error::File(error),
        deepfusion_motion::Error::Array { path, problem } => {
            array_error(&path, SegmentProblem::Array(problem))
        }
        source => Error::Motion {
            path: path.to_owned(),
            source,
        },
    })
}

fn array_error(path: &Path, problem: SegmentProblem) -> Error {
    Error::Columns {
        path: PathBuf::from(path),
        problem: problem.into(),
    }
}
