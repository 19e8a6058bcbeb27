//! A small bag with grey images and the messages that a test needs.

use deepfusion_rosbag::msg::{
    AckermannDriveStamped, CameraInfo, Float32, Frame, Header, Image, Imu, NavSatFix, NavSatStatus,
    Odometry, PointCloud2, Pose, PoseWithCovariance, Quaternion, RegionOfInterest, TFMessage,
    Transform, TransformStamped, Twist, TwistStamped, TwistWithCovariance,
    TwistWithCovarianceStamped, Vector3,
};
use deepfusion_rosbag::{BagWriter, RosMessage, Time, WriterOptions};
use std::borrow::Cow;
use std::path::Path;

/// Messages of each stream, 40 ms apart.
const COUNT: u32 = 25;
/// Size of the images, as in [`CAMERA`].
const SIZE: (u32, u32) = (64, 48);

/// A camera for the images.
pub(crate) const CAMERA: &str =
    "camera = { fx = 60.0, fy = 60.0, cx = 32.0, cy = 24.0, width = 64, height = 48 }\n";

/// A bag being written, with the number of its streams, and whether and with which frame the next stream's headers have a time.
pub(crate) struct TinyBag(BagWriter, u32, bool, String);

/// Each stream begins this long after the previous one, because only one of two values at the same time would be read.
const SHIFT_NS: u32 = 3_000_000;

impl TinyBag {
    /// A bag with images on the topic `image`.
    pub(crate) fn new(path: &Path, image: &str) -> Self {
        let mut bag = Self(
            BagWriter::create(path, WriterOptions::default()).unwrap(),
            0,
            true,
            String::new(),
        );
        bag.images(image);
        bag
    }

    /// A bag without any message.
    pub(crate) fn empty(path: &Path) -> Self {
        let writer = BagWriter::create(path, WriterOptions::default()).unwrap();
        Self(writer, 0, true, String::new())
    }

    /// Adds images.
    pub(crate) fn images(&mut self, topic: &str) -> &mut Self {
        self.stream(topic, |header| Image {
            header,
            height: SIZE.1,
            width: SIZE.0,
            encoding: "mono8".into(),
            is_bigendian: 0,
            step: SIZE.0,
            data: Cow::Owned((0..SIZE.0 * SIZE.1).map(|at| (at * 7) as u8).collect()),
        })
    }

    /// Sets the frame of all following headers.
    pub(crate) fn within(&mut self, frame: &str) -> &mut Self {
        frame.clone_into(&mut self.3);
        self
    }

    /// Adds the images' CameraInfo with a focal length in pixels.
    pub(crate) fn camera_info(&mut self, topic: &str, focal: f64) -> &mut Self {
        self.stream(topic, |header| CameraInfo {
            header,
            width: SIZE.0,
            height: SIZE.1,
            distortion_model: String::new(),
            d: Vec::new(),
            k: [focal, 0.0, 31.5, 0.0, focal, 23.5, 0.0, 0.0, 1.0],
            r: [0.0; 9],
            p: [0.0; 12],
            binning_x: 0,
            binning_y: 0,
            roi: RegionOfInterest::default(),
        })
    }

    /// Adds scans of one point, 10 m along x.
    pub(crate) fn scans(&mut self, topic: &str) -> &mut Self {
        self.stream(topic, |header| {
            let columns: [(&str, &[f32]); 3] = [("x", &[10.0]), ("y", &[0.0]), ("z", &[0.0])];
            PointCloud2::from_columns(header, &columns).unwrap()
        })
    }

    /// Adds the same scans with the point's own time in a field `time`, in seconds after the header's.
    pub(crate) fn timed_scans(&mut self, topic: &str, after_s: f32) -> &mut Self {
        self.stream(topic, |header| {
            let columns: [(&str, &[f32]); 4] = [
                ("x", &[10.0]),
                ("y", &[0.0]),
                ("z", &[0.0]),
                ("time", &[after_s]),
            ];
            PointCloud2::from_columns(header, &columns).unwrap()
        })
    }

    /// Adds transforms: parent, child, the child's origin in the parent and its rotation as an axis-angle vector in radians; `at(i)` gives
    /// those of the `i`th message.
    pub(crate) fn transforms(
        &mut self,
        topic: &str,
        at: impl Fn(u32) -> Vec<(&'static str, &'static str, [f64; 3], [f64; 3])>,
    ) -> &mut Self {
        let count = std::cell::Cell::new(0_u32);
        self.stream(topic, |header| {
            let links = at(count.replace(count.get() + 1)).into_iter();
            let transforms = links.map(|(parent, child, [x, y, z], turn)| {
                let angle = turn.iter().map(|a| a * a).sum::<f64>().sqrt();
                let share = if angle > 0.0 {
                    (0.5 * angle).sin() / angle
                } else {
                    0.0
                };
                let [qx, qy, qz] = turn.map(|a| a * share);
                TransformStamped {
                    header: Header {
                        frame_id: parent.into(),
                        ..header.clone()
                    },
                    child_frame_id: child.into(),
                    transform: Transform {
                        translation: Vector3 { x, y, z },
                        rotation: Quaternion {
                            x: qx,
                            y: qy,
                            z: qz,
                            w: (0.5 * angle).cos(),
                        },
                    },
                }
            });
            TFMessage {
                transforms: transforms.collect(),
            }
        })
    }

    /// Adds GPS positions along the equator, moving east at a speed.
    pub(crate) fn fixes(&mut self, topic: &str, speed_mps: f64) -> &mut Self {
        let count = std::cell::Cell::new(0_u32);
        self.stream(topic, |header| {
            let time_s = 0.04 * f64::from(count.replace(count.get() + 1));
            NavSatFix {
                header,
                status: NavSatStatus {
                    status: 0,
                    service: 1,
                },
                latitude: 0.0,
                // A degree of longitude is 111,319.49 m there.
                longitude: 8.0 + speed_mps * time_s / 111_319.490_793,
                altitude: 0.0,
                position_covariance: [0.0; 9],
                position_covariance_type: 0,
            }
        })
    }

    pub(crate) fn twist_with_covariance(&mut self, topic: &str, speed_mps: f64) -> &mut Self {
        self.stream(topic, |header| {
            let mut twist = Twist::default();
            twist.linear.x = speed_mps;
            TwistWithCovarianceStamped {
                header,
                twist: TwistWithCovariance {
                    twist,
                    covariance: [0.0; 36],
                },
            }
        })
    }

    pub(crate) fn twist(&mut self, topic: &str, speed_mps: f64) -> &mut Self {
        self.turning_twist(topic, |_| (speed_mps, 0.0))
    }

    /// Adds a twist whose speed in m/s and yaw rate in rad/s are functions of the seconds since the bag's first image.
    pub(crate) fn turning_twist(
        &mut self,
        topic: &str,
        motion: impl Fn(f64) -> (f64, f64),
    ) -> &mut Self {
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

    /// Adds a GPS receiver's velocity, east (x) and north (y), with a constant speed, m/s, and a course in radians, counter-clockwise from
    /// east, as a function of the message's number.
    pub(crate) fn course_twist(
        &mut self,
        topic: &str,
        speed_mps: f64,
        course: impl Fn(u32) -> f64,
    ) -> &mut Self {
        let count = std::cell::Cell::new(0_u32);
        self.stream(topic, |header| {
            let mut twist = TwistStamped {
                header,
                ..TwistStamped::default()
            };
            let (sin, cos) = course(count.replace(count.get() + 1)).sin_cos();
            (twist.twist.linear.x, twist.twist.linear.y) = (speed_mps * cos, speed_mps * sin);
            twist
        })
    }

    /// Adds a twist with rates about all three axes, rad/s.
    pub(crate) fn tumbling_twist(
        &mut self,
        topic: &str,
        speed_mps: f64,
        [x, y, z]: [f64; 3],
    ) -> &mut Self {
        self.stream(topic, |header| {
            let mut twist = TwistStamped {
                header,
                ..TwistStamped::default()
            };
            twist.twist.linear.x = speed_mps;
            twist.twist.angular = Vector3 { x, y, z };
            twist
        })
    }

    /// Adds an inertial unit that lies flat and turns to the left, rad/s.
    pub(crate) fn imu(&mut self, topic: &str, yaw_rate: f64) -> &mut Self {
        self.imu_along_z(topic, yaw_rate, 9.81)
    }

    /// Adds an inertial unit that measures a rate about its z in rad/s, and an acceleration along it in m/s².
    pub(crate) fn imu_along_z(&mut self, topic: &str, rate: f64, acceleration: f64) -> &mut Self {
        let up = |z| Vector3 {
            z,
            ..Vector3::default()
        };
        self.stream(topic, |header| Imu {
            header,
            orientation: Quaternion::default(),
            orientation_covariance: [0.0; 9],
            angular_velocity: up(rate),
            angular_velocity_covariance: [0.0; 9],
            linear_acceleration: up(acceleration),
            linear_acceleration_covariance: [0.0; 9],
        })
    }

    /// Adds an inertial unit with a covariance of −1, which marks its angular rates as missing, whatever their values.
    pub(crate) fn accelerometer(&mut self, topic: &str) -> &mut Self {
        self.stream(topic, |header| {
            let mut no_rates = [0.0; 9];
            no_rates[0] = -1.0;
            let up = |z| Vector3 {
                z,
                ..Vector3::default()
            };
            Imu {
                header,
                orientation: Quaternion::default(),
                orientation_covariance: [0.0; 9],
                angular_velocity: up(0.3),
                angular_velocity_covariance: no_rates,
                linear_acceleration: up(9.81),
                linear_acceleration_covariance: [0.0; 9],
            }
        })
    }

    /// Leaves out the time in all following headers.
    pub(crate) fn without_stamps(&mut self) -> &mut Self {
        self.2 = false;
        self
    }

    /// Adds an odometry without a twist: on a circle to the left, starting along the world's x, at a speed (m/s) and a yaw rate (rad/s),
    /// with its heading rotated by an angle (radians) from the direction of travel.
    pub(crate) fn poses(
        &mut self,
        topic: &str,
        speed_mps: f64,
        yaw_rate: f64,
        turned_rad: f64,
    ) -> &mut Self {
        let count = std::cell::Cell::new(0_u32);
        self.stream(topic, |header| {
            let time_s = 0.04 * f64::from(count.replace(count.get() + 1));
            let (angle, radius) = (yaw_rate * time_s, speed_mps / yaw_rate);
            let (z, w) = (0.5 * (angle + turned_rad)).sin_cos();
            let mut pose = Pose::default();
            pose.position.x = radius * angle.sin();
            pose.position.y = radius * (1.0 - angle.cos());
            (pose.orientation.z, pose.orientation.w) = (z, w);
            Odometry {
                header,
                child_frame_id: "body".into(),
                pose: PoseWithCovariance {
                    pose,
                    covariance: [0.0; 36],
                },
                twist: TwistWithCovariance {
                    twist: Twist::default(),
                    covariance: [0.0; 36],
                },
            }
        })
    }

    pub(crate) fn odometry(&mut self, topic: &str, speed_mps: f64) -> &mut Self {
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

    pub(crate) fn ackermann(&mut self, topic: &str, speed_mps: f32, angle_rad: f32) -> &mut Self {
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

    pub(crate) fn float(&mut self, topic: &str, data: f32) -> &mut Self {
        self.stream(topic, |_| Float32 { data })
    }

    /// Adds CAN frames with one identifier, identical except for their time.
    pub(crate) fn can(&mut self, topic: &str, frame: &Frame) -> &mut Self {
        self.stream(topic, |header| Frame {
            header,
            ..frame.clone()
        })
    }

    pub(crate) fn finish(self) {
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
                frame_id: self.3.clone(),
                ..Header::default()
            };
            self.0.write(connection, stamp, &make(header)).unwrap();
        }
        self.1 += 1;
        self
    }
}
