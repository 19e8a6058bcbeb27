//! Writes a drive in the layout of KITTI's raw recordings.

use crate::files::{
    encode, encode_depth, encode_rgb, io, make_folder, require_empty, write_file, write_with,
};
use crate::oxts::DATA_FORMAT;
use crate::rig::CAM2_FROM_CAM0_X;
use crate::{Error, Result, SimFrame, Simulation, tracklets};
use deepfusion_fs::PartialFolder;
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Se3, kitti_line, scientific};
use image::ExtendedColorType;
use image::codecs::png::FilterType;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Date of every simulated drive.
const DATE: &str = "2026_01_01";

/// Frames rendered and encoded together.
const BATCH: usize = 8;

/// Writes the whole drive below `out`, which must be new or empty, and returns the drive's folder.
///
/// Below `out/2026_01_01` are the three calibration files and `2026_01_01_drive_<seed>_sync` with
///
/// - `image_02` (PNG), and with a second camera ([`crate::SimConfig::stereo_baseline_m`]) `image_03`;
/// - `oxts`; `velodyne_points` of every [`crate::SimConfig::scan_every`]-th frame;
/// - `proj_depth/groundtruth/image_02`: dense exact camera z, 16-bit PNG, metres × 256, 0 beyond 255 m;
/// - `moving_02`: 255 on dynamic objects;
/// - `tracklet_labels.xml`: exact boxes of all objects near the velodyne, in its axes. Objects are `Car`, `Pole`, `Tree`, `Building`,
///   `Fence`, and with [`crate::SimConfig::riders`] `Cyclist` and `Pedestrian`;
/// - `poses.txt`: `world_from_cam`, the upper three rows of the matrix in 12 numbers a line.
///
/// A varied drive ([`crate::SimConfig::varied`]) also has `varied.json` with what it drew ([`Simulation::drawn`]). Its boxes cover whole
/// objects, including parts that were cut away over the camera's lane, such as a part of a tree's crown.
///
/// `progress` is called with the number of frames done and the number of all frames. Until all are done, it can stop the writer with
/// [`ControlFlow::Break`]. Everything is written to a temporary folder beside its final place, which is renamed at the end: after an error
/// or a stop, `out` is as it was. Files that a killed writer left there are removed first.
///
/// # Errors
/// [`Error::OutputNotEmpty`] if `out` contains anything; [`Error::Unfinished`] if another writer is at work there, or left files that
/// cannot be removed; [`Error::Stopped`]; [`Error::Io`] and [`Error::Encode`], with the path, if something cannot be written.
pub fn write_kitti(
    simulation: &Simulation,
    out: &Path,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<PathBuf> {
    require_empty(out)?;
    let date = out.join(DATE);
    let partial = PartialFolder::beside(&date).map_err(io(out, "make this folder"))?;
    let drive = write_all(simulation, partial.path(), progress)
        .map_err(|error| error.moved(partial.path(), &date))?;
    let moved = partial.commit();
    moved.map_err(io(&date, "move the finished drive here"))?;
    Ok(date.join(drive))
}

/// Writes below `date`; returns the drive folder's name.
fn write_all(
    simulation: &Simulation,
    date: &Path,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<String> {
    let name = format!("{DATE}_drive_{:04}_sync", simulation.config().seed);
    let drive = date.join(&name);
    let scan_every = simulation.config().scan_every;
    let images = drive.join("image_02/data");
    let right = drive.join("image_03/data");
    let stereo = simulation.config().stereo_baseline_m > 0.0;
    let depths = drive.join("proj_depth/groundtruth/image_02");
    let moving = drive.join("moving_02");
    let oxts = drive.join("oxts/data");
    let scans = drive.join("velodyne_points/data");
    for folder in [&images, &depths, &moving, &oxts] {
        make_folder(folder)?;
    }
    if scan_every > 0 {
        make_folder(&scans)?;
    }
    if stereo {
        make_folder(&right)?;
    }
    write_calibration(simulation, date)?;
    let frames = simulation.frames();
    for first in (0..frames).step_by(BATCH) {
        let last = (first + BATCH).min(frames);
        (first..last).into_par_iter().try_for_each(|index| {
            let frame = simulation.frame(index);
            let name = format!("{index:010}.png");
            write_png(&images.join(&name), &frame)?;
            if stereo {
                write_png(&right.join(&name), &simulation.right_frame(index))?;
            }
            write_depth(&depths.join(format!("{index:010}.png")), &frame.depth)?;
            write_mask(&moving.join(format!("{index:010}.png")), &frame)?;
            let line = simulation.oxts(index).line() + "\n";
            write_file(&oxts.join(format!("{index:010}.txt")), line.as_bytes())?;
            if scan_every > 0 && index % scan_every == 0 {
                let path = scans.join(format!("{index:010}.bin"));
                write_scan(&path, &simulation.velodyne(index))?;
            }
            Ok::<(), Error>(())
        })?;
        if progress(last, frames).is_break() && last < frames {
            return Err(Error::Stopped {
                done: last,
                total: frames,
            });
        }
    }
    let stamps = |shift: f64| -> String {
        (0..frames)
            .map(|i| timestamp(simulation.time_s(i) + shift) + "\n")
            .collect()
    };
    let stamp_files = [
        ("image_02/timestamps.txt", 0.0),
        ("image_03/timestamps.txt", 0.0),
        ("oxts/timestamps.txt", 0.0),
        ("velodyne_points/timestamps.txt", 0.0),
        ("velodyne_points/timestamps_start.txt", -0.05),
        ("velodyne_points/timestamps_end.txt", 0.05),
    ];
    for (file, shift) in stamp_files {
        let is_there = match file.split_once(['_', '/']) {
            Some(("velodyne", _)) => scan_every > 0,
            _ => stereo || !file.starts_with("image_03"),
        };
        if is_there {
            write_file(&drive.join(file), stamps(shift).as_bytes())?;
        }
    }
    write_file(&drive.join("oxts/dataformat.txt"), DATA_FORMAT.as_bytes())?;
    let poses: String = (0..frames)
        .map(|i| kitti_line(&simulation.world_from_cam(i)) + "\n")
        .collect();
    write_file(&drive.join("poses.txt"), poses.as_bytes())?;
    let tracklets = tracklets::to_xml(simulation);
    write_file(&drive.join("tracklet_labels.xml"), tracklets.as_bytes())?;
    if let Some(drawn) = simulation.drawn() {
        let path = drive.join("varied.json");
        write_file(&path, drawn.to_json().as_bytes())?;
    }
    Ok(name)
}

fn write_png(path: &Path, frame: &SimFrame) -> Result<()> {
    write_with(path, |writer| encode_rgb(writer, path, &frame.rgb))
}

fn write_depth(path: &Path, depth: &DepthMap) -> Result<()> {
    write_with(path, |writer| encode_depth(writer, path, depth))
}

fn write_mask(path: &Path, frame: &SimFrame) -> Result<()> {
    let bytes: Vec<u8> = frame
        .moving
        .iter()
        .map(|m| if *m { 255 } else { 0 })
        .collect();
    let size = frame.rgb.dimensions();
    let (colour, filter) = (ExtendedColorType::L8, FilterType::NoFilter);
    write_with(path, |writer| {
        encode(writer, path, &bytes, size, colour, filter)
    })
}

fn write_scan(path: &Path, cloud: &PointCloud) -> Result<()> {
    write_with(path, |writer| {
        cloud.write_kitti_bin(writer).map_err(|error| match error {
            deepfusion_geometry::cloud::Error::Stream(source) => {
                io(path, "write this scan")(source)
            }
            error => io(path, "write this scan")(std::io::Error::other(error)),
        })
    })
}

/// The date's noon plus `seconds`, with nanoseconds, as KITTI writes it.
fn timestamp(seconds: f64) -> String {
    let total = 12 * 3600 * 1_000_000_000 + (seconds * 1e9).round() as i64;
    let (nanos, total) = (total % 1_000_000_000, total / 1_000_000_000);
    // Noon of the first day; long drives run into the next ones of January.
    let (second, minute, hour, day) = (
        total % 60,
        total / 60 % 60,
        total / 3600 % 24,
        total / 86_400,
    );
    format!(
        "2026-01-{:02} {hour:02}:{minute:02}:{second:02}.{nanos:09}",
        day + 1
    )
}

fn numbers(values: impl IntoIterator<Item = f64>) -> String {
    let words: Vec<String> = values.into_iter().map(scientific).collect();
    words.join(" ")
}

fn write_calibration(simulation: &Simulation, date: &Path) -> Result<()> {
    let k = simulation.intrinsics();
    let (w, h) = (f64::from(k.width), f64::from(k.height));
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let matrix = [k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0];
    let mut text = String::from("calib_time: 01-Jan-2026 12:00:00\ncorner_dist: 9.950000e-02\n");
    let baseline = simulation.config().stereo_baseline_m;
    let mut cameras = vec![("00", 0.0), ("02", CAM2_FROM_CAM0_X)];
    if baseline > 0.0 {
        cameras.push(("03", CAM2_FROM_CAM0_X - baseline));
    }
    for (camera, shift) in cameras {
        let projection = [
            k.fx,
            0.0,
            k.cx,
            k.fx * shift,
            0.0,
            k.fy,
            k.cy,
            0.0,
            0.0,
            0.0,
            1.0,
            0.0,
        ];
        let entries: [(&str, Vec<f64>); 8] = [
            ("S", vec![w, h]),
            ("K", matrix.to_vec()),
            ("D", vec![0.0; 5]),
            ("R", identity.to_vec()),
            ("T", vec![shift, 0.0, 0.0]),
            ("S_rect", vec![w, h]),
            ("R_rect", identity.to_vec()),
            ("P_rect", projection.to_vec()),
        ];
        for (key, values) in entries {
            text += &format!("{key}_{camera}: {}\n", numbers(values));
        }
    }
    write_file(&date.join("calib_cam_to_cam.txt"), text.as_bytes())?;
    let rig = simulation.rig();
    let velo = rigid(&rig.cam0_from_velo)
        + "delta_f: 0.000000e+00 0.000000e+00\ndelta_c: 0.000000e+00 0.000000e+00\n";
    write_file(&date.join("calib_velo_to_cam.txt"), velo.as_bytes())?;
    let imu = rigid(&rig.velo_from_imu);
    write_file(&date.join("calib_imu_to_velo.txt"), imu.as_bytes())
}

fn rigid(pose: &Se3) -> String {
    let rotation = pose.rotation();
    let entries = (0..9).map(|i| rotation[(i / 3, i % 3)]);
    let t = pose.translation();
    format!(
        "calib_time: 01-Jan-2026 12:00:00\nR: {}\nT: {}\n",
        numbers(entries),
        numbers([t.x, t.y, t.z])
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_stamps_carry_over_to_minutes_and_days() {
        assert_eq!(timestamp(0.1), "2026-01-01 12:00:00.100000000");
        assert_eq!(timestamp(3725.5), "2026-01-01 13:02:05.500000000");
        assert_eq!(timestamp(12.0 * 3600.0), "2026-01-02 00:00:00.000000000");
    }
}
