//! What can go wrong with a recording.

use crate::{CalibrationSource, DatasetKind, GtKind, NamedTopic};
use deepfusion_fs::FileError;
use deepfusion_hint::count_of;
use std::path::{Path, PathBuf};

mod absent;
mod array;
mod calibration_file;
mod camera;
mod can;
mod columns;
mod config;
mod found_instead;
mod frames;
mod hint;
mod kitti;
mod line;
mod missing;
mod picture;
mod pose;
mod table;
mod topic;
mod tracklets;

pub use self::absent::{NoFramesReason, NoTrackReason};
pub use self::array::{ArrayProblem, SegmentProblem};
pub use self::calibration_file::CalibrationFileProblem;
pub use self::camera::{CameraInfoProblem, CameraProblem, NoLens};
pub use self::can::CanProblem;
pub(crate) use self::can::{HIGHEST_EXTENDED, HIGHEST_STANDARD};
pub use self::columns::{ColumnsProblem, Quantity};
pub use self::config::{ConfigProblem, ExpectedValue};
pub use self::found_instead::{FileKind, FoundInstead};
pub use self::frames::FramesProblem;
pub use self::kitti::{CalibrationProblem, OxtsField, OxtsProblem};
pub use self::line::{SplitProblem, TimeStampProblem};
pub use self::missing::MissingPart;
pub use self::picture::ImageProblem;
pub use self::pose::{PoseField, PoseFileProblem, PoseProblem};
pub use self::table::{ExpectedCell, JsonProblem, TableProblem};
pub use self::topic::TopicProblem;
pub use self::tracklets::{TrackletPart, TrackletPlace, TrackletsProblem};

/// What can go wrong with a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The path exists, but is not a recording of a known layout.
    #[error(
        "{}: not a recording of a known layout: {found}{}",
        path.display(), found.known_layouts()
    )]
    UnknownLayout {
        /// The path given.
        path: PathBuf,
        /// What was found there.
        found: FoundInstead,
    },
    /// The folder is not a recording, but contains recordings.
    #[error("{}: not a recording, but a folder with {} (such as {})", path.display(), count_of(*count, "recording"), such_as.display())]
    FolderOfRecordings {
        /// Path of the folder.
        path: PathBuf,
        /// How many recordings lie directly in it.
        count: usize,
        /// The first of them.
        such_as: PathBuf,
    },
    /// A required part of the recording is missing.
    #[error("{}: no such file or folder; it should contain {part}", path.display())]
    Missing {
        /// Path at which the file or folder was expected.
        path: PathBuf,
        /// What it should contain.
        part: MissingPart,
    },
    /// No drive has an image of the camera.
    #[error("{}: no image of camera {camera} (<number>.png or .jpg)", path.display())]
    NoImages {
        /// Folder in which they were expected.
        path: PathBuf,
        /// The camera's number.
        camera: u8,
    },
    /// Any other error of an image file.
    #[error(transparent)]
    ImageFile(deepfusion_images::Error),
    /// An image cannot be read.
    #[error("{}: {problem}", path.display())]
    Image {
        /// Path of the image.
        path: PathBuf,
        /// Why it cannot be read.
        #[source]
        problem: ImageProblem,
    },
    /// An image's size differs from that of its camera's calibration.
    #[error(
        "{image}: frame {frame} of {drive} is {}x{}, but its calibration is for {}x{} ({field} in {})",
        found.0, found.1, expected.0, expected.1, calibration
    )]
    FrameSize {
        /// Name of the image.
        image: String,
        /// Name of its drive.
        drive: String,
        /// Its frame number.
        frame: u64,
        /// Its width and height, in pixels.
        found: (u32, u32),
        /// Width and height of the calibration, in pixels.
        expected: (u32, u32),
        /// The calibration's field with that size.
        field: &'static str,
        /// Where the calibration comes from.
        calibration: CalibrationSource,
    },
    /// A camera other than the only one was requested.
    #[error("{}: its only camera is camera 2", path.display())]
    OneCamera {
        /// Path of the recording.
        path: PathBuf,
    },
    /// A camera's calibration cannot be used.
    #[error("{by}: {problem}")]
    CameraFile {
        /// Where the calibration comes from.
        by: CalibrationSource,
        /// Why it cannot be used.
        #[source]
        problem: CameraProblem,
    },
    /// No calibration was found for the camera of images in files.
    #[error("{}: no calibration of its camera", path.display())]
    NoCameraFile {
        /// Folder in which a calibration is looked for first.
        path: PathBuf,
        /// Layout of the recording.
        layout: DatasetKind,
    },
    /// There is no folder into which a video's frames can be decoded.
    #[error(
        "{}: no place for its decoded frames: neither its folder nor the user's cache folder is writable",
        video.display()
    )]
    NoPlaceForFrames {
        /// Path of the video.
        video: PathBuf,
        /// The system's error for the video's folder.
        source: std::io::Error,
    },
    /// Neither a bag nor the file beside it has the camera's calibration.
    #[error("{}: no calibration of its camera: no CameraInfo with a K", path.display())]
    NoBagCamera {
        /// Path of the bag.
        path: PathBuf,
        /// Path of the file beside it, in which the calibration can be given.
        config: PathBuf,
    },
    /// Intrinsics were given for a layout that includes a calibration.
    #[error("{}: {layout} includes its own calibration", path.display())]
    OwnCalibration {
        /// Path of the recording.
        path: PathBuf,
        /// Its layout.
        layout: &'static str,
    },
    /// A JSON table cannot be read, or refers to a missing row of another table.
    #[error("{}:{line}: {field}: {problem}", path.display())]
    Json {
        /// Path of the file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// Name of the field.
        field: String,
        /// What is wrong with it.
        #[source]
        problem: JsonProblem,
    },
    /// A root contains several sets of tables with some drives in common.
    #[error("{}: contains several sets of tables: {}", path.display(), versions.join(", "))]
    SeveralVersions {
        /// Path of the root.
        path: PathBuf,
        /// Names of the folders of tables.
        versions: Vec<String>,
    },
    /// A line of a pose file cannot be read.
    #[error("{}:{line}: {field}: {problem}", path.display())]
    Pose {
        /// Path of the file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// Which number of the line, or the whole pose.
        field: PoseField,
        /// What is wrong with it.
        #[source]
        problem: PoseProblem,
    },
    /// A `dataset.toml` cannot be used.
    #[error("{}: {problem}", path.display())]
    Config {
        /// Path of the file.
        path: PathBuf,
        /// What is wrong with it.
        #[source]
        problem: ConfigProblem,
    },
    /// A value of a table cannot be used.
    #[error("{}:{line}: column {column}: {problem}", path.display())]
    Table {
        /// Path of the file.
        path: PathBuf,
        /// The line, counted from 1, including the header.
        line: u64,
        /// The column's name, or its number, counted from 1.
        column: String,
        /// What is wrong with the value.
        #[source]
        problem: TableProblem,
    },
    /// A row of a table cannot be read.
    #[error("{}:{line}: {problem}", path.display())]
    Row {
        /// Path of the file.
        path: PathBuf,
        /// The line, counted from 1, including the header.
        line: u64,
        /// What is wrong with the row.
        #[source]
        problem: TableProblem,
    },
    /// A log from a vehicle, a GPS receiver or an app cannot be used.
    #[error(transparent)]
    Log(#[from] deepfusion_logs::Error),
    /// A table lacks a column, or the unit of a column is unknown.
    #[error("{}: {problem}", path.display())]
    Columns {
        /// Path of the file.
        path: PathBuf,
        /// What is wrong.
        #[source]
        problem: ColumnsProblem,
    },
    /// The times of the speeds and those of the frames do not overlap.
    #[error(
        "{}: its times ({} to {} s) do not overlap with the frames' ({} to {} s)",
        path.display(), in_ms(times_s.0), in_ms(times_s.1), in_ms(frames_s.0), in_ms(frames_s.1)
    )]
    Clocks {
        /// Path of the file of speeds.
        path: PathBuf,
        /// Its first and last time, in seconds.
        times_s: (f64, f64),
        /// The frames' first and last time, in seconds.
        frames_s: (f64, f64),
    },
    /// A drive has no ego-motion, for lack of speeds or times.
    #[error("{drive}: {reason}")]
    NoTrack {
        /// Name of the drive.
        drive: String,
        /// What is missing.
        #[source]
        reason: NoTrackReason,
    },
    /// The camera's path was not measured.
    #[error("{drive}: recordings of this layout ({layout}) do not contain the camera's path")]
    NoPath {
        /// Name of the drive.
        drive: String,
        /// The layout.
        layout: &'static str,
    },
    /// Ground truth of this kind is not available for the recording.
    #[error("{drive}: no ground truth of the kind \"{}\"", kind.name())]
    DepthKind {
        /// Name of the drive.
        drive: String,
        /// The kind requested.
        kind: GtKind,
    },
    /// A ROS bag cannot be read.
    #[error(transparent)]
    Bag(#[from] deepfusion_rosbag::Error),
    /// A bag's topics are not those required.
    #[error("{}: {problem}", path.display())]
    Topic {
        /// Path of the bag.
        path: PathBuf,
        /// What is wrong with them.
        #[source]
        problem: Box<TopicProblem>,
        /// A role and a possible topic for it, which a caller may select with [`crate::OpenOptions::topics`].
        choice: Option<NamedTopic>,
    },
    /// A topic was named for a recording that has no topics.
    #[error("{}: {topic}: recordings of this layout ({layout}) have no topics", path.display())]
    NoTopics {
        /// Path of the recording.
        path: PathBuf,
        /// Its layout.
        layout: &'static str,
        /// The topic named.
        topic: NamedTopic,
    },
    /// The recording is not a bag, but a bag is required.
    #[error("{}: {layout}, expected a ROS bag", path.display())]
    NotABag {
        /// Path of the recording.
        path: PathBuf,
        /// Its layout.
        layout: &'static str,
    },
    /// The transforms between a bag's frames contradict each other.
    #[error("{}: {problem}", path.display())]
    Frames {
        /// Path of the bag.
        path: PathBuf,
        /// The contradiction.
        #[source]
        problem: FramesProblem,
    },
    /// No motion can be computed from the vehicle's sensors.
    #[error("{}: {source}", path.display())]
    Motion {
        /// Path of the recording.
        path: PathBuf,
        /// Why it cannot be computed.
        source: deepfusion_motion::Error,
    },
    /// A bag's inertial unit cannot be used with its mounting, or not at all.
    #[error("{}: {source}", path.display())]
    InertialUnit {
        /// Path of the bag.
        path: PathBuf,
        /// Why it cannot be used.
        source: Box<deepfusion_motion::Error>,
        /// Path of the file beside the bag, in which the unit can be left out.
        config: PathBuf,
    },
    /// The output path already exists.
    #[error("{}: already exists", path.display())]
    Exists {
        /// Path of the file, or of the folder that is not empty.
        path: PathBuf,
    },
    /// The folder for a converted recording looks empty, but another writer is using it, or the remains of one that died cannot be removed.
    #[error(transparent)]
    Unfinished(#[from] deepfusion_fs::Unfinished),
    /// The caller stopped a conversion before the last frame; its partial output was removed.
    #[error("nothing is written: stopped after {done} of {}", count_of(*total, "frame"))]
    Stopped {
        /// Number of frames done.
        done: usize,
        /// Number of frames in all.
        total: usize,
    },
    /// Recordings with different cameras cannot be drives of one KITTI date.
    #[error("{first} and {other} have different cameras, and a KITTI date has one calibration")]
    Cameras {
        /// Name of a recording.
        first: String,
        /// Name of one with another camera, or with the camera in another place.
        other: String,
    },
    /// A frame has no time.
    #[error("{drive}: frame {frame} has no time, which a bag requires")]
    NoTimes {
        /// Name of the drive.
        drive: String,
        /// The frame's number.
        frame: u64,
    },
    /// A comma2k19 segment has other streams, but no video.
    #[error("{}: no such file or folder; it should contain the segment's images", path.display())]
    NoSegmentVideo {
        /// Path at which the video was expected.
        path: PathBuf,
    },
    /// A recording has other streams, but no images.
    #[error("{}: {reason}", path.display())]
    NoFrames {
        /// Path of the recording.
        path: PathBuf,
        /// Why it has none.
        #[source]
        reason: NoFramesReason,
    },
    /// A video cannot be read, or ffmpeg is not installed.
    #[error(transparent)]
    Video(deepfusion_video::Error),
    /// A calibration file lacks a field, or one is invalid.
    #[error("{}: {field}: {problem}", path.display())]
    Calibration {
        /// Path of the file.
        path: PathBuf,
        /// Name of the field, such as `P_rect_02`.
        field: String,
        /// What is wrong with it.
        #[source]
        problem: CalibrationProblem,
    },
    /// A line of a time stamp file cannot be read.
    #[error("{}:{line}: {problem}", path.display())]
    TimeStamp {
        /// Path of the file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong with it.
        #[source]
        problem: TimeStampProblem,
    },
    /// A frame has no line in the time stamp file.
    #[error(
        "{}: {} (for frames 0 to {}), but there is a frame {frame}",
        path.display(), count_of(*lines, "time stamp"), lines.saturating_sub(1)
    )]
    NoTimeStamp {
        /// Path of the file.
        path: PathBuf,
        /// Number of time stamps in the file.
        lines: usize,
        /// Number of the frame without a time stamp.
        frame: u64,
    },
    /// An OXTS packet cannot be read.
    #[error("{}: {field}: {problem}", path.display())]
    Oxts {
        /// Path of the packet's file.
        path: PathBuf,
        /// The field.
        field: OxtsField,
        /// What is wrong with it.
        #[source]
        problem: OxtsProblem,
    },
    /// A tracklet file cannot be read.
    #[error("{}: {place}: {problem}", path.display())]
    Tracklets {
        /// Path of the file.
        path: PathBuf,
        /// Where in the file.
        place: TrackletPlace,
        /// What is wrong there.
        #[source]
        problem: TrackletsProblem,
    },
    /// A line of a split file cannot be read.
    #[error("{}:{line}: {problem}", path.display())]
    Split {
        /// Path of the file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong with it.
        #[source]
        problem: SplitProblem,
    },
    /// A split selects no frame of the recording.
    #[error(
        "{}: {} in {} (first entry: {first})",
        split.display(), none_is(*entries), path.display()
    )]
    SplitSelectsNothing {
        /// Path of the split file.
        split: PathBuf,
        /// Path of the recording.
        path: PathBuf,
        /// Number of frames in the split.
        entries: usize,
        /// The first of them, as written in the file.
        first: String,
    },
    /// Frame offsets that form no valid pairs.
    #[error(
        "frame offsets {offsets:?}: expected at least one, each different from 0 and from the others"
    )]
    Offsets {
        /// The offsets given.
        offsets: Vec<i32>,
    },
    /// A drive with a single frame has no pairs.
    #[error("{drive}: frame {frame} is its only frame, but a pair needs two consecutive frames")]
    OneFrame {
        /// Name of the drive.
        drive: String,
        /// The number of its frame.
        frame: u64,
    },
    /// The vehicle never moves.
    #[error(
        "{drive}: the vehicle stands still: the fastest of {} moves at {fastest_mps:.2} m/s, below the minimum of {min_speed_mps} m/s",
        count_of(*pairs, "pair")
    )]
    Standing {
        /// Name of the drive.
        drive: String,
        /// Number of pairs considered.
        pairs: usize,
        /// Mean speed of the fastest pair, in m/s.
        fastest_mps: f64,
        /// Minimum speed requested, in m/s.
        min_speed_mps: f64,
    },
    /// No pair of frames can be used, for the reasons counted.
    #[error(
        "{drive}: no pair of frames can be used: of {}, {no_neighbour} without a neighbour \
         at offsets {offsets:?}{}, {bad_time} with time stamps that do not increase, {no_motion} without speeds at their time (oxts, speed.csv)",
        count_of(*targets, "frame"),
        a_step(*frame_distance_m)
    )]
    NoPairs {
        /// Name of the drive.
        drive: String,
        /// Number of frames considered.
        targets: usize,
        /// Requested offsets of the neighbours, in frames.
        offsets: Vec<i32>,
        /// Requested movement per step of an offset, in metres; 0 for none.
        frame_distance_m: f64,
        /// Number of frames without such a neighbour.
        no_neighbour: usize,
        /// Number of frames with time stamps out of order.
        bad_time: usize,
        /// Number of frames without a speed measured around their time.
        no_motion: usize,
    },
    /// A LiDAR scan cannot be read.
    #[error(transparent)]
    Cloud(#[from] deepfusion_geometry::cloud::Error),
    /// An array file cannot be written.
    #[error("{}: {problem}", path.display())]
    Array {
        /// Path of the file.
        path: PathBuf,
        /// What went wrong.
        #[source]
        problem: ArrayProblem,
    },
    /// A recording has no measured depth to compute ground truth from.
    #[error("{}: {}, but no scan or depth image for any", path.display(), count_of(*frames, "frame"))]
    NoScans {
        /// Path of the recording.
        path: PathBuf,
        /// Number of frames considered.
        frames: usize,
    },
    /// Something that must have the image's size has another.
    #[error("{what} is {}x{}, but the image is {}x{}", found.0, found.1, image.0, image.1)]
    Size {
        /// What differs from the image.
        what: &'static str,
        /// Its width and height, in pixels.
        found: (u32, u32),
        /// Width and height of the image, in pixels.
        image: (u32, u32),
    },
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl From<deepfusion_images::Error> for Error {
    fn from(error: deepfusion_images::Error) -> Self {
        use deepfusion_images::Error as Images;
        match error {
            Images::File(error) => Self::File(error),
            Images::Image { path, problem } => Self::Image {
                path,
                problem: problem.into(),
            },
            other => Self::ImageFile(other),
        }
    }
}

impl From<deepfusion_video::Error> for Error {
    fn from(error: deepfusion_video::Error) -> Self {
        use deepfusion_video::Error as Video;
        match error {
            Video::File { path, source } => Self::file(&path, source),
            other => Self::Video(other),
        }
    }
}

impl Error {
    /// An error of the operating system at `path`.
    #[must_use]
    pub fn file(path: &Path, source: std::io::Error) -> Self {
        FileError::new(path, source).into()
    }

    /// The same error with `to` in place of `from` in its path: the temporary file no longer exists when the message is read.
    pub(crate) fn moved(self, from: &Path, to: &Path) -> Self {
        match self {
            Self::File(error) => Self::File(error.moved(from, to)),
            other => other,
        }
    }

    /// Whether a ROS 2 bag was given to a program built without its reader (the feature `ros2`).
    #[must_use]
    pub fn needs_ros2(&self) -> bool {
        let unread = |found: &FoundInstead| cfg!(not(feature = "ros2")) && found.has_ros2_bags();
        matches!(self, Self::UnknownLayout { found, .. } if unread(found))
    }
}

/// Says that none of a split's frames exists.
fn none_is(entries: usize) -> String {
    match entries {
        1 => "its only frame is not".to_owned(),
        _ => format!("none of its {entries} frames is"),
    }
}

/// Seconds, rounded to milliseconds.
fn in_ms(seconds: f64) -> f64 {
    (seconds * 1e3).round() / 1e3
}

/// The requested distance between the frames of a step, if any.
fn a_step(frame_distance_m: f64) -> String {
    if frame_distance_m > 0.0 {
        format!(", {frame_distance_m} m a step")
    } else {
        String::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error_with_a_hint() {
        use std::fs::File;
        use std::io::{BufWriter, Write};
        // Every write to /dev/full fails.
        let mut out = BufWriter::new(File::options().write(true).open("/dev/full").unwrap());
        out.write_all(b"x").unwrap();
        let error = Error::file(Path::new("depth.npz"), out.flush().unwrap_err());
        assert!(error.hint().unwrap().contains("full"), "{error}");
    }

    #[test]
    fn clocks_are_shown_in_milliseconds() {
        let error = Error::Clocks {
            path: "speed.csv".into(),
            times_s: (1_000.000_000_000_000_1, 1009.32),
            frames_s: (0.0, 4.0404),
        };
        assert_eq!(
            error.to_string(),
            "speed.csv: its times (1000 to 1009.32 s) do not overlap with the frames' (0 to 4.04 s)"
        );
    }

    #[test]
    fn a_split_with_one_frame_has_a_singular_message() {
        let of = |entries| Error::SplitSelectsNothing {
            split: "split.txt".into(),
            path: "drive".into(),
            entries,
            first: "a 1 l".into(),
        };
        assert_eq!(
            of(1).to_string(),
            "split.txt: its only frame is not in drive (first entry: a 1 l)"
        );
        assert_eq!(
            of(2).to_string(),
            "split.txt: none of its 2 frames is in drive (first entry: a 1 l)"
        );
    }
}
