//! What to do about each error.

use super::{ConfigProblem, Error, FoundInstead};
use crate::{DatasetKind, ImageProblem, NamedTopic};
use deepfusion_hint::Hint;

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::File(error) => return error.hint(),
            Self::UnknownLayout { .. } if self.needs_ros2() => {
                "build with the feature `ros2` to read ROS 2 bags, and with `ros2-sqlite` for .db3 files"
            }
            Self::UnknownLayout {
                found: FoundInstead::PartOf { drive },
                ..
            } => return Some(format!("give the drive: {}", drive.display())),
            Self::UnknownLayout {
                found: FoundInstead::Empty,
                ..
            } => "give the folder or the file of a recording",
            Self::UnknownLayout { .. } => {
                concat!(
                    "give the folder or the video file itself; the layouts are described in ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/blob/main/docs/reference/layouts.md"
                )
            }
            Self::FolderOfRecordings { path, such_as, .. } => {
                let (all, one) = (path.display(), such_as.display());
                return Some(format!(
                    "give one of them, such as {one}; where several recordings are accepted, give {all}/*, or the folder after setting \
                     for_folders = true in {all}/dataset.toml"
                ));
            }
            Self::Exists { .. } => "choose another path, or remove it first",
            Self::Unfinished(error) => return error.hint(),
            Self::Stopped { .. } => "start it again: nothing was left behind",
            Self::Cameras { .. } => "convert each into a folder of its own",
            Self::NoTimes { .. } => "add timestamps.txt, or set fps in dataset.toml",
            Self::Bag(error) => return error.hint(),
            Self::ImageFile(error) => return error.hint(),
            Self::Video(error) => return error.hint(),
            Self::Log(error) => return error.hint(),
            Self::Motion { source, .. } => return source.hint(),
            Self::InertialUnit { source, config, .. } => {
                let hint = source.hint().map_or_else(String::new, |hint| hint + "; ");
                let (none, config) = (NamedTopic::NONE, config.display());
                return Some(format!(
                    "{hint}to read the bag without the unit, set imu = \"{none}\" under [topics] in {config}"
                ));
            }
            Self::NotABag { .. } => {
                concat!(
                    "for folders and videos, write dataset.toml instead: ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/blob/main/docs/reference/dataset-toml.md"
                )
            }
            Self::NoTopics { .. } => "name topics only for bags",
            Self::OneCamera { .. } => "choose camera 2",
            Self::NoCameraFile {
                layout: DatasetKind::RgbD,
                ..
            } => {
                "put camera-intrinsics.txt there; for 7-Scenes' 640x480 images, set intrinsics = [585, 585, 320, 240] in dataset.toml \
                 (the published values)"
            }
            Self::NoCameraFile {
                layout: DatasetKind::Comma2k19,
                ..
            } => {
                "set intrinsics = [910, 910, 582, 437] in dataset.toml, as comma2k19's own code does for its 1164x874 videos"
            }
            Self::NoCameraFile { .. } => {
                "set hfov_deg = 70 (its horizontal field of view in degrees) or intrinsics = [fx, fy, cx, cy] in dataset.toml, or add \
                 calibration.yaml or intrinsics.txt"
            }
            Self::NoPlaceForFrames { video, .. } => {
                return Some(format!(
                    "give a folder of your own instead, with video = \"{}\" and cache = \"FOLDER\" (a writable one) in its dataset.toml",
                    video.display()
                ));
            }
            Self::NoBagCamera { config, .. } => {
                return Some(format!(
                    "add [camera] with fx, fy, cx, cy, width, height, or with calibration = \"camera.yaml\", to {}",
                    config.display()
                ));
            }
            Self::OwnCalibration { .. } => "open it without another calibration",
            Self::CameraFile { problem, .. } => return Some(problem.hint()),
            Self::Columns { problem, .. } => return Some(problem.hint()),
            Self::Topic { problem, .. } => return Some(problem.hint()),
            Self::Frames { problem, .. } => return Some(problem.hint()),
            Self::NoTrack { reason, .. } => reason.hint(),
            Self::NoFrames { reason, .. } => reason.hint(),
            Self::NoSegmentVideo { .. } => "fetch video.hevc of the segment",
            Self::Config {
                problem: ConfigProblem::SeveralVideos { .. },
                ..
            } => "give the video's path, or set video = \"NAME\" in dataset.toml",
            Self::Config {
                problem: ConfigProblem::SeveralTracks { .. },
                ..
            } => "set speed = \"NAME\" in dataset.toml",
            Self::Config {
                problem: ConfigProblem::ImagesAndVideo { .. },
                ..
            } => "set images = \"FOLDER\" or video = \"NAME\" in dataset.toml",
            Self::Config { .. } => {
                concat!(
                    "for the keys of dataset.toml and bag.toml, see ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/tree/main/docs/reference"
                )
            }
            Self::Table { .. } | Self::Row { .. } => "correct the row or delete it",
            Self::Clocks { .. } => {
                "make both count from the same moment: set start_s in dataset.toml to the first frame's time on the speeds' clock"
            }
            Self::NoPath { .. } => {
                "use KITTI raw with oxts, or a layout with poses (KITTI odometry, KITTI-360, nuScenes, RGB-D folders)"
            }
            Self::DepthKind { .. } => {
                "use the kind z (camera z), which every recording with depth has"
            }
            Self::Missing { part, .. } => part.hint(),
            Self::NoImages { .. } => {
                "fetch the images, or choose the other camera (2 is left, 3 is right)"
            }
            Self::Image {
                problem: ImageProblem::File(problem),
                ..
            } => problem.hint(),
            Self::Image {
                problem: ImageProblem::NotDepth,
                ..
            } => "give depth images as 16-bit grey PNG",
            Self::Image { .. } => "replace it with a PNG or JPEG image, or leave it out",
            Self::FrameSize { .. } => {
                "use the images and the calibration of one recording; resized images need their own calibration"
            }
            Self::Calibration { .. } => {
                "use the calibration files that belong to the recording (KITTI raw: those of the drive's date)"
            }
            Self::Json { .. } => "unpack the data set's metadata (v1.0-*_meta.tgz) again",
            Self::SeveralVersions { .. } => "give the folder of one of them",
            Self::Pose { .. } => {
                "fetch the poses again: each line has the upper three rows of world_from_camera or world_from_vehicle (12 numbers), in \
                 KITTI-360 after the frame's number"
            }
            Self::TimeStamp { .. } => {
                "write one line per frame, such as 2011-09-26 13:04:32.345808896 (or 12.345, except for KITTI raw)"
            }
            Self::NoTimeStamp { .. } => {
                "fetch the file again: it should have a line for every frame of the drive, starting with frame 0"
            }
            Self::Oxts { .. } => {
                "repair the file (oxts/dataformat.txt describes the 30 numbers), or delete it to leave this sample out"
            }
            Self::Tracklets { .. } => {
                "fetch the drive's tracklets again, or move the file away to evaluate without them"
            }
            Self::Split { .. } => {
                "write lines such as 2011_09_26/2011_09_26_drive_0009_sync 16 l, or scenario = garage"
            }
            Self::SplitSelectsNothing { .. } => {
                "give the folder with the dates that the split names, and the camera of its side (l or r)"
            }
            Self::Offsets { .. } => "use [1] for pairs or [-1, 1] for three frames",
            Self::OneFrame { .. } => "train on a longer drive; this one can only be evaluated on",
            Self::Standing { .. } => {
                "leave out the drive, since a camera standing still shows no parallax; if it did move, correct its speeds, or lower \
                 min_speed_mps in the training's configuration"
            }
            Self::NoPairs {
                frame_distance_m, ..
            } if *frame_distance_m > 0.0 => {
                "lower frame_distance_m or the offsets: the drive is too short for frames this far apart"
            }
            Self::NoPairs { .. } => {
                "train on a drive with consecutive frames, and speeds at least every 0.5 s around their times"
            }
            Self::Cloud(inner) => return inner.hint(),
            Self::Array { .. } => "check the free space and the permissions of the folder",
            Self::NoScans { .. } => {
                "fetch the scans (KITTI raw: velodyne_points/data/<frame>.bin), or set depth in dataset.toml to a folder of depth images"
            }
            Self::Size { .. } => return None,
        };
        Some(text.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pages are named by URL, because users with only the program do not have the repository's files.
    #[test]
    fn pages_are_named_by_url() {
        let path = "x".into();
        let unknown = Error::UnknownLayout {
            path,
            found: FoundInstead::File,
        };
        let hint = unknown.hint().unwrap();
        assert!(
            hint.contains("https://") && !hint.contains(" docs/"),
            "{hint}"
        );
    }

    #[test]
    fn the_hint_for_a_depth_image_asks_for_16_bits() {
        let image = Error::Image {
            path: "depth/0.png".into(),
            problem: ImageProblem::NotDepth,
        };
        let hint = image.hint().unwrap();
        assert!(hint.contains("16-bit grey PNG"), "{hint}");
    }
}
