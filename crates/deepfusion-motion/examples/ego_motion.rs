//! How accurately a vehicle's own sensors measure its motion, on real recordings:
//!
//! ```text
//! cargo run --release -p deepfusion-motion --example ego_motion -- comma SEGMENT VEHICLE.toml
//! cargo run --release -p deepfusion-motion --example ego_motion -- kitti DRIVE [FRAMES]
//! ```
//!
//! `VEHICLE.toml` is a [`MotionConfig`]; some are in this folder.

#[path = "../tests/support/mod.rs"]
mod support;

use deepfusion_hint::Hint;
use deepfusion_motion::comma::CommaSegment;
use deepfusion_motion::{
    FusedTrack, IdentifyConfig, MotionConfig, OffsetConfig, VehicleRates, identify, time_offset,
};
use std::path::Path;
use support::{Truth, halves, kitti, rows, speed_scale, windows};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["comma", segment, vehicle] => comma(Path::new(segment), Path::new(vehicle)),
        ["kitti", drive] => kitti_drive(Path::new(drive), usize::MAX),
        ["kitti", drive, frames] => kitti_drive(Path::new(drive), frames.parse()?),
        _ => Err("usage: ego_motion comma SEGMENT VEHICLE.toml | kitti DRIVE [FRAMES]".into()),
    }
}

fn comma(folder: &Path, vehicle: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let mut config: MotionConfig = toml::from_str(&std::fs::read_to_string(vehicle)?)?;
    let segment = CommaSegment::open(folder)?;
    let track = FusedTrack::new(&segment.sensors, &config)?;
    let truths = windows(&segment.reference, 10.0, 0.1);
    table(&track, &truths);
    if let (Some(steering), Some(imu)) = (&segment.sensors.steering_rad, track.imu()) {
        println!("{} standstills", imu.standstills().len());
        let known = IdentifyConfig {
            wheelbase_m: config.bicycle.map(|b| b.wheelbase_m),
            ..IdentifyConfig::default()
        };
        match identify(&segment.sensors.speed_mps, steering, imu.yaw_rate(), &known) {
            Ok(found) => println!("steering ratio {:?}", found.steering_ratio),
            Err(error) => println!(
                "steering ratio: {error}; {}",
                error.hint().unwrap_or_default()
            ),
        }
    }
    // The tyres' scale comes from the first half's positions and is tested on the second half.
    let (first, second) = halves(&segment.reference);
    config.speed_scale = speed_scale(&segment.sensors.speed_mps, &first);
    println!(
        "speed scale of the first half {:.4}; second half with it:",
        config.speed_scale
    );
    table(
        &FusedTrack::new(&segment.sensors, &config)?,
        &windows(&second, 10.0, 0.1),
    );
    Ok(())
}

fn table(track: &FusedTrack, truths: &[Truth]) {
    let mean = truths.iter().map(|t| t.distance_m).sum::<f64>() / truths.len() as f64;
    println!("{} windows of 10 s, {mean:.1} m each", truths.len());
    println!("| | distance, mean abs. (m) | (%) | bias (%) | yaw, mean abs. (deg) | bias (deg) |");
    println!("|---|---|---|---|---|---|");
    for (name, errors) in rows(track, truths) {
        println!(
            "| {name} | {:.3} | {:.2} | {:+.2} | {:.3} | {:+.3} |",
            errors.distance_m,
            100.0 * errors.distance_m / mean,
            100.0 * errors.distance_bias,
            errors.yaw_rad.to_degrees(),
            errors.yaw_bias_rad.to_degrees(),
        );
    }
}

fn kitti_drive(drive: &Path, frames: usize) -> Result<(), Box<dyn std::error::Error>> {
    let all = kitti::packets(drive);
    let packets = &all[..frames.min(all.len())];
    let track = kitti::track(packets);
    let (from, to) = (packets[0].time_s, packets[packets.len() - 1].time_s);
    let motion = track.motion(from, to).ok_or("oxts has a gap")?;
    let turned = packets[packets.len() - 1].heading_rad() - packets[0].heading_rad();
    let turned = turned.sin().atan2(turned.cos());
    println!("{} packets, {:.1} s", packets.len(), to - from);
    println!("∫vf dt {:.2} m", motion.distance_m);
    for step in [1, 5, 10] {
        let length = kitti::path_length_m(packets, step);
        let off = 100.0 * (motion.distance_m / length - 1.0);
        println!("GPS path through every {step}. position {length:.2} m: ∫vf {off:+.2} %");
    }
    println!(
        "∫wz dt {:.3} rad, heading {turned:.3} rad (modulo 2π)",
        motion.yaw_rad
    );
    let fused = FusedTrack::new(&kitti::sensors(packets), &MotionConfig::default())?;
    if let Some(parts) = fused.parts(from, to) {
        println!(
            "over the whole drive, from the initial speed alone: IMU {:.2?} m",
            parts.imu_distance_m
        );
    }
    let pictures = kitti::image_motion(drive);
    let vehicle = FusedTrack::new(&kitti::sensors(&all), &MotionConfig::default())?;
    match time_offset(
        &pictures,
        &VehicleRates::from(&vehicle),
        &OffsetConfig::default(),
    ) {
        Ok(offset) => println!("clock offset {offset:.4?}"),
        Err(error) => println!("{error}; {}", error.hint().unwrap_or_default()),
    }
    Ok(())
}
