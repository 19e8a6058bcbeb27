//! Writes a drive as a bag with UMAD's sensors.

use crate::files::{encode_depth, encode_rgb, io, require_empty};
use crate::fmcw::{self, SCAN_RATE_HZ};
use crate::rig::Rig;
use crate::{Error, ExpectedSetting, Result, Simulation};
use deepfusion_fs::PartialFolder;
use deepfusion_rosbag::msg::{
    AckermannDrive, AckermannDriveStamped, CameraInfo, CompressedImage, Header, Imu, Odometry,
    Point, PointCloud2, Pose, PoseWithCovariance, Quaternion, Twist, TwistStamped,
    TwistWithCovariance, Vector3,
};
use deepfusion_rosbag::{BagWriter, Compression, ConnectionId, Time, WriterOptions};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Noon of the first of January 2026, UTC, in nanoseconds since 1970: time 0 of every drive.
const EPOCH_NS: i64 = 1_767_268_800_000_000_000;

/// A point is dynamic if its speed over ground along its ray exceeds this, m/s.
const DYNAMIC_MPS: f32 = 0.5;

/// Frames rendered and encoded together.
const BATCH: usize = 8;

/// The topics written.
pub mod topic {
    /// `sensor_msgs/CompressedImage`, PNG.
    pub const IMAGE: &str = "/camera/image_rect/compressed";
    /// `sensor_msgs/CameraInfo`.
    pub const CAMERA_INFO: &str = "/camera/camera_info";
    /// `sensor_msgs/PointCloud2`: x, y, z, intensity, velocity (receding is positive).
    pub const LIDAR: &str = "/lidar/points";
    /// `sensor_msgs/PointCloud2` of the dynamic points.
    pub const DYNAMIC: &str = "/lidar/dynamic_points";
    /// `sensor_msgs/Imu`.
    pub const IMU: &str = "/imu/data";
    /// `geometry_msgs/TwistStamped`.
    pub const SPEED: &str = "/vehicle/speed";
    /// `ackermann_msgs/AckermannDriveStamped`: the road wheels' angle.
    pub const STEERING: &str = "/vehicle/steering";
    /// `nav_msgs/Odometry`: the exact pose of the vehicle, for evaluation.
    pub const TRUTH: &str = "/truth/odometry";
    /// `sensor_msgs/CompressedImage`, 16-bit PNG, metres × 256: the exact depth, for evaluation.
    pub const TRUE_DEPTH: &str = "/truth/depth/compressed";
}

/// Settings of a bag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BagSettings {
    /// Compression of the bag's chunks.
    pub compression: Compression,
    /// Added to the stamps of camera and LiDAR, whose clock is not the vehicle's, in seconds.
    pub clock_offset_s: f64,
    /// Whether the exact depth of every frame is also written.
    pub true_depth: bool,
    /// Angle between two columns of the LiDAR, degrees: 0.05 to 5. Fewer columns make a bag smaller and quicker to write.
    pub lidar_step_deg: f64,
}

impl Default for BagSettings {
    fn default() -> Self {
        Self {
            compression: Compression::Lz4,
            clock_offset_s: 0.0,
            true_depth: true,
            lidar_step_deg: f64::from(fmcw::COLUMN_STEP_DEG),
        }
    }
}

/// Writes the drive as `out/<scene>_<seed>.bag` and, beside it, `<scene>_<seed>.toml` with the mounts of the sensors
/// and the vehicle's wheelbase, which a bag does not contain; for a varied drive also `<scene>_<seed>.varied.json` with what it drew
/// ([`Simulation::drawn`]). `out` must be new or empty. Returns the bag's path.
///
/// The stamps of camera and LiDAR include [`BagSettings::clock_offset_s`]; those of IMU, speed, steering and truth do not.
///
/// `progress` is called with the number of frames done and the number of all frames. Until all are done, it can stop the writer with
/// [`ControlFlow::Break`]. Everything is written to a temporary folder within `out` and moved at the end, the bag last: after an error or a
/// stop, `out` is as it was. Files that a killed writer left there are removed first.
///
/// # Errors
/// [`Error::Config`] for a setting out of range, or a second camera; [`Error::OutputNotEmpty`] if `out` contains anything;
/// [`Error::Unfinished`] if another writer is at work there, or left files that cannot be removed; [`Error::Stopped`]; [`Error::Io`],
/// [`Error::Encode`], [`Error::Bag`].
pub fn write_bag(
    simulation: &Simulation,
    out: &Path,
    settings: &BagSettings,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<PathBuf> {
    let config = simulation.config();
    if config.stereo_baseline_m > 0.0 {
        return Err(Error::Config {
            field: "stereo_baseline_m",
            value: config.stereo_baseline_m.to_string(),
            expected: ExpectedSetting::OneCamera,
        });
    }
    if !(0.05..=5.0).contains(&settings.lidar_step_deg) {
        return Err(Error::Config {
            field: "lidar_step_deg",
            value: settings.lidar_step_deg.to_string(),
            expected: ExpectedSetting::Degrees {
                from: 0.05,
                to: 5.0,
            },
        });
    }
    let scene = config.scene.name();
    let path = out.join(format!("{scene}_{:04}.bag", config.seed));
    require_empty(out)?;
    let partial = PartialFolder::beside(&path).map_err(io(out, "make this folder"))?;
    let names = write_all(simulation, partial.path(), &path, settings, progress)
        .map_err(|error| error.moved(partial.path(), out))?;
    let moved = partial.commit_files(&names);
    moved.map_err(io(&path, "move the finished bag here"))?;
    Ok(path)
}

/// Writes the bag and the files beside it into `folder`; their final place is that of `path`. Returns their names, the bag's last.
fn write_all(
    simulation: &Simulation,
    folder: &Path,
    path: &Path,
    settings: &BagSettings,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<Vec<OsString>> {
    let name = Path::new(path.file_name().unwrap_or_default());
    let scene = simulation.config().scene.name();
    let mut beside = vec![("toml", describe(&simulation.rig(), scene))];
    if let Some(drawn) = simulation.drawn() {
        beside.push(("varied.json", drawn.to_json()));
    }
    let mut names = Vec::new();
    for (ending, text) in beside {
        let name = name.with_extension(ending);
        let file = folder.join(&name);
        fs::write(&file, text).map_err(io(&file, "write this file"))?;
        names.push(name.into_os_string());
    }
    write_messages(simulation, &folder.join(name), settings, progress)?;
    names.push(name.as_os_str().to_owned());
    Ok(names)
}

/// The bag's connections.
struct Topics {
    image: ConnectionId,
    camera_info: ConnectionId,
    lidar: ConnectionId,
    dynamic: ConnectionId,
    imu: ConnectionId,
    speed: ConnectionId,
    steering: ConnectionId,
    truth: ConnectionId,
    true_depth: Option<ConnectionId>,
}

fn write_messages(
    simulation: &Simulation,
    path: &Path,
    settings: &BagSettings,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<()> {
    let options = WriterOptions {
        compression: settings.compression,
        ..WriterOptions::default()
    };
    let mut bag = BagWriter::create(path, options)?;
    let topics = Topics {
        image: bag.add_connection::<CompressedImage<'_>>(topic::IMAGE)?,
        camera_info: bag.add_connection::<CameraInfo>(topic::CAMERA_INFO)?,
        lidar: bag.add_connection::<PointCloud2<'_>>(topic::LIDAR)?,
        dynamic: bag.add_connection::<PointCloud2<'_>>(topic::DYNAMIC)?,
        imu: bag.add_connection::<Imu>(topic::IMU)?,
        speed: bag.add_connection::<TwistStamped>(topic::SPEED)?,
        steering: bag.add_connection::<AckermannDriveStamped>(topic::STEERING)?,
        truth: bag.add_connection::<Odometry>(topic::TRUTH)?,
        true_depth: if settings.true_depth {
            Some(bag.add_connection::<CompressedImage<'_>>(topic::TRUE_DEPTH)?)
        } else {
            None
        },
    };
    let frames = simulation.frames();
    let mut vehicle = VehicleMessages::new(simulation);
    let mut scans = 0;
    for first in (0..frames).step_by(BATCH) {
        let last = (first + BATCH).min(frames);
        let until_s = if last == frames {
            f64::INFINITY
        } else {
            simulation.time_s(last)
        };
        // Readings first: readers sort by time, so the order within a chunk does not matter.
        vehicle.write(&mut bag, &topics, until_s)?;
        let pictures: Vec<Picture> = (first..last)
            .into_par_iter()
            .map(|frame| Picture::render(simulation, frame, settings.true_depth))
            .collect::<Result<_>>()?;
        for picture in &pictures {
            picture.write(&mut bag, &topics, simulation, settings.clock_offset_s)?;
        }
        let end_s = simulation.time_s(frames - 1);
        while f64::from(scans) / SCAN_RATE_HZ < until_s.min(end_s + 1e-9) {
            let time_s = f64::from(scans) / SCAN_RATE_HZ;
            write_scan(simulation, &mut bag, &topics, (time_s, scans), settings)?;
            scans += 1;
        }
        if progress(last, frames).is_break() && last < frames {
            return Err(Error::Stopped {
                done: last,
                total: frames,
            });
        }
    }
    bag.finish()?;
    Ok(())
}

fn time(seconds: f64) -> Time {
    let nanos = EPOCH_NS + (seconds * 1e9).round() as i64;
    Time::from_nanos(u64::try_from(nanos).unwrap_or_default())
}

fn header(time_s: f64, index: usize, frame_id: &str) -> Header {
    Header {
        seq: index as u32,
        stamp: time(time_s),
        frame_id: frame_id.to_owned(),
    }
}

/// One frame's messages.
struct Picture {
    frame: usize,
    png: Vec<u8>,
    depth: Option<Vec<u8>>,
}

impl Picture {
    fn render(simulation: &Simulation, frame: usize, with_depth: bool) -> Result<Self> {
        let picture = simulation.frame(frame);
        let name = Path::new("frame");
        let mut png = Vec::new();
        encode_rgb(&mut png, name, &picture.rgb)?;
        let depth = with_depth.then(|| {
            let mut bytes = Vec::new();
            encode_depth(&mut bytes, name, &picture.depth).map(|()| bytes)
        });
        Ok(Self {
            frame,
            png,
            depth: depth.transpose()?,
        })
    }

    fn write(
        &self,
        bag: &mut BagWriter,
        topics: &Topics,
        simulation: &Simulation,
        offset_s: f64,
    ) -> Result<()> {
        let exact_s = simulation.time_s(self.frame);
        let stamp = time(exact_s + offset_s);
        let header = |frame_id| header(exact_s + offset_s, self.frame, frame_id);
        let image = CompressedImage {
            header: header("camera"),
            format: "png".into(),
            data: Cow::Borrowed(&self.png),
        };
        bag.write(topics.image, stamp, &image)?;
        let info = camera_info(simulation, header("camera"));
        bag.write(topics.camera_info, stamp, &info)?;
        if let (Some(connection), Some(depth)) = (topics.true_depth, &self.depth) {
            let depth = CompressedImage {
                header: header("camera"),
                format: "16UC1; png, metres x 256".into(),
                data: Cow::Borrowed(depth),
            };
            bag.write(connection, stamp, &depth)?;
        }
        let odometry = odometry(simulation, self.frame);
        bag.write(topics.truth, time(exact_s), &odometry)?;
        Ok(())
    }
}

fn camera_info(simulation: &Simulation, header: Header) -> CameraInfo {
    let k = simulation.intrinsics();
    CameraInfo::pinhole(header, [k.fx, k.fy, k.cx, k.cy], (k.width, k.height))
}

fn odometry(simulation: &Simulation, frame: usize) -> Odometry {
    let world_from_vehicle = simulation.world_from_imu(frame);
    let place = world_from_vehicle.translation();
    let [w, x, y, z] = world_from_vehicle.quaternion();
    Odometry {
        header: header(simulation.time_s(frame), frame, "world"),
        child_frame_id: "vehicle".into(),
        pose: PoseWithCovariance {
            pose: Pose {
                position: Point {
                    x: place.x,
                    y: place.y,
                    z: place.z,
                },
                orientation: Quaternion { x, y, z, w },
            },
            covariance: [0.0; 36],
        },
        twist: TwistWithCovariance {
            twist: Twist {
                linear: Vector3 {
                    x: simulation.oxts(frame).forward_speed(),
                    ..Vector3::default()
                },
                ..Twist::default()
            },
            covariance: [0.0; 36],
        },
    }
}

fn write_scan(
    simulation: &Simulation,
    bag: &mut BagWriter,
    topics: &Topics,
    (time_s, index): (f64, u32),
    settings: &BagSettings,
) -> Result<()> {
    let scan = simulation.fmcw_with_columns(time_s, settings.lidar_step_deg as f32);
    let moving = |i: &usize| scan.ground_radial_mps[*i].abs() > DYNAMIC_MPS;
    let all: Vec<usize> = (0..scan.cloud.len()).collect();
    let dynamic: Vec<usize> = all.iter().copied().filter(moving).collect();
    let stamp_s = time_s + settings.clock_offset_s;
    for (connection, points) in [(topics.lidar, all), (topics.dynamic, dynamic)] {
        let column =
            |axis: usize| -> Vec<f32> { points.iter().map(|i| scan.cloud.xyz[*i][axis]).collect() };
        let picked = |column: &Option<Vec<f32>>| -> Vec<f32> {
            let column = column.as_deref().unwrap_or_default();
            points.iter().map(|i| column[*i]).collect()
        };
        let (x, y, z) = (column(0), column(1), column(2));
        let intensity = picked(&scan.cloud.intensity);
        let velocity = picked(&scan.cloud.radial_velocity);
        let cloud = PointCloud2::from_columns(
            header(stamp_s, index as usize, "lidar"),
            &[
                ("x", &x),
                ("y", &y),
                ("z", &z),
                ("intensity", &intensity),
                ("velocity", &velocity),
            ],
        );
        let cloud = cloud.map_err(|problem| Error::Message {
            topic: topic::LIDAR,
            problem,
        })?;
        bag.write(connection, time(stamp_s), &cloud)?;
    }
    Ok(())
}

/// Readings of the vehicle that are not written yet.
struct VehicleMessages {
    imu: std::iter::Peekable<std::vec::IntoIter<crate::ImuReading>>,
    speed: std::iter::Peekable<std::vec::IntoIter<crate::SpeedReading>>,
    steering: std::iter::Peekable<std::vec::IntoIter<crate::SteeringReading>>,
    written: [usize; 3],
}

impl VehicleMessages {
    fn new(simulation: &Simulation) -> Self {
        Self {
            imu: simulation.imu_readings().into_iter().peekable(),
            speed: simulation.speed_readings().into_iter().peekable(),
            steering: simulation.steering_readings().into_iter().peekable(),
            written: [0; 3],
        }
    }

    /// Writes the readings before `until_s`.
    fn write(&mut self, bag: &mut BagWriter, topics: &Topics, until_s: f64) -> Result<()> {
        let [imus, speeds, steerings] = &mut self.written;
        while let Some(reading) = self.imu.next_if(|r| r.time_s < until_s) {
            let vector = |v: nalgebra::Vector3<f64>| Vector3 {
                x: v.x,
                y: v.y,
                z: v.z,
            };
            // −1 as the first element means that there is no orientation.
            let mut no_orientation = [0.0; 9];
            no_orientation[0] = -1.0;
            let imu = Imu {
                header: header(reading.time_s, *imus, "imu"),
                orientation: Quaternion::default(),
                orientation_covariance: no_orientation,
                angular_velocity: vector(reading.angular_rate),
                angular_velocity_covariance: [0.0; 9],
                linear_acceleration: vector(reading.acceleration),
                linear_acceleration_covariance: [0.0; 9],
            };
            bag.write(topics.imu, time(reading.time_s), &imu)?;
            *imus += 1;
        }
        while let Some(reading) = self.speed.next_if(|r| r.time_s < until_s) {
            let twist = TwistStamped {
                header: header(reading.time_s, *speeds, "vehicle"),
                twist: Twist {
                    linear: Vector3 {
                        x: reading.speed_mps,
                        ..Vector3::default()
                    },
                    ..Twist::default()
                },
            };
            bag.write(topics.speed, time(reading.time_s), &twist)?;
            *speeds += 1;
        }
        while let Some(reading) = self.steering.next_if(|r| r.time_s < until_s) {
            let drive = AckermannDriveStamped {
                header: header(reading.time_s, *steerings, "vehicle"),
                drive: AckermannDrive {
                    steering_angle: reading.angle_rad as f32,
                    ..AckermannDrive::default()
                },
            };
            bag.write(topics.steering, time(reading.time_s), &drive)?;
            *steerings += 1;
        }
        Ok(())
    }
}

/// The sidecar: what a reader cannot know from the bag.
fn describe(rig: &Rig, scenario: &str) -> String {
    let mut text = String::from(
        "# What the bag beside this file does not contain: the mounts of the sensors, and the wheelbase.\n\
         # Transforms are target_from_source: metres, and an axis-angle vector in radians.\n",
    );
    let _ = writeln!(text, "scenario = \"{scenario}\"\nsimulated = true\n");
    let transforms = [
        ("cam_from_lidar", rig.cam_from_velo()),
        ("cam_from_vehicle", rig.cam_from_imu()),
        ("vehicle_from_imu", rig.head_imu_from_imu.inverse()),
    ];
    let three = |v: nalgebra::Vector3<f64>| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    for (name, pose) in transforms {
        let (translation, rotation) = (three(pose.translation()), three(pose.axis_angle()));
        let _ = writeln!(
            text,
            "[{name}]\ntranslation = {translation}\nrotation = {rotation}\n"
        );
    }
    let wheelbase = crate::WHEELBASE_M;
    let _ = writeln!(text, "[vehicle]\nwheelbase_m = {wheelbase:?}\n");
    text += "[lidar]\nvelocity_field = \"velocity\"\nreceding = \"positive\"\n";
    text
}
