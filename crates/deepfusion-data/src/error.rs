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
    /// The path holds something, but nothing that is known.
    #[error(
        "{}: no recording of a known layout: {found}\nlooked for, and not there:\n{LOOKED_FOR}",
        path.display()
    )]
    UnknownLayout {
        /// The path given.
        path: PathBuf,
        /// What is there instead.
        found: FoundInstead,
    },
    /// The folder is no recording, but holds some.
    #[error("{}: no recording by itself: it holds {} (such as {})", path.display(), count_of(*count, "recording"), such_as.display())]
    FolderOfRecordings {
        /// The folder.
        path: PathBuf,
        /// How many recordings lie directly in it.
        count: usize,
        /// The first of them.
        such_as: PathBuf,
    },
    /// A part of the recording that is needed is not there.
    #[error("{}: missing, it holds {part}", path.display())]
    Missing {
        /// Where it should be.
        path: PathBuf,
        /// What it would hold.
        part: MissingPart,
    },
    /// No drive has an image of the camera.
    #[error("{}: no image of camera {camera} (<number>.png or .jpg)", path.display())]
    NoImages {
        /// Where they should be.
        path: PathBuf,
        /// The camera's number.
        camera: u8,
    },
    /// What else can go wrong with an image's file.
    #[error(transparent)]
    ImageFile(deepfusion_images::Error),
    /// An image cannot be read.
    #[error("{}: {problem}", path.display())]
    Image {
        /// The image.
        path: PathBuf,
        /// Why not.
        #[source]
        problem: ImageProblem,
    },
    /// An image has another size than its camera's calibration.
    #[error(
        "{image}: frame {frame} of {drive} is {}x{}, its calibration says {}x{} ({field} in {})",
        found.0, found.1, expected.0, expected.1, calibration
    )]
    FrameSize {
        /// The image.
        image: String,
        /// Its drive.
        drive: String,
        /// Its frame number.
        frame: u64,
        /// Its width and height.
        found: (u32, u32),
        /// The calibration's.
        expected: (u32, u32),
        /// The field that says so.
        field: &'static str,
        /// What said it.
        calibration: CalibrationSource,
    },
    /// Another camera is asked for than the only one there is.
    #[error("{}: there is one camera, which counts as camera 2", path.display())]
    OneCamera {
        /// The recording.
        path: PathBuf,
    },
    /// A camera's calibration file cannot be used.
    #[error("{by}: {problem}")]
    CameraFile {
        /// The file, or who else says the camera.
        by: CalibrationSource,
        /// Why not.
        #[source]
        problem: CameraProblem,
    },
    /// Nothing says what the camera of images in files is.
    #[error("{}: nothing says what its camera is", path.display())]
    NoCameraFile {
        /// The folder in which a calibration is looked for first.
        path: PathBuf,
        /// The layout.
        layout: DatasetKind,
    },
    /// There is no folder into which a video's frames can be decoded.
    #[error(
        "{}: its frames cannot be decoded: neither its folder nor the user's cache folder can be written",
        video.display()
    )]
    NoPlaceForFrames {
        /// The video.
        video: PathBuf,
        /// What the system said of its folder.
        source: std::io::Error,
    },
    /// Neither a bag nor the file beside it says what the camera is.
    #[error("{}: nothing says what the camera is: no CameraInfo with a K", path.display())]
    NoBagCamera {
        /// The bag.
        path: PathBuf,
        /// The file beside it, which may say it.
        config: PathBuf,
    },
    /// Intrinsics given for a layout that has its own.
    #[error("{}: {layout} brings its own calibration", path.display())]
    OwnCalibration {
        /// The recording.
        path: PathBuf,
        /// Its layout.
        layout: &'static str,
    },
    /// A table of JSON cannot be read, or names a row that another table has not.
    #[error("{}:{line}: {field}: {problem}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// The field.
        field: String,
        /// What is wrong with it.
        #[source]
        problem: JsonProblem,
    },
    /// A root holds several sets of tables, of which some tell of the same drives.
    #[error("{}: holds {}", path.display(), versions.join(", "))]
    SeveralVersions {
        /// The root.
        path: PathBuf,
        /// The folders of tables.
        versions: Vec<String>,
    },
    /// A line of a file of poses cannot be read.
    #[error("{}:{line}: {field}: {problem}", path.display())]
    Pose {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// Which number of the line, or all of it.
        field: PoseField,
        /// What is wrong with it.
        #[source]
        problem: PoseProblem,
    },
    /// A `dataset.toml` cannot be used.
    #[error("{}: {problem}", path.display())]
    Config {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        #[source]
        problem: ConfigProblem,
    },
    /// A value of a table cannot be used.
    #[error("{}:{line}: column {column}: {problem}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1, the header's included.
        line: u64,
        /// The column's name, or its number counted from 1.
        column: String,
        /// What is wrong with the value.
        #[source]
        problem: TableProblem,
    },
    /// A log of a vehicle's, a receiver's or an app's cannot be used.
    #[error(transparent)]
    Log(#[from] deepfusion_logs::Error),
    /// A table lacks a column, or nothing says its unit.
    #[error("{}: {problem}", path.display())]
    Columns {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        #[source]
        problem: ColumnsProblem,
    },
    /// Two clocks have no time in common.
    #[error(
        "{}: its times ({} to {} s) have none in common with the frames' ({} to {} s)",
        path.display(), times_s.0, times_s.1, frames_s.0, frames_s.1
    )]
    Clocks {
        /// The file of speeds.
        path: PathBuf,
        /// Its first and last time, in seconds.
        times_s: (f64, f64),
        /// The frames' first and last time, in seconds.
        frames_s: (f64, f64),
    },
    /// A layout without speeds cannot give ego-motion.
    #[error("{drive}: {reason}")]
    NoTrack {
        /// The drive.
        drive: String,
        /// What is missing.
        #[source]
        reason: NoTrackReason,
    },
    /// Nobody measured where the camera went.
    #[error("{drive}: a recording of this layout ({layout}) holds no path of the camera")]
    NoPath {
        /// The drive.
        drive: String,
        /// The layout.
        layout: &'static str,
    },
    /// Ground truth of a kind that the recording cannot have.
    #[error("{drive}: it has no ground truth of the kind \"{}\"", kind.name())]
    DepthKind {
        /// The drive.
        drive: String,
        /// What was asked for.
        kind: GtKind,
    },
    /// A ROS bag cannot be read.
    #[error(transparent)]
    Bag(#[from] deepfusion_rosbag::Error),
    /// A bag's topics are not what is needed.
    #[error("{}: {problem}", path.display())]
    Topic {
        /// The bag.
        path: PathBuf,
        /// Why not.
        #[source]
        problem: Box<TopicProblem>,
        /// A role and a topic that it could be named for, as a caller may too ([`crate::OpenOptions::topics`]).
        choice: Option<NamedTopic>,
    },
    /// A topic was named for a recording that has none.
    #[error("{}: {topic}: {layout} has no topics", path.display())]
    NoTopics {
        /// The recording.
        path: PathBuf,
        /// Its layout.
        layout: &'static str,
        /// The topic.
        topic: NamedTopic,
    },
    /// A bag was needed.
    #[error("{}: it is no ROS bag but of the layout {layout}", path.display())]
    NotABag {
        /// The recording.
        path: PathBuf,
        /// Its layout.
        layout: &'static str,
    },
    /// The transforms of a bag's frames do not say where a sensor is, and contradict each other.
    #[error("{}: {problem}", path.display())]
    Frames {
        /// The bag.
        path: PathBuf,
        /// What contradicts what.
        #[source]
        problem: FramesProblem,
    },
    /// A vehicle's sensors make no motion.
    #[error("{}: {source}", path.display())]
    Motion {
        /// The recording.
        path: PathBuf,
        /// Why not.
        source: deepfusion_motion::Error,
    },
    /// A bag's inertial unit cannot be read as it is mounted, or not at all.
    #[error("{}: {source}", path.display())]
    InertialUnit {
        /// The bag.
        path: PathBuf,
        /// Why not.
        source: Box<deepfusion_motion::Error>,
        /// The file beside the bag, which may leave the unit out.
        config: PathBuf,
    },
    /// Something is there already where something is to be written.
    #[error("{}: already exists", path.display())]
    Exists {
        /// The file, or the folder that is not empty.
        path: PathBuf,
    },
    /// The folder for a converted recording looks empty, and another writer is at work there, or died and what it left cannot be removed.
    #[error(transparent)]
    Unfinished(#[from] deepfusion_fs::Unfinished),
    /// A conversion ended before the last frame, as its caller wanted: nothing of it is left.
    #[error("nothing is written: stopped after {done} of {}", count_of(*total, "frame"))]
    Stopped {
        /// Frames done.
        done: usize,
        /// Frames in all.
        total: usize,
    },
    /// Recordings of different cameras cannot be drives of one date.
    #[error("{first} and {other} have different cameras, and a KITTI date has one calibration")]
    Cameras {
        /// A recording.
        first: String,
        /// One with another camera, or another place of it.
        other: String,
    },
    /// A frame without a time.
    #[error("{drive}: frame {frame} has no time, and a bag is ordered by time")]
    NoTimes {
        /// The drive.
        drive: String,
        /// The frame's number.
        frame: u64,
    },
    /// A segment of comma2k19 that has streams, but no video.
    #[error("{}: the segment's images are absent", path.display())]
    NoSegmentVideo {
        /// The video.
        path: PathBuf,
    },
    /// A recording that has streams, but no images.
    #[error("{}: {reason}", path.display())]
    NoFrames {
        /// The recording.
        path: PathBuf,
        /// Why it has none.
        #[source]
        reason: NoFramesReason,
    },
    /// A video cannot be read, or ffmpeg is not there to read it.
    #[error(transparent)]
    Video(deepfusion_video::Error),
    /// A calibration file lacks a field or has a bad one.
    #[error("{}: {field}: {problem}", path.display())]
    Calibration {
        /// The file.
        path: PathBuf,
        /// The field, such as `P_rect_02`.
        field: String,
        /// What is wrong with it.
        #[source]
        problem: CalibrationProblem,
    },
    /// A line of a time stamp file cannot be read.
    #[error("{}:{line}: {problem}", path.display())]
    TimeStamp {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong with it.
        #[source]
        problem: TimeStampProblem,
    },
    /// A frame has no line in the time stamp file.
    #[error(
        "{}: has {} (frames 0 to {}), but there is a frame {frame}",
        path.display(), count_of(*lines, "time stamp"), lines.saturating_sub(1)
    )]
    NoTimeStamp {
        /// The file.
        path: PathBuf,
        /// How many time stamps it has.
        lines: usize,
        /// The frame without one.
        frame: u64,
    },
    /// An OXTS packet cannot be read.
    #[error("{}: {field}: {problem}", path.display())]
    Oxts {
        /// The packet's file.
        path: PathBuf,
        /// The field.
        field: OxtsField,
        /// What is wrong with it.
        #[source]
        problem: OxtsProblem,
    },
    /// A file of tracklets cannot be read.
    #[error("{}: {place}: {problem}", path.display())]
    Tracklets {
        /// The file.
        path: PathBuf,
        /// Where in it.
        place: TrackletPlace,
        /// What is wrong there.
        #[source]
        problem: TrackletsProblem,
    },
    /// A split file's line cannot be read.
    #[error("{}:{line}: {problem}", path.display())]
    Split {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong with it.
        #[source]
        problem: SplitProblem,
    },
    /// A split selects no frame of the recording.
    #[error(
        "{}: {} in {} (it begins with {first})",
        split.display(), none_is(*entries), path.display()
    )]
    SplitSelectsNothing {
        /// The split file.
        split: PathBuf,
        /// The recording.
        path: PathBuf,
        /// How many frames the split names.
        entries: usize,
        /// The first of them.
        first: String,
    },
    /// Frame offsets that make no pair.
    #[error("frame offsets {offsets:?}: expected at least one, none of them 0, none twice")]
    Offsets {
        /// The offsets given.
        offsets: Vec<i32>,
    },
    /// A drive of a single frame has no pairs.
    #[error("{drive}: only frame {frame} is there, and a pair needs two consecutive frames")]
    OneFrame {
        /// The drive.
        drive: String,
        /// The number of its frame.
        frame: u64,
    },
    /// The car never moves.
    #[error(
        "{drive}: the car stands: {}, the fastest at {fastest_mps:.2} m/s, \
         none reaches {min_speed_mps} m/s",
        count_of(*pairs, "pair")
    )]
    Standing {
        /// The drive.
        drive: String,
        /// How many pairs were looked at.
        pairs: usize,
        /// Mean speed of the fastest.
        fastest_mps: f64,
        /// The speed asked for.
        min_speed_mps: f64,
    },
    /// No pair is left, for the reasons counted.
    #[error(
        "{drive}: no pair of frames can be used: of {}, {no_neighbour} without a neighbour \
         at offsets {offsets:?}{}, {bad_time} with time stamps that do not increase, {no_motion} not covered by the speeds (oxts, speed.csv)",
        count_of(*targets, "frame"),
        a_step(*frame_distance_m)
    )]
    NoPairs {
        /// The drive.
        drive: String,
        /// How many frames were looked at.
        targets: usize,
        /// The offsets of the neighbours asked for.
        offsets: Vec<i32>,
        /// Metres that each step of an offset was asked to have moved; 0: none.
        frame_distance_m: f64,
        /// How many have no such neighbour.
        no_neighbour: usize,
        /// How many have time stamps out of order.
        bad_time: usize,
        /// How many have no speed measured about their time.
        no_motion: usize,
    },
    /// A velodyne scan cannot be read.
    #[error(transparent)]
    Cloud(#[from] deepfusion_geometry::cloud::Error),
    /// An array file cannot be written.
    #[error("{}: {problem}", path.display())]
    Array {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        #[source]
        problem: ArrayProblem,
    },
    /// A recording has no scan to make ground truth from.
    #[error("{}: no velodyne scan belongs to any of its frames ({frames})", path.display())]
    NoScans {
        /// The recording.
        path: PathBuf,
        /// How many frames were looked at.
        frames: usize,
    },
    /// Two things that must have one size differ.
    #[error("{what} is {}x{}, the image {}x{}", found.0, found.1, image.0, image.1)]
    Size {
        /// What differs from the image.
        what: &'static str,
        /// Its width and height.
        found: (u32, u32),
        /// The image's.
        image: (u32, u32),
    },
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// The layouts that are told apart, in the order in which they are looked for.
const LOOKED_FOR: &str = "  KITTI raw          image_02/ or image_03/ with data/0000000000.png, here or up to two folders below
  KITTI odometry     sequences/00/ with image_2/000000.png, calib.txt and times.txt, or such a sequence
  KITTI-360          data_2d_raw/<drive>/image_00/data_rect/0000000000.png, or such a drive
  nuScenes           v1.0-mini/ (or -trainval, -test) with sample_data.json, samples/CAM_FRONT beside it
  comma2k19 segment  processed_log/CAN/speed/t or global_pose/frame_times
  ROS bag            a file .bag, .mcap or .db3, or a folder with metadata.yaml, given or here
  RGB-D folder       frame-000000.color.png or .jpg with .depth.png, here or in folders seq-01, …
  video              a file .mp4, .mkv, .mov, .avi, .hevc, .m4v or .webm, given or the only one here
  image folder       .png or .jpg files here, in images/, or where dataset.toml says";

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
    /// An error of the system's at `path`.
    #[must_use]
    pub fn file(path: &Path, source: std::io::Error) -> Self {
        FileError::new(path, source).into()
    }

    /// The same error with `to` in place of `from` in the path that it names: what was written aside is gone when it is read.
    pub(crate) fn moved(self, from: &Path, to: &Path) -> Self {
        match self {
            Self::File(error) => Self::File(error.moved(from, to)),
            other => other,
        }
    }

    /// Whether a bag of ROS 2 was given, and this program was built without its reader (the feature `ros2`).
    #[must_use]
    pub fn needs_ros2(&self) -> bool {
        let unread = |found: &FoundInstead| cfg!(not(feature = "ros2")) && found.has_ros2_bags();
        matches!(self, Self::UnknownLayout { found, .. } if unread(found))
    }
}

/// That none of a split's frames is there.
fn none_is(entries: usize) -> String {
    match entries {
        1 => "its only frame is not".to_owned(),
        _ => format!("none of its {entries} frames is"),
    }
}

/// How far apart the frames of a step were to be, if they were.
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
        // /dev/full takes no byte.
        let mut out = BufWriter::new(File::options().write(true).open("/dev/full").unwrap());
        out.write_all(b"x").unwrap();
        let error = Error::file(Path::new("depth.npz"), out.flush().unwrap_err());
        assert!(error.hint().unwrap().contains("full"), "{error}");
    }

    #[test]
    fn every_ending_of_a_video_is_named() {
        for ending in deepfusion_video::VIDEO_ENDINGS {
            let named = LOOKED_FOR
                .split([' ', ','])
                .any(|word| word == format!(".{ending}"));
            assert!(named, "{ending}");
        }
    }

    #[test]
    fn one_frame_is_no_plural() {
        let of = |entries| Error::SplitSelectsNothing {
            split: "split.txt".into(),
            path: "drive".into(),
            entries,
            first: "a 1 l".into(),
        };
        assert_eq!(
            of(1).to_string(),
            "split.txt: its only frame is not in drive (it begins with a 1 l)"
        );
        assert_eq!(
            of(2).to_string(),
            "split.txt: none of its 2 frames is in drive (it begins with a 1 l)"
        );
    }
}
