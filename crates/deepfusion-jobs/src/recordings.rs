//! Opens the recordings of a configuration.

use std::ops::Range;
use std::path::{Path, PathBuf};

use deepfusion_data::{Camera, Cameras, Dataset, Heading, NamedTopic, OpenOptions, Split};
use deepfusion_doctor::heading;
use deepfusion_model::{
    DataSetConfig, Error as ModelError, ExpectedSetting, TrainConfig, ViewMotion,
};

use crate::drives::first_of_drive;
use crate::{Error, Result};

mod kept_turns;
mod warnings;

use self::kept_turns::seen_turns;
pub use self::warnings::{PlacedWarning, placed_warnings, warning_line, warnings_of};

/// Opens the recordings at several paths; each drive and camera is a data set.
///
/// # Errors
/// A path without a recording, or with a broken one.
pub fn open_recordings(paths: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let mut datasets = Vec::new();
    for path in paths {
        datasets.extend(Dataset::open(path, options)?);
    }
    Ok(datasets)
}

/// As [`open_recordings`], for uses of the vehicle's motion. If a camera's mount is not given, its direction is measured in the images
/// ([`heading`]), if they show it; the drive's warnings then say so. Two cameras of a drive are turned together, by the images of the
/// first, since their relative pose is known. Reads up to 160 images of such a drive, if its yaw rate is known.
///
/// # Errors
/// As [`open_recordings`].
pub fn open_aimed(paths: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let mut datasets = open_recordings(paths, options)?;
    for rig in unaimed_rigs(&datasets, |_| true) {
        aim(&mut datasets, &rig, sure_heading);
    }
    Ok(datasets)
}

/// As [`open_aimed`], for learning from the vehicle's motion. If roll and pitch are not recorded, they are measured in the images
/// ([`deepfusion_doctor::seen_turns`]), together with yaw if there is no yaw rate; the drive's warnings say so. Reads all images of such a
/// drive, or twice if neither mount nor yaw rate is known; each of two cameras gets the turns that its own images show. Turns that took
/// more than ten seconds are kept in the user's cache folder, if there is one, and are measured again if the images or anything else that
/// they depend on has changed.
///
/// # Errors
/// As [`open_recordings`].
pub fn open_with_turns(paths: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    open_turning(paths, options, Dataset::tilt_unknown)
}

/// As [`open_aimed`], for measurements by the vehicle's motion that take roll and pitch from the images themselves: turns are measured in
/// all images of a drive only if there is no yaw rate.
///
/// # Errors
/// As [`open_recordings`].
pub fn open_with_yaw(paths: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    open_turning(paths, options, |dataset| {
        dataset.tilt_unknown() && !dataset.yaw_known()
    })
}

fn open_turning(
    paths: &[PathBuf],
    options: &OpenOptions,
    is_to_turn: impl Fn(&Dataset) -> bool,
) -> Result<Vec<Dataset>> {
    let mut datasets = open_aimed(paths, options)?;
    for rig in unaimed_rigs(&datasets, |d| is_to_turn(d) && !d.yaw_known()) {
        // The heading can only be measured once the turns are known, and the turns are more accurate once the heading is known.
        aim(&mut datasets, &rig, |dataset| {
            let mut turning = dataset.clone();
            turning.take_turns(&seen_turns(dataset));
            sure_heading(&turning)
        });
    }
    for dataset in datasets.iter_mut().filter(|d| is_to_turn(d)) {
        let turns = seen_turns(dataset);
        dataset.take_turns(&turns);
    }
    Ok(datasets)
}

/// The cameras of selected drives whose mounts are not given, by index: the two of one drive together, except those of two topics of a bag,
/// whose relative pose is unknown.
fn unaimed_rigs(datasets: &[Dataset], is_such: impl Fn(&Dataset) -> bool) -> Vec<Vec<usize>> {
    let drives = first_of_drive(datasets);
    let mut rigs: Vec<Vec<usize>> = Vec::new();
    for (i, dataset) in datasets.iter().enumerate() {
        if !dataset.mount_assumed() || !is_such(dataset) {
            continue;
        }
        let is_beside = |other: &usize| {
            drives[*other] == drives[i] && datasets[*other].camera() != dataset.camera()
        };
        match rigs.iter_mut().find(|rig| rig.iter().all(is_beside)) {
            Some(rig) => rig.push(i),
            None => rigs.push(vec![i]),
        }
    }
    rigs
}

/// Aims the cameras of a rig by the first one whose images show the heading.
fn aim(datasets: &mut [Dataset], rig: &[usize], heading: impl Fn(&Dataset) -> Option<Heading>) {
    let seen = rig.iter().find_map(|i| {
        let dataset = &datasets[*i];
        Some((heading(dataset)?, dataset.cam_from_vehicle()?))
    });
    if let Some((heading, cam_from_vehicle)) = seen {
        for i in rig {
            datasets[*i].aim_beside(&heading, &cam_from_vehicle);
        }
    }
}

/// A camera's heading, if its images show it well enough.
fn sure_heading(dataset: &Dataset) -> Option<Heading> {
    heading(dataset).ok().filter(Heading::is_sure)
}

/// Reads a split file.
///
/// # Errors
/// A file that is not a split.
pub fn read_split(path: Option<&Path>) -> Result<Option<Split>> {
    Ok(path.map(Split::read).transpose()?)
}

/// The word for cameras in configurations.
#[must_use]
pub fn camera_word(camera: Cameras) -> &'static str {
    match camera.cameras() {
        [Camera::Left] => "2",
        [Camera::Right] => "3",
        _ => "both",
    }
}

/// All recordings to train on, with the index of their set in `data.sets`; a run's samples come from them. Roll and pitch do not affect the
/// samples and are not measured in the images. If there is no yaw rate, yaw is, if the run uses turns.
///
/// # Errors
/// As [`open_recordings`].
pub fn training_recordings(config: &TrainConfig) -> Result<Vec<(usize, Dataset)>> {
    let opened_by: (OpenFn, OpenFn) = (open_aimed, open_with_yaw);
    open_sets(config, RecordingRole::Training, opened_by, &mut |_, _| ())
}

/// As [`training_recordings`], for uses that need no motion of the vehicle: no image is read.
///
/// # Errors
/// As [`open_recordings`].
pub fn plain_training_recordings(config: &TrainConfig) -> Result<Vec<(usize, Dataset)>> {
    let opened_by: (OpenFn, OpenFn) = (open_recordings, open_recordings);
    open_sets(config, RecordingRole::Training, opened_by, &mut |_, _| ())
}

/// A function that opens recordings.
type OpenFn = fn(&[PathBuf], &OpenOptions) -> Result<Vec<Dataset>>;

/// What recordings are used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordingRole {
    /// Learning.
    Training,
    /// Validation.
    Validation,
}

/// Whether there are recordings or frames to validate on; otherwise the end of each drive is held out.
#[must_use]
pub fn validates(config: &TrainConfig) -> bool {
    let data = &config.data;
    let own = !data.validation.is_empty() || data.validation_split.is_some();
    own || data.sets.iter().any(DataSetConfig::validates)
}

/// The recordings for training or validation, with the index of their set in `data.sets`; `opened` is called with those of each set, and
/// with the options they were opened with.
///
/// # Errors
/// As [`open_recordings`].
pub fn open_for(
    config: &TrainConfig,
    role: RecordingRole,
    opened: &mut dyn FnMut(&OpenOptions, &[Dataset]),
) -> Result<Vec<(usize, Dataset)>> {
    open_sets(config, role, (open_aimed, open_with_turns), opened)
}

/// The recordings of a role: opened by `open_turned` if their turns are measured in the images, otherwise by `open_plain`.
fn open_sets(
    config: &TrainConfig,
    role: RecordingRole,
    (open_plain, open_turned): (OpenFn, OpenFn),
    opened: &mut dyn FnMut(&OpenOptions, &[Dataset]),
) -> Result<Vec<(usize, Dataset)>> {
    let data = &config.data;
    let open = |set: usize, paths: &[PathBuf], options: &OpenOptions| {
        if takes_turns(config, set) {
            open_turned(paths, options)
        } else {
            open_plain(paths, options)
        }
    };
    if data.sets.is_empty() {
        let validation = (&data.validation, &data.validation_split);
        let (paths, split) = of_role(role, (&data.paths, &data.split), validation);
        let options = open_options(
            config,
            split,
            &data.camera,
            data.camera_ahead_s,
            &data.topics,
        )?;
        let datasets = open(0, paths, &options)?;
        opened(&options, &datasets);
        return Ok(placed(0, datasets));
    }
    let mut all = Vec::new();
    for (i, set) in data.sets.iter().enumerate() {
        let validation = (&set.validation, &set.validation_split);
        let (paths, split) = of_role(role, (&set.paths, &set.split), validation);
        let camera = match set.camera.as_str() {
            "" => &data.camera,
            own => own,
        };
        let ahead_s = set.camera_ahead_s.or(data.camera_ahead_s);
        let topics = match set.topics.as_slice() {
            [] => &data.topics,
            _ => &set.topics,
        };
        let options = open_options(config, split, camera, ahead_s, topics)?;
        let datasets = open(i, paths, &options)?;
        opened(&options, &datasets);
        all.extend(placed(i, datasets));
    }
    Ok(all)
}

/// Whether the turns of a set's drives are measured in the images. They are not if nothing uses turns, or if turns determine the focal
/// length, since turns from images depend on it.
fn takes_turns(config: &TrainConfig, set: usize) -> bool {
    let wanted = !config.data.measured_turns_only && config.learned_camera().is_none();
    wanted && reads_turns(config, set)
}

/// Whether anything that is learned from a set depends on its vehicles' turns.
pub(crate) fn reads_turns(config: &TrainConfig, set: usize) -> bool {
    let reads = matches!(config.view_motion, ViewMotion::Vehicle | ViewMotion::Auto)
        || config.reads_rotation();
    reads && config.learn(set).from_motion()
}

/// Paths, and the split file that selects their frames.
type Frames<'a> = (&'a Vec<PathBuf>, &'a Option<PathBuf>);

/// The paths and the split for one role. A split of training frames does not select validation frames, nor the other way round.
fn of_role<'a>(
    role: RecordingRole,
    training: Frames<'a>,
    validation: Frames<'a>,
) -> (&'a [PathBuf], Option<&'a Path>) {
    let (paths, split) = match role {
        RecordingRole::Training => training,
        RecordingRole::Validation if validation.0.is_empty() => (training.0, validation.1),
        RecordingRole::Validation => validation,
    };
    (paths, split.as_deref())
}

/// Pairs each with the index of its set.
fn placed(set: usize, datasets: Vec<Dataset>) -> Vec<(usize, Dataset)> {
    datasets.into_iter().map(|d| (set, d)).collect()
}

/// Parses the topics in a configuration.
///
/// # Errors
/// [`Error::NoTopic`] for one that is not written as [`NamedTopic`].
pub fn named_topics(topics: &[String]) -> Result<Vec<NamedTopic>> {
    let read = |text: &String| {
        text.parse::<NamedTopic>()
            .map_err(|problem| Error::NoTopic {
                text: text.clone(),
                problem,
            })
    };
    topics.iter().map(read).collect()
}

/// The options for opening a configuration's recordings, with its cameras and topics.
fn open_options(
    config: &TrainConfig,
    split: Option<&Path>,
    camera: &str,
    camera_ahead_s: Option<f64>,
    topics: &[String],
) -> Result<OpenOptions> {
    let camera: Cameras = match camera {
        "" => Cameras::default(),
        text => text.parse().map_err(|_| {
            let found = text.to_owned();
            ModelError::config("data.camera", ExpectedSetting::Cameras, found)
        })?,
    };
    Ok(OpenOptions {
        camera,
        split: read_split(split)?,
        camera_ahead_s,
        topics: named_topics(topics)?,
        assumed_camera: config.assumed_camera.map(|camera| camera.intrinsics()),
        ..OpenOptions::default()
    })
}

/// Writes a part of a drive's frames as a split file.
///
/// # Errors
/// A file that cannot be written.
///
/// # Panics
/// If the part exceeds the frames.
pub fn write_split(drive: &Dataset, part: Range<usize>, path: &Path) -> Result<()> {
    let line =
        |frame: &deepfusion_data::Frame| format!("{} {:010} l\n", drive.split_name(), frame.number);
    let text: String = drive.frames()[part].iter().map(line).collect();
    Ok(crate::files::write(path, text)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_sim::{SimConfig, Simulation, write_kitti};
    use std::error::Error;
    use std::fmt::Write as _;
    use std::fs;
    use std::ops::ControlFlow;

    /// Pixels by which the folder's principal point is lower than the camera's: its direction of travel is then this far above it, as if
    /// the camera looked down by some degrees.
    const TOO_LOW_PX: f64 = 13.0;

    /// A drive long enough to measure where its camera looks.
    fn street() -> SimConfig {
        SimConfig {
            seed: 5,
            frames: 60,
            width: 320,
            height: 192,
            scan_every: 0,
            ..SimConfig::default()
        }
    }

    /// A simulated drive as a folder of images with speeds, without a mount.
    fn folder(at: &Path) -> std::result::Result<PathBuf, Box<dyn Error>> {
        let simulation = Simulation::new(&street())?;
        let kitti = write_kitti(&simulation, &at.join("kitti"), &mut |_, _| {
            ControlFlow::Continue(())
        })?;
        let drive = &Dataset::open(&kitti, &OpenOptions::default())?[0];
        let track = drive.track().ok_or("no speeds")?;
        let times: Vec<f64> = drive.frames().iter().filter_map(|f| f.time_s).collect();
        let (mut frames, mut speeds) = (
            "time_s,file\n".to_owned(),
            "time_s,speed_mps,yaw_rate_radps\n".to_owned(),
        );
        for (i, time) in times.iter().enumerate() {
            writeln!(frames, "{time:.6},{i:010}.png")?;
        }
        for pair in times.windows(2) {
            let moved = track.motion(pair[0], pair[1]).ok_or("no motion")?;
            let (middle, dt) = (0.5 * (pair[0] + pair[1]), pair[1] - pair[0]);
            let (speed, rate) = (moved.distance_m / dt, moved.yaw_rad / dt);
            writeln!(speeds, "{middle:.6},{speed},{rate}")?;
        }
        let folder = at.join("folder");
        fs::create_dir(&folder)?;
        fs::rename(drive.folder().join("image_02/data"), folder.join("images"))?;
        fs::write(folder.join("frames.csv"), frames)?;
        fs::write(folder.join("speed.csv"), speeds)?;
        let k = drive.intrinsics(0);
        let numbers = format!("{} {} {} {}", k.fx, k.fy, k.cx, k.cy + TOO_LOW_PX);
        fs::write(folder.join("intrinsics.txt"), numbers)?;
        Ok(folder)
    }

    #[test]
    fn an_invalid_topic_is_named() {
        let error = named_topics(&["/camera".to_owned()]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "setting `data.topics`: /camera: expected ROLE=NAME, such as image=/camera/front/image_raw"
        );
    }

    fn ahead(drive: &Dataset) -> (f64, f64) {
        let forward = nalgebra::Vector3::x();
        let ahead = drive.cam_from_vehicle().map(|mount| mount.rotate(&forward));
        let ahead = ahead.unwrap_or_default();
        (ahead.x, ahead.y)
    }

    fn warning_text(drive: &Dataset) -> String {
        let warnings = drive.warnings().iter();
        warnings
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join("\n")
    }

    #[test]
    fn a_camera_whose_mount_is_not_given_is_aimed() -> std::result::Result<(), Box<dyn Error>> {
        let at = tempfile::tempdir()?;
        let folder = folder(at.path())?;
        let options = OpenOptions::default();
        let taken = &open_recordings(std::slice::from_ref(&folder), &options)?[0];
        assert!(taken.mount_assumed() && warning_text(taken).contains("straight"));
        let straight = |(right, down): (f64, f64)| right.abs() < 1e-9 && down.abs() < 1e-9;
        assert!(straight(ahead(taken)));

        let aimed = &open_aimed(std::slice::from_ref(&folder), &options)?[0];
        let k = aimed.intrinsics(0);
        let ((right, down), off) = (ahead(aimed), (TOO_LOW_PX / k.fy).atan());
        println!(
            "{right:.4} to the right, {down:.4} down; {:.4} up",
            off.sin()
        );
        assert!((down + off.sin()).abs() < 0.008 && right.abs() < 0.008);
        assert!(!aimed.mount_assumed());
        let warning_text = warning_text(aimed);
        assert!(
            warning_text.contains("degrees down") && !warning_text.contains("straight ahead"),
            "{warning_text}"
        );

        // A given mount is used as it is.
        fs::write(folder.join("dataset.toml"), "[mount]\nup_m = 1.65\n")?;
        let given = &open_aimed(&[folder], &options)?[0];
        assert!(!given.mount_assumed());
        assert!(straight(ahead(given)));
        Ok(())
    }

    /// If each were turned by itself, the errors would make two cameras diverge, and they would no longer be a stereo pair.
    #[test]
    fn two_cameras_of_a_drive_are_aimed_together() -> std::result::Result<(), Box<dyn Error>> {
        let at = tempfile::tempdir()?;
        let simulation = Simulation::new(&SimConfig {
            stereo_baseline_m: 0.5,
            ..street()
        })?;
        let root = write_kitti(
            &simulation,
            at.path(),
            &mut |_, _| ControlFlow::Continue(()),
        )?;
        let options = OpenOptions {
            camera: Cameras::Both,
            ..OpenOptions::default()
        };
        let folder = Dataset::open(&root, &options)?[0].folder().to_owned();
        let file = folder.join("dataset.toml");
        let notes = fs::read_to_string(&file).unwrap_or_default();
        fs::write(&file, format!("mount_known = false\n{notes}"))?;
        let paths = [root];
        let right_from_left = |drives: &[Dataset]| {
            let mounts = [0, 1].map(|i| drives[i].cam_from_vehicle().unwrap());
            mounts[1] * mounts[0].inverse()
        };
        let taken = open_recordings(&paths, &options)?;
        assert!(taken.iter().all(Dataset::mount_assumed));
        let aimed = open_aimed(&paths, &options)?;
        assert!(!aimed.iter().any(Dataset::mount_assumed));
        let changed = right_from_left(&taken).inverse() * right_from_left(&aimed);
        assert!(changed.angle() < 1e-6 && changed.translation().norm() < 1e-6);
        let turned =
            taken[0].cam_from_vehicle().unwrap().inverse() * aimed[0].cam_from_vehicle().unwrap();
        assert!(turned.angle() > 1e-5, "nothing was found");
        assert_eq!(warning_text(&aimed[0]), warning_text(&aimed[1]));
        Ok(())
    }

    /// For a drive with only a speed, the images show its turns and its camera's heading; with `measured_turns_only`, nothing is taken from
    /// them.
    #[test]
    fn turns_and_heading_are_found_with_only_a_speed() -> std::result::Result<(), Box<dyn Error>> {
        let at = tempfile::tempdir()?;
        let folder = folder(at.path())?;
        let speeds = fs::read_to_string(folder.join("speed.csv"))?;
        let without_yaw = |line: &str| line.rsplit_once(',').map(|(rest, _)| rest.to_owned());
        let speeds: Vec<String> = speeds.lines().filter_map(without_yaw).collect();
        fs::write(folder.join("speed.csv"), speeds.join("\n"))?;
        let mut config = deepfusion_model::Preset::Tiny.config();
        config.data.paths = vec![folder];
        let open = |config: &TrainConfig| -> std::result::Result<Dataset, Box<dyn Error>> {
            let role = RecordingRole::Training;
            Ok(open_for(config, role, &mut |_, _| ())?.remove(0).1)
        };
        let turning = open(&config)?;
        let (right, down) = ahead(&turning);
        let off = (TOO_LOW_PX / turning.intrinsics(0).fy).atan();
        println!(
            "{right:.4} to the right, {down:.4} down; {:.4} up",
            off.sin()
        );
        assert!((down + off.sin()).abs() < 0.008 && right.abs() < 0.008);
        assert!(turning.yaw_known() && !turning.tilt_unknown());
        let known = |drive: &Dataset| drive.camera_motion(1, 2).is_some();
        assert!(known(&turning));
        // A later check of what the run has seen finds its samples.
        assert!(known(&training_recordings(&config)?.remove(0).1));
        config.assumed_camera = Some(deepfusion_model::AssumedCamera {
            learn: true,
            ..Default::default()
        });
        let learned = open(&config)?;
        assert!(
            !learned.yaw_known(),
            "turns of the images follow from the focal length"
        );
        config.assumed_camera = None;
        config.data.measured_turns_only = true;
        let measured = open(&config)?;
        assert!(!measured.yaw_known() && measured.tilt_unknown() && !known(&measured));
        Ok(())
    }
}
