use super::parts::{
    Converted, SIMULATED, at_ns, check_not_stopped, moving_at, points, seconds_to_move,
};
use crate::{Dataset, Error, GtKind, ImageProblem, MotionModel, Result, TopicProblem};
use deepfusion_geometry::Se3;
use deepfusion_rosbag::msg::{
    CameraInfo, CompressedImage, Header, PointCloud2, Twist, TwistStamped, Vector3,
};
use deepfusion_rosbag::{BagWriter, Compression, ConnectionId, Time, WriterOptions};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;
use std::borrow::Cow;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::Path;

/// Number of frames read and written together.
const BATCH: usize = 8;

/// Writes a data set as a ROS 1 bag: PNG images, CameraInfo, speed and yaw rate (TwistStamped) and, if the data set has depth, point
/// clouds at the camera's position. A file beside the bag has the sensors' mounts, and whether the recording is simulated. The times of all
/// sensors are on the vehicle's clock.
///
/// `progress` is called with the number of frames done and the total. [`ControlFlow::Break`] stops the conversion, unless all frames are
/// done. After an error or a stop, neither file exists.
///
/// # Errors
/// [`Error::Exists`] if `out` exists; [`Error::NoTimes`] if a frame has no time; [`Error::Stopped`];
/// [`Error::Bag`]; and the errors of reading the data set.
pub fn convert_to_bag(
    dataset: &Dataset,
    out: &Path,
    compression: Compression,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<Converted> {
    let sidecar = out.with_extension("toml");
    for path in [out, &sidecar] {
        if path.exists() {
            return Err(Error::Exists {
                path: path.to_owned(),
            });
        }
    }
    let moved_s = seconds_to_move(std::slice::from_ref(dataset));
    // Shifted times are never below 0.
    let time = |time_s: f64| Time::from_nanos(at_ns(dataset, time_s, moved_s).max(0) as u64);
    let mut times = Vec::with_capacity(dataset.frames().len());
    for frame in dataset.frames() {
        let time_s = frame.time_s.ok_or_else(|| Error::NoTimes {
            drive: dataset.name().to_owned(),
            frame: frame.number,
        })?;
        times.push(time_s);
    }
    let options = WriterOptions {
        compression,
        ..WriterOptions::default()
    };
    let mut bag = BagWriter::create(out, options)?;
    let image_topic = bag.add_connection::<CompressedImage<'_>>("/camera/image_rect/compressed")?;
    let info_topic = bag.add_connection::<CameraInfo>("/camera/camera_info")?;
    let speed_topic = match dataset.track() {
        Some(_) => Some(bag.add_connection::<TwistStamped>("/vehicle/speed")?),
        None => None,
    };
    let has_depth = (0..times.len()).any(|frame| dataset.has_ground_truth(frame, GtKind::Z));
    let cloud_topic = if has_depth {
        Some(bag.add_connection::<PointCloud2<'_>>("/lidar/points")?)
    } else {
        None
    };
    if let Some(topic) = speed_topic {
        write_speeds(dataset, &mut bag, topic, time)?;
    }
    let frames: Vec<usize> = (0..times.len()).collect();
    let mut done = 0;
    for batch in frames.chunks(BATCH) {
        let read = batch.par_iter().map(|&frame| {
            Ok(Picture {
                png: png(dataset, frame)?,
                points: points(dataset, frame)?,
            })
        });
        let read: Vec<Picture> = read.collect::<Result<_>>()?;
        for (&frame, Picture { png, points }) in batch.iter().zip(&read) {
            let stamp = time(times[frame]);
            let header = |frame_id| header(stamp, frame, frame_id);
            let image = CompressedImage {
                header: header("camera"),
                format: "png".into(),
                data: Cow::Borrowed(png),
            };
            bag.write(image_topic, stamp, &image)?;
            bag.write(info_topic, stamp, &camera_info(dataset, header("camera")))?;
            if let (Some(topic), Some(points)) = (cloud_topic, points) {
                bag.write(topic, stamp, &cloud(header("lidar"), points, out)?)?;
            }
        }
        done += batch.len();
        check_not_stopped(progress(done, times.len()), done, times.len())?;
    }
    super::parts::write_text(&sidecar, &describe(dataset))?;
    if let Err(error) = bag.finish() {
        // Best effort: without its bag, the file would block the next attempt. If the bag exists, only syncing has failed.
        if !out.exists() {
            let _ = std::fs::remove_file(&sidecar);
        }
        return Err(error.into());
    }
    Ok(Converted {
        paths: vec![out.to_owned()],
        moved_s,
    })
}

/// Writes speed and yaw rate at each time of the vehicle's track; `time` converts a time of the recording to one of the bag.
fn write_speeds(
    dataset: &Dataset,
    bag: &mut BagWriter,
    topic: ConnectionId,
    time: impl Fn(f64) -> Time,
) -> Result<()> {
    let times_s = dataset.track().map(MotionModel::times_s);
    for (seq, &time_s) in times_s.unwrap_or_default().iter().enumerate() {
        let Some(moving) = moving_at(dataset, time_s) else {
            continue;
        };
        let [x, y, z] = moving.rates_radps;
        let along = |x| Vector3 {
            x,
            ..Vector3::default()
        };
        let message = TwistStamped {
            header: header(time(time_s), seq, "vehicle"),
            twist: Twist {
                linear: along(moving.speed_mps),
                angular: Vector3 { x, y, z },
            },
        };
        bag.write(topic, time(time_s), &message)?;
    }
    Ok(())
}

/// A point cloud message; `out` is the path named in errors.
fn cloud(header: Header, points: &[[f32; 3]], out: &Path) -> Result<PointCloud2<'static>> {
    let column = |axis: usize| -> Vec<f32> { points.iter().map(|p| p[axis]).collect() };
    let (x, y, z) = (column(0), column(1), column(2));
    let columns: [(&str, &[f32]); 3] = [("x", &x), ("y", &y), ("z", &z)];
    PointCloud2::from_columns(header, &columns).map_err(|e| Error::Topic {
        path: out.to_owned(),
        problem: Box::new(TopicProblem::Cloud(e)),
        choice: None,
    })
}

/// A frame's contents.
struct Picture {
    png: Vec<u8>,
    points: Option<Vec<[f32; 3]>>,
}

fn header(stamp: Time, seq: usize, frame_id: &str) -> Header {
    Header {
        seq: seq as u32,
        stamp,
        frame_id: frame_id.to_owned(),
    }
}

fn png(dataset: &Dataset, frame: usize) -> Result<Vec<u8>> {
    let image = dataset.load_image(frame)?;
    let mut bytes = Vec::new();
    let (width, height) = image.dimensions();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Sub);
    encoder
        .write_image(image.as_raw(), width, height, ExtendedColorType::Rgb8)
        .map_err(|e| Error::Image {
            path: dataset.frames()[frame].image.path().to_owned(),
            problem: ImageProblem::Unencodable(e),
        })?;
    Ok(bytes)
}

fn camera_info(dataset: &Dataset, header: Header) -> CameraInfo {
    let k = dataset.intrinsics(0);
    CameraInfo::pinhole(header, [k.fx, k.fy, k.cx, k.cy], (k.width, k.height))
}

fn describe(dataset: &Dataset) -> String {
    let mut text = String::from(
        "# Where the sensors of the bag beside this file are: target_from_source, metres and an axis-angle vector.\n",
    );
    if let Some(scenario) = dataset.scenario() {
        let _ = writeln!(text, "scenario = {scenario:?}");
    }
    if dataset.is_simulated() {
        text += SIMULATED;
    }
    let mut add = |name: &str, pose: &Se3| {
        let three = |v: nalgebra::Vector3<f64>| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
        let (t, r) = (three(pose.translation()), three(pose.axis_angle()));
        let _ = writeln!(text, "\n[{name}]\ntranslation = {t}\nrotation = {r}");
    };
    add("cam_from_lidar", &Se3::cam_from_body_axes());
    // An assumed mount is left out: the bag's reader assumes the same, with a warning.
    if let Some(pose) = dataset
        .cam_from_vehicle()
        .filter(|_| !dataset.mount_assumed())
    {
        add("cam_from_vehicle", &pose);
    }
    text
}
