use super::calendar::{date, stamp};
use super::parts::{
    Converted, Moving, SIMULATED, at_ns, check_not_stopped, moving_at, points, seconds_to_move,
};
use crate::dataset_toml::FolderConfig;
use crate::{Dataset, Error, MotionModel, Result, VehicleTrack, save_png};
use deepfusion_fs::PartialFolder;
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{Intrinsics, Se3};
use rayon::prelude::*;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Writes data sets as drives of a KITTI date folder below `out`, which must be new or empty, and returns the drives'
/// folders. All must have the same camera, because KITTI has one calibration per date. The times of all sensors are on the
/// vehicle's clock.
///
/// - `velodyne_points` has the measured depth as points relative to the camera's position, not the scanner's; static
///   points are where they were at the frame's time.
/// - `oxts` has speed, yaw rate, roll and pitch, and zeros for what the recording does not contain: one packet per frame, or, if
///   frames are more than half a second apart, packets at the times of the recording's speeds.
/// - The drive's `dataset.toml`, inside its folder, states if yaw, tilt or the camera's mount are unknown, and whether the recording
///   is [simulated](Dataset::is_simulated).
/// - A frame without a time has an empty line in `timestamps.txt`, as in KITTI's own files.
///
/// `progress` is called with the number of frames done and the total. [`ControlFlow::Break`] stops the conversion, unless all frames are
/// done. Everything is written to a temporary folder beside the final one and renamed at the end, so after an error or a stop `out` is
/// unchanged. The remains of a killed conversion are removed.
///
/// # Errors
/// [`Error::Exists`] if `out` is not empty, [`Error::Unfinished`] if another process is writing there, or its remains cannot be removed;
/// [`Error::Cameras`] if the cameras differ; [`Error::Stopped`]; and the errors of reading and writing.
pub fn convert_to_kitti(
    datasets: &[Dataset],
    out: &Path,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<Converted> {
    let Some(first) = datasets.first() else {
        return Ok(Converted::default());
    };
    let same = |other: &Dataset| {
        other.intrinsics(0) == first.intrinsics(0)
            && other.cam_from_vehicle() == first.cam_from_vehicle()
    };
    if let Some(other) = datasets.iter().find(|other| !same(other)) {
        return Err(Error::Cameras {
            first: first.name().to_owned(),
            other: other.name().to_owned(),
        });
    }
    super::parts::require_empty(out)?;
    let moved_s = seconds_to_move(datasets);
    let start_ns = at_ns(first, 0.0, moved_s);
    let date_name = date(start_ns);
    let date_folder = out.join(&date_name);
    let partial = PartialFolder::beside(&date_folder).map_err(|e| Error::file(out, e))?;
    let names = write_date(datasets, partial.path(), &date_name, moved_s, progress)
        .map_err(|error| error.moved(partial.path(), &date_folder))?;
    // Syncs once: syncing each of the thousands of files would take longer than writing them.
    let committed = partial.commit();
    committed.map_err(|e| Error::file(&date_folder, e))?;
    Ok(Converted {
        paths: names.iter().map(|name| date_folder.join(name)).collect(),
        moved_s,
    })
}

/// Writes all drives of a date and its calibration into a folder, and returns the drives' names.
fn write_date(
    datasets: &[Dataset],
    folder: &Path,
    date_name: &str,
    moved_s: i64,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<Vec<String>> {
    if let Some(first) = datasets.first() {
        write_calibration(folder, &first.intrinsics(0), first.cam_from_vehicle())?;
    }
    let total: usize = datasets.iter().map(|d| d.frames().len()).sum();
    let (mut done, mut names) = (0, Vec::new());
    for (number, dataset) in datasets.iter().enumerate() {
        let name = format!("{date_name}_drive_{:04}_sync", number + 1);
        let drive = folder.join(&name);
        write_drive(dataset, &drive, moved_s, &mut |frames| {
            done += frames;
            check_not_stopped(progress(done, total), done, total)
        })?;
        write_notes(dataset, &drive)?;
        names.push(name);
    }
    Ok(names)
}

/// Writes what KITTI's own files cannot express about a drive: that it is simulated, which of its oxts values were not measured, and that
/// the camera's mount is assumed.
fn write_notes(dataset: &Dataset, folder: &Path) -> Result<()> {
    let moves = dataset.track().is_some();
    let notes = [
        (dataset.is_simulated(), SIMULATED),
        (moves && !dataset.yaw_known(), YAW_UNKNOWN),
        (moves && dataset.tilt_unknown(), TILT_UNKNOWN),
        (dataset.mount_assumed(), MOUNT_UNKNOWN),
    ];
    let notes = notes.iter().filter(|(holds, _)| *holds);
    let notes: String = notes.map(|(_, note)| *note).collect();
    if notes.is_empty() {
        return Ok(());
    }
    let text =
        format!("# Written by `data convert`: what KITTI's own files have no place for.\n{notes}");
    super::parts::write_text(&folder.join(FolderConfig::NAME), &text)
}

/// The packets have zeros instead.
const YAW_UNKNOWN: &str = "yaw_known = false\n";
const TILT_UNKNOWN: &str = "tilt_known = false\n";
/// The calibration file has the assumed mount.
const MOUNT_UNKNOWN: &str = "mount_known = false\n";

/// Number of frames read and written together.
const BATCH: usize = 8;

fn write_drive(
    dataset: &Dataset,
    folder: &Path,
    moved_s: i64,
    progress: &mut dyn FnMut(usize) -> Result<()>,
) -> Result<()> {
    let part = |name: &str| -> Result<PathBuf> {
        let path = folder.join(name).join("data");
        std::fs::create_dir_all(&path).map_err(|e| Error::file(&path, e))?;
        Ok(path)
    };
    let images = part("image_02")?;
    let scans = part("velodyne_points")?;
    let has_motion = dataset.track().is_some();
    let oxts = has_motion.then(|| part("oxts")).transpose()?;
    let own_packets = has_motion && is_too_slow(dataset);
    let numbers = Numbers::of(dataset);
    let frames: Vec<usize> = (0..dataset.frames().len()).collect();
    for batch in frames.chunks(BATCH) {
        batch.par_iter().try_for_each(|&index| {
            let frame = &dataset.frames()[index];
            let name = format!("{:010}", numbers.of_frames[index]);
            let image = dataset.load_image(index)?;
            save_png(&image, &images.join(format!("{name}.png")))?;
            if let Some(xyz) = points(dataset, index)? {
                let path = scans.join(format!("{name}.bin"));
                let cloud = PointCloud {
                    intensity: Some(vec![0.0; xyz.len()]),
                    xyz,
                    ..PointCloud::default()
                };
                let failed = |e| Error::file(&path, e);
                deepfusion_fs::write_unsynced(
                    &path,
                    failed,
                    |out| Ok(cloud.write_kitti_bin(out)?),
                )?;
            }
            let known = frame.time_s.and_then(|t| moving_at(dataset, t));
            if let (Some(folder), Some(moving), false) = (&oxts, known, own_packets) {
                let path = folder.join(format!("{name}.txt"));
                super::parts::write_text(&path, &packet(&moving))?;
            }
            Ok::<(), Error>(())
        })?;
        progress(batch.len())?;
    }
    if dataset.frames().iter().any(|f| f.time_s.is_some()) {
        let text = numbers.times(dataset, moved_s);
        for name in ["image_02", "velodyne_points", "oxts"] {
            if name != "oxts" || (has_motion && !own_packets) {
                super::parts::write_text(&folder.join(name).join("timestamps.txt"), &text)?;
            }
        }
    }
    if let (Some(oxts), true) = (&oxts, own_packets) {
        write_own_packets(dataset, oxts, moved_s)?;
    }
    Ok(())
}

/// Whether consecutive frames are farther apart in time than a reader of packets bridges.
fn is_too_slow(dataset: &Dataset) -> bool {
    let frames = dataset.frames().windows(2);
    let mut apart_s = frames.filter_map(|pair| {
        (pair[0].number + 1 == pair[1].number).then_some(pair[1].time_s? - pair[0].time_s?)
    });
    apart_s.any(|apart_s| apart_s > VehicleTrack::MAX_GAP_S)
}

/// Writes packets at the times of the recording's own speeds, with their own numbers: packets only at a slow camera's frames would not show
/// how the vehicle moved between them. KITTI's `sync` drives have one packet per frame, its unsynced ones have packets like these.
fn write_own_packets(dataset: &Dataset, data: &Path, moved_s: i64) -> Result<()> {
    let times = dataset.track().map(MotionModel::times_s);
    let mut lines = String::new();
    let known = times.unwrap_or_default().iter().copied();
    let known = known.filter_map(|time_s| Some((time_s, moving_at(dataset, time_s)?)));
    for (number, (time_s, moving)) in known.enumerate() {
        let path = data.join(format!("{number:010}.txt"));
        super::parts::write_text(&path, &packet(&moving))?;
        let _ = writeln!(lines, "{}", stamp(at_ns(dataset, time_s, moved_s)));
    }
    let folder = data.parent().unwrap_or(data);
    super::parts::write_text(&folder.join("timestamps.txt"), &lines)
}

/// The numbers in the names of a drive's files.
struct Numbers {
    of_frames: Vec<u64>,
    /// Whether they are the recording's own numbers.
    own: bool,
}

impl Numbers {
    /// The recording's own numbers. KITTI has a line of times for every number, so if they are dates, or leave out millions, the frames are
    /// counted from 0 instead, with one number left out between frames that were not neighbours.
    fn of(dataset: &Dataset) -> Self {
        let own: Vec<u64> = dataset.frames().iter().map(|f| f.number).collect();
        let most = 1_000_000 + 100 * own.len() as u64;
        if own.last().is_none_or(|last| *last <= most) {
            return Self {
                of_frames: own,
                own: true,
            };
        }
        let mut next = 0;
        let gaps = own.windows(2).map(|pair| pair[1] - pair[0]);
        let counted = gaps.map(|gap| {
            next += gap.min(2);
            next
        });
        Self {
            of_frames: std::iter::once(0).chain(counted).collect(),
            own: false,
        }
    }

    /// One line for every number, as in KITTI. A number without a frame gets a time between its neighbours', and a frame without a time
    /// an empty line.
    fn times(&self, dataset: &Dataset, moved_s: i64) -> String {
        let last = self.of_frames.last().copied().unwrap_or_default();
        let mut text = String::new();
        for number in 0..=last {
            let time_s = match self.of_frames.binary_search(&number) {
                Ok(frame) => dataset.frames()[frame].time_s,
                Err(after) => {
                    let own = if self.own {
                        dataset.time_of(number)
                    } else {
                        None
                    };
                    own.or_else(|| self.between(dataset, number, after))
                }
            };
            let line = time_s.map(|time_s| stamp(at_ns(dataset, time_s, moved_s)));
            let _ = writeln!(text, "{}", line.unwrap_or_default());
        }
        text
    }

    /// The time of a number without a frame, interpolated linearly; `after` is the next one with a frame.
    fn between(&self, dataset: &Dataset, number: u64, after: usize) -> Option<f64> {
        let before = after.checked_sub(1)?;
        let [from, to] = [before, after].map(|frame| {
            Some((
                *self.of_frames.get(frame)?,
                dataset.frames().get(frame)?.time_s?,
            ))
        });
        let ((from, from_s), (to, to_s)) = (from?, to?);
        let share = (number - from) as f64 / (to - from) as f64;
        Some(from_s + share * (to_s - from_s))
    }
}

/// An OXTS packet with only speed, rates, roll and pitch; an accelerometer at rest reads 9.81 m/s² upwards.
fn packet(moving: &Moving) -> String {
    let mut values = [0.0; 30];
    values[3..5].copy_from_slice(&moving.tilt_rad);
    values[8] = moving.speed_mps;
    (values[13], values[16]) = (9.81, 9.81);
    for first in [17, 20] {
        values[first..first + 3].copy_from_slice(&moving.rates_radps);
    }
    let words: Vec<String> = values[..25].iter().map(|v| format!("{v}")).collect();
    format!("{} 0 0 0 0 0\n", words.join(" "))
}

fn numbers(values: impl IntoIterator<Item = f64>) -> String {
    let words: Vec<String> = values.into_iter().map(|v| format!("{v:.12e}")).collect();
    words.join(" ")
}

fn write_calibration(folder: &Path, k: &Intrinsics, cam_from_vehicle: Option<Se3>) -> Result<()> {
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let projection = [
        k.fx, 0.0, k.cx, 0.0, 0.0, k.fy, k.cy, 0.0, 0.0, 0.0, 1.0, 0.0,
    ];
    let size = [f64::from(k.width), f64::from(k.height)];
    let text = format!(
        "calib_time: converted\nR_rect_00: {}\nS_rect_02: {}\nR_rect_02: {}\nP_rect_02: {}\n",
        numbers(identity),
        numbers(size),
        numbers(identity),
        numbers(projection)
    );
    super::parts::write_text(&folder.join("calib_cam_to_cam.txt"), &text)?;
    let scanner = Se3::cam_from_body_axes();
    super::parts::write_text(&folder.join("calib_velo_to_cam.txt"), &rigid(&scanner))?;
    if let Some(cam_from_vehicle) = cam_from_vehicle {
        let scanner_from_vehicle = scanner.inverse() * cam_from_vehicle;
        let path = folder.join("calib_imu_to_velo.txt");
        super::parts::write_text(&path, &rigid(&scanner_from_vehicle))?;
    }
    Ok(())
}

fn rigid(pose: &Se3) -> String {
    let rotation = pose.rotation();
    let entries = (0..9).map(|i| rotation[(i / 3, i % 3)]);
    let t = pose.translation();
    let place = numbers([t.x, t.y, t.z]);
    format!(
        "calib_time: converted\nR: {}\nT: {place}\n",
        numbers(entries)
    )
}
