//! What to do about each error.

use super::{Error, FoundInstead};
use crate::{DatasetKind, ImageProblem, NamedTopic};
use deepfusion_hint::Hint;

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::File(error) => return error.hint(),
            Self::UnknownLayout { .. } if self.needs_ros2() => {
                "build with the feature `ros2` to read the bags of ROS 2, with `ros2-sqlite` those with .db3 files"
            }
            Self::UnknownLayout {
                found: FoundInstead::PartOf { drive },
                ..
            } => return Some(format!("give the drive: {}", drive.display())),
            Self::UnknownLayout { .. } => {
                concat!(
                    "give the folder or the video file itself; each layout is shown in ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/blob/main/docs/guides/train-on-your-own-video.md"
                )
            }
            Self::FolderOfRecordings { path, such_as, .. } => {
                let (all, one) = (path.display(), such_as.display());
                return Some(format!(
                    "give one of them by itself: {one}; where several are taken, all of them: {all}/*, or with for_folders = true in \
                     {all}/dataset.toml the folder"
                ));
            }
            Self::Exists { .. } => "choose another place, or remove it first",
            Self::Unfinished(error) => return error.hint(),
            Self::Stopped { .. } => "start it again: nothing is in the way",
            Self::Cameras { .. } => "convert them one by one, each into a folder of its own",
            Self::NoTimes { .. } => "give the frames times: timestamps.txt, or fps in dataset.toml",
            Self::Bag(error) => return error.hint(),
            Self::ImageFile(error) => return error.hint(),
            Self::Video(error) => return error.hint(),
            Self::Log(error) => return error.hint(),
            Self::Motion { source, .. } => return source.hint(),
            Self::InertialUnit { source, config, .. } => {
                let hint = source.hint().map_or_else(String::new, |hint| hint + "; ");
                let (none, config) = (NamedTopic::NONE, config.display());
                return Some(format!(
                    "{hint}the bag is read without the unit by [topics] imu = \"{none}\" (in {config})"
                ));
            }
            Self::NotABag { .. } => {
                concat!(
                    "only bags have such a file; folders and videos have dataset.toml: ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/blob/main/docs/reference/dataset-toml.md"
                )
            }
            Self::NoTopics { .. } => "name topics for bags alone",
            Self::OneCamera { .. } => "ask for camera 2",
            Self::NoCameraFile {
                layout: DatasetKind::RgbD,
                ..
            } => {
                "put camera-intrinsics.txt there; 7-Scenes publishes 585, 585, 320, 240 for its 640x480 images: \
                 intrinsics = [585, 585, 320, 240] in dataset.toml"
            }
            Self::NoCameraFile {
                layout: DatasetKind::Comma2k19,
                ..
            } => {
                "comma2k19's own code gives 910, 910, 582, 437 for its 1164x874 videos: set \
                 intrinsics = [910, 910, 582, 437] in dataset.toml"
            }
            Self::NoCameraFile { .. } => {
                "write hfov_deg = 70 (the degrees it sees from left to right) or intrinsics = [fx, fy, cx, cy] into dataset.toml there, or \
                 put its calibration file beside it (calibration.yaml, intrinsics.txt)"
            }
            Self::NoPlaceForFrames { video, .. } => {
                return Some(format!(
                    "give, in place of it, a folder of your own whose dataset.toml has video = \"{}\" and cache = \"FOLDER\", one that can be \
                     written",
                    video.display()
                ));
            }
            Self::NoBagCamera { config, .. } => {
                return Some(format!(
                    "write [camera] with fx, fy, cx, cy, width, height, or with calibration = \"camera.yaml\", into {}",
                    config.display()
                ));
            }
            Self::OwnCalibration { .. } => "open it without a camera of your own",
            Self::CameraFile { problem, .. } => return Some(problem.hint()),
            Self::Columns { problem, .. } => return Some(problem.hint()),
            Self::Topic { problem, .. } => return Some(problem.hint()),
            Self::Frames { problem, .. } => return Some(problem.hint()),
            Self::NoTrack { reason, .. } => reason.hint(),
            Self::NoFrames { reason, .. } => reason.hint(),
            Self::NoSegmentVideo { .. } => "fetch video.hevc of the segment",
            Self::Config { .. } => {
                concat!(
                    "every key of dataset.toml and bag.toml is in ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/tree/main/docs/reference"
                )
            }
            Self::Table { .. } => "correct the row or delete it",
            Self::Clocks { .. } => {
                "both must count from the same moment; start_s in dataset.toml is the first frame's time on the speeds' clock"
            }
            Self::NoPath { .. } => {
                "KITTI raw with oxts, and what has poses (KITTI odometry, KITTI-360, nuScenes, RGB-D folders) have one"
            }
            Self::DepthKind { .. } => "camera z (kind z) is what every recording with depth has",
            Self::Missing { part, .. } => part.hint(),
            Self::NoImages { .. } => {
                "fetch the images, or choose the other camera (2 is left, 3 is right)"
            }
            Self::Image {
                problem: ImageProblem::File(problem),
                ..
            } => problem.hint(),
            Self::Image { .. } => "PNG and JPEG are read",
            Self::FrameSize { .. } => {
                "use the images and the calibration of one recording; resized images need their own calibration"
            }
            Self::Calibration { .. } => {
                "take the calibration files that belong to the recording (KITTI raw: those of the drive's own date)"
            }
            Self::Json { .. } => "unpack the data set's metadata (v1.0-*_meta.tgz) again",
            Self::SeveralVersions { .. } => "give the folder of one of them",
            Self::Pose { .. } => {
                "a line has the upper three rows of world_from_camera or world_from_vehicle, 12 numbers, in KITTI-360 after the \
                 frame's number: fetch the poses again"
            }
            Self::TimeStamp { .. } => {
                "lines look like 2011-09-26 13:04:32.345808896 (or, outside of KITTI raw, like 12.345), one for each frame"
            }
            Self::NoTimeStamp { .. } => {
                "the file lists the whole drive, a frame's number being its line counted from 0: fetch it again"
            }
            Self::Oxts { .. } => {
                "a packet is 30 numbers (oxts/dataformat.txt): repair it, or delete the file to leave the sample out"
            }
            Self::Tracklets { .. } => {
                "fetch the drive's tracklets again, or move the file away to evaluate without them"
            }
            Self::Split { .. } => {
                "lines look like: 2011_09_26/2011_09_26_drive_0009_sync 16 l, or: scenario = garage"
            }
            Self::SplitSelectsNothing { .. } => {
                "give the folder that holds the dates named in the split, and the camera its sides ask for"
            }
            Self::Offsets { .. } => "use [1] for pairs or [-1, 1] for three frames",
            Self::OneFrame { .. } => "evaluate on it, but train on a longer drive",
            Self::Standing { .. } => {
                "a standing camera shows no parallax: leave the drive out, or lower min_speed_mps of the training's configuration"
            }
            Self::NoPairs {
                frame_distance_m, ..
            } if *frame_distance_m > 0.0 => {
                "the drive is too short for frames so far apart: lower frame_distance_m, or the offsets"
            }
            Self::NoPairs { .. } => {
                "train on a drive with consecutive frames and speeds about their times, at least every 0.5 s"
            }
            Self::Cloud(inner) => return inner.hint(),
            Self::Array { .. } => "check the free space and the permissions of the folder",
            Self::NoScans { .. } => {
                "velodyne_points/data/<frame>.bin is needed: fetch the drive's velodyne_points"
            }
            Self::Size { .. } => return None,
        };
        Some(text.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A page of the repository is of no use by its path there: who has the program alone does not have it.
    #[test]
    fn pages_are_named_by_their_address() {
        let path = "x".into();
        let unknown = Error::UnknownLayout {
            path,
            found: FoundInstead::Empty,
        };
        let hint = unknown.hint().unwrap();
        assert!(
            hint.contains("https://") && !hint.contains(" docs/"),
            "{hint}"
        );
    }
}
