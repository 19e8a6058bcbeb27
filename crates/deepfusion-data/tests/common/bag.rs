//! A small bag: grey pictures, and whatever a test's vehicle says.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]
#![allow(dead_code, reason = "each test binary uses a part of it")]

use deepfusion_rosbag::msg::{
    AckermannDriveStamped, Float32, Frame, Header, Image, Imu, Odometry, Pose, PoseWithCovariance,
    Quaternion, Twist, TwistStamped, TwistWithCovariance, Vector3,
};
use deepfusion_rosbag::{BagWriter, RosMessage, Time, WriterOptions};
use std::borrow::Cow;
use std::path::Path;

/// Messages of each stream, 40 ms apart.
const COUNT: u32 = 25;
/// The pictures' size: one that `[camera]` in [`CAMERA`] fits.
const SIZE: (u32, u32) = (64, 48);

/// A camera for the pictures.
pub const CAMERA: &str =
    "camera = { fx = 60.0, fy = 60.0, cx = 32.0, cy = 24.0, width = 64, height = 48 }\n";

/// A bag being written, how many streams it has, and whether the headers of the next have a time.
pub struct TinyBag(BagWriter, u32, bool);

/// Each stream begins this long after the one before: of two values at one time, only one would be read.
const SHIFT_NS: u32 = 3_000_000;

impl TinyBag {
    /// A bag with pictures on `image`.
    pub fn new(path: &Path, image: &str) -> Self {
        let mut bag = Self(
            BagWriter::create(path, WriterOptions::default()).unwrap(),
            0,
            true,
        );
        bag.stream(image, |header| Image {
            header,
            height: SIZE.1,
            width: SIZE.0,
            encoding: "mono8".into(),
            is_bigendian: 0,
            step: SIZE.0,
            data: Cow::Owned((0..SIZE.0 * SIZE.1).map(|at| (at * 7) as u8).collect()),
        });
        bag
    }

    pub fn twist(&mut self, topic: &str, speed_mps: f64) -> &mut Self {
        self.turning_twist(topic, |_| (speed_mps, 0.0))
    }

    /// Speed in m/s and yaw rate in rad/s by seconds from the bag's first picture.
    pub fn turning_twist(&mut self, topic: &str, motion: impl Fn(f64) -> (f64, f64)) -> &mut Self {
        let shift_s = 1e-9 * f64::from(self.1 * SHIFT_NS);
        let count = std::cell::Cell::new(0_u32);
        self.stream(topic, |header| {
            let mut twist = TwistStamped {
                header,
                ..TwistStamped::default()
            };
            let i = count.replace(count.get() + 1);
            let (speed_mps, yaw_rate) = motion(0.04 * f64::from(i) + shift_s);
            (twist.twist.linear.x, twist.twist.angular.z) = (speed_mps, yaw_rate);
            twist
        })
    }

    /// An inertial unit that lies flat and turns to the left, rad/s.
    pub fn imu(&mut self, topic: &str, yaw_rate: f64) -> &mut Self {
        let up = |z| Vector3 {
            z,
            ..Vector3::default()
        };
        self.stream(topic, |header| Imu {
            header,
            orientation: Quaternion::default(),
            orientation_covariance: [0.0; 9],
            angular_velocity: up(yaw_rate),
            angular_velocity_covariance: [0.0; 9],
            linear_acceleration: up(9.81),
            linear_acceleration_covariance: [0.0; 9],
        })
    }

    /// From here on no header says when its message was measured.
    pub fn without_stamps(&mut self) -> &mut Self {
        self.2 = false;
        self
    }

    pub fn odometry(&mut self, topic: &str, speed_mps: f64) -> &mut Self {
        self.stream(topic, |header| {
            let twist = Twist {
                linear: Vector3 {
                    x: speed_mps,
                    ..Vector3::default()
                },
                ..Twist::default()
            };
            Odometry {
                header,
                child_frame_id: "base_link".into(),
                pose: PoseWithCovariance {
                    pose: Pose::default(),
                    covariance: [0.0; 36],
                },
                twist: TwistWithCovariance {
                    twist,
                    covariance: [0.0; 36],
                },
            }
        })
    }

    pub fn ackermann(&mut self, topic: &str, speed_mps: f32, angle_rad: f32) -> &mut Self {
        self.stream(topic, |header| {
            let mut drive = AckermannDriveStamped {
                header,
                ..AckermannDriveStamped::default()
            };
            drive.drive.speed = speed_mps;
            drive.drive.steering_angle = angle_rad;
            drive
        })
    }

    pub fn float(&mut self, topic: &str, data: f32) -> &mut Self {
        self.stream(topic, |_| Float32 { data })
    }

    /// Frames of one identifier, all alike but for their time.
    pub fn can(&mut self, topic: &str, frame: &Frame) -> &mut Self {
        self.stream(topic, |header| Frame {
            header,
            ..frame.clone()
        })
    }

    pub fn finish(self) {
        self.0.finish().unwrap();
    }

    fn stream<'m, M: RosMessage<'m>>(
        &mut self,
        topic: &str,
        make: impl Fn(Header) -> M,
    ) -> &mut Self {
        let connection = self.0.add_connection::<M>(topic).unwrap();
        for i in 0..COUNT {
            let stamp = Time {
                sec: 1_700_000_000,
                nsec: i * 40_000_000 + self.1 * SHIFT_NS,
            };
            let header = Header {
                stamp: if self.2 { stamp } else { Time::from_nanos(0) },
                ..Header::default()
            };
            self.0.write(connection, stamp, &make(header)).unwrap();
        }
        self.1 += 1;
        self
    }
}
