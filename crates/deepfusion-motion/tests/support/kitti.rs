//! A KITTI raw drive, as far as needed for motion.

use deepfusion_motion::{
    GreyFrame, ImageMotion, ImuSample, Signal, VehicleSensors, VehicleTrack, image_motions,
};
use nalgebra::Vector3;
use std::fs;
use std::path::Path;

/// One OXTS packet: time in seconds of the day, and its 30 numbers (`oxts/dataformat.txt`).
pub(crate) struct Packet {
    pub time_s: f64,
    values: Vec<f64>,
}

impl Packet {
    /// East and north in metres, by Mercator's projection at the drive's latitude, as in KITTI's own tools.
    pub(crate) fn place(&self, latitude_deg: f64) -> [f64; 2] {
        const RADIUS: f64 = 6_378_137.0;
        let scale = latitude_deg.to_radians().cos();
        let (lat, lon) = (self.values[0], self.values[1]);
        let north = (0.25 * std::f64::consts::PI + 0.5 * lat.to_radians())
            .tan()
            .ln();
        [scale * RADIUS * lon.to_radians(), scale * RADIUS * north]
    }

    pub(crate) fn latitude_deg(&self) -> f64 {
        self.values[0]
    }

    pub(crate) fn heading_rad(&self) -> f64 {
        self.values[5]
    }
}

/// Seconds of the day for every line of a time stamp file.
fn times(path: &Path) -> Vec<f64> {
    let text = fs::read_to_string(path).unwrap();
    let seconds = |line: &str| {
        let clock = line.split_whitespace().nth(1)?;
        let parts: Vec<f64> = clock.split(':').filter_map(|p| p.parse().ok()).collect();
        Some(3600.0 * parts[0] + 60.0 * parts[1] + parts[2])
    };
    text.lines().filter_map(seconds).collect()
}

/// The packets of a drive.
pub(crate) fn packets(drive: &Path) -> Vec<Packet> {
    let times = times(&drive.join("oxts/timestamps.txt"));
    let read = |(i, time_s): (usize, &f64)| {
        let path = drive.join(format!("oxts/data/{i:010}.txt"));
        let text = fs::read_to_string(path).ok()?;
        let values = text
            .split_whitespace()
            .map(|w| w.parse().unwrap())
            .collect();
        Some(Packet {
            time_s: *time_s,
            values,
        })
    };
    times.iter().enumerate().filter_map(read).collect()
}

/// Forward speed `vf` and yaw rate `wz` as one track.
pub(crate) fn track(packets: &[Packet]) -> VehicleTrack {
    let sample = |p: &Packet| (p.time_s, p.values[8], p.values[19]);
    VehicleTrack::new(&packets.iter().map(sample).collect::<Vec<_>>())
}

/// `vf` as the vehicle's speed, `ax`… and `wx`… as an inertial unit.
pub(crate) fn sensors(packets: &[Packet]) -> VehicleSensors {
    let three = |p: &Packet, i: usize| Vector3::new(p.values[i], p.values[i + 1], p.values[i + 2]);
    let imu = packets.iter().map(|p| ImuSample {
        time_s: p.time_s,
        acceleration_mps2: three(p, 11),
        angular_rate_radps: three(p, 17),
    });
    VehicleSensors {
        speed_mps: Signal::new(packets.iter().map(|p| (p.time_s, p.values[8]))),
        steering_rad: None,
        imu: Some(imu.collect()),
    }
}

/// Length of the path through every `step`-th position, in metres.
pub(crate) fn path_length_m(packets: &[Packet], step: usize) -> f64 {
    let latitude = packets[0].latitude_deg();
    let mut places: Vec<[f64; 2]> = packets
        .iter()
        .step_by(step)
        .map(|p| p.place(latitude))
        .collect();
    let last = packets[packets.len() - 1].place(latitude);
    if !(packets.len() - 1).is_multiple_of(step) {
        places.push(last);
    }
    let step = |w: &[[f64; 2]]| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]);
    places.windows(2).map(step).sum()
}

/// The image motion of camera 2, at 160×48.
pub(crate) fn image_motion(drive: &Path) -> Vec<ImageMotion> {
    let times = times(&drive.join("image_02/timestamps.txt"));
    let frame = |(i, time_s): (usize, &f64)| {
        let path = drive.join(format!("image_02/data/{i:010}.jpg"));
        let grey = image::open(path).ok()?.to_luma8();
        let small = image::imageops::thumbnail(&grey, 160, 48);
        Some(GreyFrame::from_bytes(*time_s, 160, 48, small.as_raw()).unwrap())
    };
    let frames: Vec<GreyFrame> = times.iter().enumerate().filter_map(frame).collect();
    image_motions(&frames, 0.1)
}
