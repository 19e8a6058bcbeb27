//! The bags on which reading is measured, and reading them: for the bench, and for the example that `rosbags_read.py` runs.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a benchmark that cannot run may panic"
)]

use deepfusion_rosbag::msg::{
    Float64, Header, Image, Imu, PointCloud2, Quaternion, RosMessage, Vector3,
};
use deepfusion_rosbag::{Bag, BagWriter, Compression, Result, Selection, Time, WriterOptions};
use std::borrow::Cow;
use std::hint::black_box;
use std::path::Path;

/// Name, compression, whether it holds small messages or pictures and clouds, how many.
pub(crate) const RECORDINGS: [(&str, Compression, bool, u32); 3] = [
    ("small_none.bag", Compression::None, true, 200_000),
    ("large_lz4.bag", Compression::Lz4, false, 240),
    ("large_bz2.bag", Compression::Bz2, false, 24),
];

/// Numbers that look random and are the same on every machine.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn header(i: u32, frame: &str) -> Header {
    let stamp = Time::from_nanos(1_700_000_000_000_000_000 + 5_000_000 * u64::from(i));
    Header {
        seq: i,
        stamp,
        frame_id: frame.to_owned(),
    }
}

fn imu(i: u32, noise: &mut Noise) -> Imu {
    let mut vector = || Vector3 {
        x: noise.unit(),
        y: noise.unit(),
        z: noise.unit(),
    };
    Imu {
        header: header(i, "imu_link"),
        orientation: Quaternion {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            w: 1.0,
        },
        orientation_covariance: [0.01; 9],
        angular_velocity: vector(),
        angular_velocity_covariance: [0.02; 9],
        linear_acceleration: vector(),
        linear_acceleration_covariance: [0.03; 9],
    }
}

/// 640×480, a gradient with sensor noise in the low bits.
fn image(i: u32, noise: &mut Noise) -> Image<'static> {
    let pixel = |k: u32| {
        let (x, y) = (k / 3 % 640, k / 1920);
        ((x + y + i) / 5) as u8 ^ (noise.next() & noise.next() & 3) as u8
    };
    Image {
        header: header(i, "camera"),
        height: 480,
        width: 640,
        encoding: "rgb8".to_owned(),
        is_bigendian: 0,
        step: 1920,
        data: Cow::Owned((0..921_600).map(pixel).collect()),
    }
}

/// 30,000 points in centimetres, with a velocity.
fn cloud(i: u32, noise: &mut Noise) -> PointCloud2<'static> {
    let mut column = |scale: f64| {
        let number = |_| (noise.unit() * scale * 100.0).round() as f32 / 100.0;
        (0..30_000).map(number).collect::<Vec<f32>>()
    };
    let (x, y, z, velocity) = (column(80.0), column(40.0), column(4.0), column(1.0));
    let columns: [(&str, &[f32]); 4] = [("x", &x), ("y", &y), ("z", &z), ("velocity", &velocity)];
    PointCloud2::from_columns(header(i, "lidar"), &columns).expect("the columns have one length")
}

/// Writes one of [`RECORDINGS`].
pub(crate) fn write(
    path: &Path,
    compression: Compression,
    small: bool,
    messages: u32,
) -> Result<()> {
    let mut noise = Noise(0x9e37_79b9_7f4a_7c15);
    let mut bag = BagWriter::create(
        path,
        WriterOptions {
            compression,
            ..WriterOptions::default()
        },
    )?;
    let time = |i: u32| Time::from_nanos(1_700_000_000_000_000_000 + 5_000_000 * u64::from(i));
    if small {
        let imus = bag.add_connection::<Imu>("/imu/data")?;
        let speeds = bag.add_connection::<Float64>("/vehicle/speed")?;
        for i in 0..messages / 2 {
            bag.write(imus, time(i), &imu(i, &mut noise))?;
            bag.write(speeds, time(i), &Float64 { data: noise.unit() })?;
        }
    } else {
        let images = bag.add_connection::<Image>("/camera/image_raw")?;
        let clouds = bag.add_connection::<PointCloud2>("/lidar/points")?;
        for i in 0..messages / 2 {
            bag.write(images, time(i), &image(i, &mut noise))?;
            bag.write(clouds, time(i), &cloud(i, &mut noise))?;
        }
    }
    bag.finish()
}

/// Opens a bag and decodes every message as its type. Returns the number of messages and their bytes.
pub(crate) fn read(path: &Path) -> Result<(u64, u64)> {
    let bag = Bag::open(path)?;
    let (mut count, mut bytes) = (0, 0);
    for message in bag.messages(Selection::all())? {
        let message = message?;
        match message.connection().type_name.as_str() {
            Imu::TYPE => drop(black_box(message.decode::<Imu>()?)),
            Float64::TYPE => _ = black_box(message.decode::<Float64>()?),
            Image::TYPE => drop(black_box(message.decode::<Image>()?)),
            PointCloud2::TYPE => drop(black_box(message.decode::<PointCloud2>()?)),
            other => unreachable!("{other} is not written above"),
        }
        count += 1;
        bytes += message.data().len() as u64;
    }
    Ok((count, bytes))
}
