//! Problems with a frame.

use std::path::PathBuf;

use deepfusion_geometry::ImplausibleCamera;
use deepfusion_hint::count_of;

/// A problem with a frame. The rest of the frame is still shown.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameProblem {
    /// A file cannot be read: the error's text, with the file's path.
    #[error("{0}")]
    Unreadable(String),
    /// A small file does not have the format in which `predict` and `perceive` write it.
    #[error("{file}: not in this program's format: {why}")]
    Foreign {
        /// The file's name.
        file: String,
        /// The parser's error.
        why: String,
    },
    /// The targets' file contains something else.
    #[error("the targets' file has no list of targets")]
    NoTargets,
    /// Targets that cannot be drawn.
    #[error(
        "{undrawable} of {} {} no position or size",
        count_of(*targets, "target"),
        if *undrawable == 1 { "has" } else { "have" }
    )]
    Undrawable {
        /// How many of them cannot be drawn.
        undrawable: usize,
        /// How many targets there are.
        targets: usize,
    },
    /// There is no sidecar.
    #[error("no {frame}.json: the camera is unknown")]
    NoSidecar {
        /// The frame's name.
        frame: String,
    },
    /// The sidecar has no camera.
    #[error("the camera is unknown: no cloud, no boxes on the picture")]
    NoCamera,
    /// The sidecar's camera is invalid.
    #[error("the sidecar's camera is invalid: {0}")]
    Camera(ImplausibleCamera),
    /// The sidecar lacks the image's size.
    #[error("the sidecar lacks the image's size")]
    NoSize,
    /// The frame has no sidecar or other file that names its picture.
    #[error("the picture is unknown")]
    NoPicture,
    /// The picture was moved or removed since depth was predicted from it.
    #[error("{}: the picture no longer exists", .0.display())]
    PictureGone(PathBuf),
    /// The picture is a frame of a video or a bag, and was not saved by itself.
    #[error("{}: the picture is inside this file and was not saved beside the results", .0.display())]
    PictureAmongOthers(PathBuf),
    /// The picture has the lens's distortion, while depth, cloud and boxes do not.
    #[error("{}: not shown: depth is of the undistorted picture, which was not saved", .0.display())]
    Distorted(PathBuf),
    /// The picture's size differs from the sidecar's.
    #[error("the picture is {}, the sidecar says {}", by(*found), by(*expected))]
    PictureSize {
        /// Width and height of the picture.
        found: (u32, u32),
        /// Width and height in the sidecar.
        expected: (u32, u32),
    },
    /// The picture is not the one that depth was predicted from.
    #[error("the picture has changed since its depth was predicted")]
    PictureChanged,
    /// There is no depth.
    #[error("no depth was saved (depth-png or npy)")]
    NoDepth,
    /// Depth's size differs from the sidecar's.
    #[error("depth is {}, the sidecar says {}", by(*found), by(*expected))]
    DepthSize {
        /// Width and height of depth.
        found: (u32, u32),
        /// Width and height in the sidecar.
        expected: (u32, u32),
    },
}

fn by((width, height): (u32, u32)) -> String {
    format!("{width}x{height}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn problems_of_small_files() {
        for (problem, text) in [
            (
                FrameProblem::Foreign {
                    file: "a.json".into(),
                    why: "no size".into(),
                },
                "a.json: not in this program's format: no size",
            ),
            (
                FrameProblem::Undrawable {
                    undrawable: 2,
                    targets: 5,
                },
                "2 of 5 targets have no position or size",
            ),
            (
                FrameProblem::Undrawable {
                    undrawable: 1,
                    targets: 1,
                },
                "1 of 1 target has no position or size",
            ),
            (
                FrameProblem::NoSidecar {
                    frame: "000001".into(),
                },
                "no 000001.json: the camera is unknown",
            ),
            (
                FrameProblem::Camera(ImplausibleCamera::Focal {
                    name: "fx",
                    value: 0.0,
                }),
                "the sidecar's camera is invalid: fx is 0, expected a focal length above 0",
            ),
        ] {
            assert_eq!(problem.to_string(), text);
        }
    }

    #[test]
    fn problems_of_pictures_and_depth() {
        let (found, expected) = ((96, 48), (200, 100));
        for (problem, text) in [
            (
                FrameProblem::PictureGone("drive/1.png".into()),
                "drive/1.png: the picture no longer exists",
            ),
            (
                FrameProblem::PictureAmongOthers("drive.mp4".into()),
                "drive.mp4: the picture is inside this file and was not saved beside the results",
            ),
            (
                FrameProblem::PictureSize { found, expected },
                "the picture is 96x48, the sidecar says 200x100",
            ),
            (
                FrameProblem::DepthSize { found, expected },
                "depth is 96x48, the sidecar says 200x100",
            ),
        ] {
            assert_eq!(problem.to_string(), text);
        }
    }
}
