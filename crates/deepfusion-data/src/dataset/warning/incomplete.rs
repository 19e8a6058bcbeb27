//! Warnings about what is left out, missing or unreadable.

use crate::DatasetKind;
use deepfusion_hint::count_of;
use deepfusion_rosbag::SourceDamage;
use std::path::{Path, PathBuf};

/// A warning about what is left out, missing or unreadable in a recording or its folder.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum IncompleteWarning {
    /// Some of several recordings have no images.
    #[error("left out for lack of images{}: {}", of_camera(*camera), recordings.join(", "))]
    NoImages {
        /// Number of the camera whose images are missing, if the layout has camera numbers.
        camera: Option<u8>,
        /// The recordings' names.
        recordings: Vec<String>,
    },
    /// Something in the folder looks like a recording but is not read ([`crate::Dataset::passed_over`]).
    #[error("{}", passed_over(folder, *layout, recordings))]
    PassedOver {
        /// Path of the folder.
        folder: PathBuf,
        /// The layout as which it is read.
        layout: DatasetKind,
        /// The names of what is not read, sorted.
        recordings: Vec<String>,
    },
    /// Image files listed in the tables are missing.
    #[error(
        "{missing} of {} {} missing{} {such_as}",
        count_of(*of, "image"),
        if *missing == 1 { "is" } else { "are" },
        if *missing == 1 { ":" } else { ", such as" }
    )]
    ImagesMissing {
        /// Number of missing images.
        missing: usize,
        /// Number of listed images.
        of: usize,
        /// Path of the first missing image.
        such_as: String,
    },
    /// A table does not list all images.
    #[error("{table}: {} not listed", count_of(*images, "image"))]
    ImagesUnlisted {
        /// The table's name.
        table: &'static str,
        /// Number of images that are not listed.
        images: usize,
    },
    /// The recording of a video stream does not start with a key frame.
    #[error(
        "{topic}: the first {} before the first key frame and cannot be decoded: {} left out",
        messages_come(*messages),
        if *messages == 1 { "it is" } else { "they are" }
    )]
    BeforeKeyFrame {
        /// Name of the stream's topic.
        topic: String,
        /// Number of messages before its first key frame.
        messages: u64,
    },
    /// A bag is damaged, according to its reader ([`deepfusion_rosbag::MessageSource::damage`]).
    #[error("the bag is damaged: {0}")]
    Damaged(SourceDamage),
    /// Messages or chunks of a bag cannot be read.
    #[error("{}", unreadable(*parts, first))]
    Unreadable {
        /// Number of unreadable messages and chunks.
        parts: usize,
        /// Message of the first error.
        first: String,
    },
}

fn of_camera(camera: Option<u8>) -> String {
    camera.map_or_else(String::new, |number| format!(" of camera {number}"))
}

fn passed_over(folder: &Path, layout: DatasetKind, recordings: &[String]) -> String {
    /// How many names are listed.
    const MAX_LISTED: usize = 6;
    let listed = recordings
        .get(..MAX_LISTED)
        .unwrap_or(recordings)
        .join(", ");
    let more = match recordings.len().checked_sub(MAX_LISTED) {
        None | Some(0) => String::new(),
        Some(more) => format!(" and {more} more"),
    };
    let (are, each) = if recordings.len() == 1 {
        ("looks like a recording and is", "it")
    } else {
        ("look like recordings and are", "each")
    };
    format!(
        "{} is read only as {}; {listed}{more} in it {are} not read (give {each} by its own path)",
        folder.display(),
        with_article(layout)
    )
}

/// The layout's name, with an article unless it is a proper name.
fn with_article(layout: DatasetKind) -> String {
    let label = layout.label();
    match layout {
        DatasetKind::KittiRaw
        | DatasetKind::KittiOdometry
        | DatasetKind::Kitti360
        | DatasetKind::NuScenes => label.to_owned(),
        DatasetKind::Folder | DatasetKind::RgbD => format!("an {label}"),
        DatasetKind::Video | DatasetKind::Comma2k19 | DatasetKind::Bag | DatasetKind::Other => {
            format!("a {label}")
        }
    }
}

fn messages_come(messages: u64) -> String {
    match messages {
        1 => "message comes".to_owned(),
        n => format!("{n} messages come"),
    }
}

fn unreadable(parts: usize, first: &str) -> String {
    match parts {
        1 => format!("1 message or chunk cannot be read: {first}"),
        n => format!("{n} messages or chunks cannot be read; the first: {first}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(count: usize) -> Vec<String> {
        (1..=count).map(|n| format!("drive{n}.bag")).collect()
    }

    #[test]
    fn recordings_that_are_passed_over_are_listed_up_to_a_limit() {
        let message = |count| {
            let passed_over = IncompleteWarning::PassedOver {
                folder: "drives".into(),
                layout: DatasetKind::Folder,
                recordings: names(count),
            };
            passed_over.to_string()
        };
        assert_eq!(
            message(1),
            "drives is read only as an image folder; drive1.bag in it looks like a recording and is not read (give it by its own path)"
        );
        let these = "drives is read only as an image folder; drive1.bag, drive2.bag";
        let each = "in it look like recordings and are not read (give each by its own path)";
        assert_eq!(message(2), format!("{these} {each}"));
        let six = format!("{these}, drive3.bag, drive4.bag, drive5.bag, drive6.bag");
        assert_eq!(message(6), format!("{six} {each}"));
        assert_eq!(message(8), format!("{six} and 2 more {each}"));
    }

    #[test]
    fn messages_count_what_is_missing() {
        let no_images = |camera| IncompleteWarning::NoImages {
            camera,
            recordings: names(2),
        };
        let before = |messages| IncompleteWarning::BeforeKeyFrame {
            topic: "/camera".into(),
            messages,
        };
        let unreadable = |parts| IncompleteWarning::Unreadable {
            parts,
            first: "drive.bag: the chunk at byte 7 is too short".into(),
        };
        for (warning, expected) in [
            (
                no_images(None),
                "left out for lack of images: drive1.bag, drive2.bag",
            ),
            (
                no_images(Some(2)),
                "left out for lack of images of camera 2: drive1.bag, drive2.bag",
            ),
            (
                IncompleteWarning::ImagesMissing {
                    missing: 6,
                    of: 8,
                    such_as: "sweeps/CAM_FRONT/1.jpg".into(),
                },
                "6 of 8 images are missing, such as sweeps/CAM_FRONT/1.jpg",
            ),
            (
                IncompleteWarning::ImagesMissing {
                    missing: 1,
                    of: 8,
                    such_as: "sweeps/CAM_FRONT/1.jpg".into(),
                },
                "1 of 8 images is missing: sweeps/CAM_FRONT/1.jpg",
            ),
            (
                IncompleteWarning::ImagesUnlisted {
                    table: "frames.csv",
                    images: 2,
                },
                "frames.csv: 2 images not listed",
            ),
            (
                before(1),
                "/camera: the first message comes before the first key frame and cannot be decoded: it is left out",
            ),
            (
                before(9),
                "/camera: the first 9 messages come before the first key frame and cannot be decoded: they are left out",
            ),
            (
                unreadable(1),
                "1 message or chunk cannot be read: drive.bag: the chunk at byte 7 is too short",
            ),
            (
                unreadable(2),
                "2 messages or chunks cannot be read; the first: drive.bag: the chunk at byte 7 is too short",
            ),
        ] {
            assert_eq!(warning.to_string(), expected);
        }
    }
}
