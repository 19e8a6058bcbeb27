//! A recording with every message type, made of formulas: what the writer's tests write.

use crate::common::Lines;
use deepfusion_rosbag::msg::*;
use deepfusion_rosbag::{BagWriter, Compression, ConnectionId, Time, WriterOptions};
use serde::Serialize;
use std::borrow::Cow;
use std::path::Path;

/// A message as it was handed to the writer.
#[derive(Serialize)]
pub(crate) struct Written {
    topic: &'static str,
    time: u64,
    values: Vec<String>,
}

struct Recorder {
    bag: BagWriter,
    written: Vec<Written>,
}

impl Recorder {
    fn connect<T: RosMessage<'static>>(
        &mut self,
        topic: &'static str,
    ) -> (ConnectionId, &'static str) {
        (self.bag.add_connection::<T>(topic).unwrap(), topic)
    }

    fn write<T: RosMessage<'static> + Lines>(
        &mut self,
        to: (ConnectionId, &'static str),
        nanos: u64,
        message: &T,
    ) {
        let time = Time::from_nanos(1_700_000_000_000_000_000 + nanos);
        self.bag.write(to.0, time, message).unwrap();
        let mut values = Vec::new();
        message.lines("", &mut values);
        self.written.push(Written {
            topic: to.1,
            time: time.nanos(),
            values,
        });
    }
}

/// Writes the recording; what it holds, in the order of writing.
pub(crate) fn write(path: &Path, compression: Compression) -> Vec<Written> {
    let options = WriterOptions {
        compression,
        chunk_bytes: 4000,
    };
    let bag = BagWriter::create(path, options).unwrap();
    let mut r = Recorder {
        bag,
        written: Vec::new(),
    };
    let float32 = r.connect::<Float32>("/float32");
    let float64 = r.connect::<Float64>("/float64");
    let image = r.connect::<Image>("/camera/image_raw");
    let compressed = r.connect::<CompressedImage>("/camera/image_raw/compressed");
    let info = r.connect::<CameraInfo>("/camera/camera_info");
    let cloud = r.connect::<PointCloud2>("/lidar/points");
    let imu = r.connect::<Imu>("/imu/data");
    let fix = r.connect::<NavSatFix>("/fix");
    let twist = r.connect::<TwistStamped>("/vehicle/twist");
    let odometry = r.connect::<Odometry>("/odom");
    let ackermann = r.connect::<AckermannDriveStamped>("/vehicle/ackermann");
    let frame = r.connect::<Frame>("/can/frame");
    let again = r.connect::<Float32>("/float32");
    r.connect::<Imu>("/never/published");
    for i in 0..8_u32 {
        // Every other message is written late: chunks overlap. No two times are equal.
        let base = 100_000_000 * u64::from(if i % 2 == 0 { i + 2 } else { i });
        let header = |frame: &str| Header {
            seq: i,
            stamp: Time {
                sec: 1_700_000_000,
                nsec: 100_000_000 * i,
            },
            frame_id: frame.to_owned(),
        };
        let f = |k: u32| (f64::from(i * 100 + k) * 0.7).sin() * 10.0;
        let vector = |k| Vector3 {
            x: f(k),
            y: f(k + 1),
            z: f(k + 2),
        };
        let nine = |k| std::array::from_fn(|j| f(k + j as u32));
        let turn = Quaternion {
            x: 0.0,
            y: 0.0,
            z: (f(3) / 20.0).sin(),
            w: (f(3) / 20.0).cos(),
        };
        r.write(float32, base, &Float32 { data: f(1) as f32 });
        r.write(again, base + 1, &Float32 { data: f(2) as f32 });
        r.write(float64, base + 2, &Float64 { data: f(3) });
        r.write(
            image,
            base + 3,
            &Image {
                header: header("camera"),
                height: 6,
                width: 8,
                encoding: "rgb8".to_owned(),
                is_bigendian: 0,
                step: 24,
                data: (0..144).map(|k| (k * 7 + i) as u8).collect(),
            },
        );
        r.write(
            compressed,
            base + 4,
            &CompressedImage {
                header: header("camera"),
                format: "jpeg".to_owned(),
                data: Cow::Owned(vec![0xff, 0xd8, i as u8, 0xff, 0xd9]),
            },
        );
        r.write(
            info,
            base + 5,
            &CameraInfo {
                header: header("camera"),
                height: 480,
                width: 640,
                distortion_model: "plumb_bob".to_owned(),
                d: (0..i).map(f).collect(),
                k: [703.64, 0.0, 322.55, 0.0, 724.82, 117.6, 0.0, 0.0, 1.0],
                r: nine(20),
                p: std::array::from_fn(|j| f(j as u32)),
                binning_x: 1,
                binning_y: 0,
                roi: RegionOfInterest {
                    x_offset: 1,
                    y_offset: i,
                    height: 2,
                    width: 3,
                    do_rectify: i % 2 == 0,
                },
            },
        );
        let column = |k: u32| (0..10 + i).map(|p| f(k + p) as f32).collect::<Vec<_>>();
        let (x, y, z, velocity) = (column(0), column(10), column(20), column(30));
        let columns: [(&str, &[f32]); 4] =
            [("x", &x), ("y", &y), ("z", &z), ("velocity", &velocity)];
        r.write(
            cloud,
            base + 6,
            &PointCloud2::from_columns(header("lidar"), &columns).unwrap(),
        );
        r.write(
            imu,
            base + 7,
            &Imu {
                header: header("imu"),
                orientation: turn,
                orientation_covariance: nine(0),
                angular_velocity: vector(1),
                angular_velocity_covariance: nine(9),
                linear_acceleration: vector(4),
                linear_acceleration_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            },
        );
        r.write(
            fix,
            base + 8,
            &NavSatFix {
                header: header("gps"),
                status: NavSatStatus {
                    status: -1,
                    service: 9,
                },
                latitude: 49.01 + f(1) * 1e-6,
                longitude: 8.43,
                altitude: f64::NAN,
                position_covariance: nine(3),
                position_covariance_type: 2,
            },
        );
        let speed = Twist {
            linear: vector(2),
            angular: vector(6),
        };
        r.write(
            twist,
            base + 9,
            &TwistStamped {
                header: header("base_link"),
                twist: speed,
            },
        );
        let six = |k: u32| std::array::from_fn(|j| f(k + j as u32));
        let position = Point {
            x: f(1),
            y: f(2),
            z: f(3),
        };
        r.write(
            odometry,
            base + 10,
            &Odometry {
                header: header("odom"),
                child_frame_id: "base_link".to_owned(),
                pose: PoseWithCovariance {
                    pose: Pose {
                        position,
                        orientation: turn,
                    },
                    covariance: six(1),
                },
                twist: TwistWithCovariance {
                    twist: speed,
                    covariance: six(40),
                },
            },
        );
        let drive = AckermannDrive {
            steering_angle: f(1) as f32 / 20.0,
            steering_angle_velocity: 0.0,
            speed: f(2) as f32,
            acceleration: f(3) as f32,
            jerk: f32::MIN_POSITIVE,
        };
        r.write(
            ackermann,
            base + 11,
            &AckermannDriveStamped {
                header: header("größe"),
                drive,
            },
        );
        r.write(
            frame,
            base + 12,
            &Frame {
                header: header("can0"),
                id: 0x1abc_def0 + i,
                is_rtr: false,
                is_extended: true,
                is_error: i == 7,
                dlc: 8,
                data: std::array::from_fn(|j| (i * 31) as u8 ^ j as u8),
            },
        );
    }
    r.bag.finish().unwrap();
    r.written
}
