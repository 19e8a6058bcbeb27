//! What is wrong with a frame.

use std::path::PathBuf;

use deepfusion_geometry::ImplausibleCamera;
use deepfusion_hint::count_of;

/// What is wrong with a frame, of which the rest is shown all the same.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameProblem {
    /// A file cannot be read: the error that this gave, with the file's path.
    #[error("{0}")]
    Unreadable(String),
    /// A small file is not as `predict` and `perceive` write it.
    #[error("{file}: not as this program writes it: {why}")]
    Foreign {
        /// Its name.
        file: String,
        /// What the parser said.
        why: String,
    },
    /// The targets' file is one of something else.
    #[error("the targets' file has no list of targets")]
    NoTargets,
    /// Targets of which nothing can be drawn.
    #[error(
        "{undrawable} of {} {} no place or size",
        count_of(*targets, "target"),
        if *undrawable == 1 { "has" } else { "have" }
    )]
    Undrawable {
        /// How many.
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
    /// The sidecar says nothing of the camera.
    #[error("the camera is unknown: no cloud, no boxes on the picture")]
    NoCamera,
    /// The sidecar's camera is none.
    #[error("the sidecar's camera cannot be: {0}")]
    Camera(ImplausibleCamera),
    /// The sidecar says nothing of the image's size.
    #[error("the sidecar does not say the image's size")]
    NoSize,
    /// Nothing says which picture it was.
    #[error("no picture is known")]
    NoPicture,
    /// The picture was there when depth was made from it.
    #[error("{}: the picture is not there any more", .0.display())]
    PictureGone(PathBuf),
    /// A video or a bag, which holds the picture, is named.
    #[error("{}: one picture among others, and none is kept beside the results", .0.display())]
    PictureAmongOthers(PathBuf),
    /// The picture has the lens's distortion, which depth, cloud and boxes have not.
    #[error("{}: not shown, as depth is of the picture without the lens's distortion, and that was not saved", .0.display())]
    Distorted(PathBuf),
    /// The picture has another size than the sidecar says.
    #[error("the picture is {}, the sidecar says {}", by(*found), by(*expected))]
    PictureSize {
        /// Its width and height.
        found: (u32, u32),
        /// The sidecar's.
        expected: (u32, u32),
    },
    /// The picture is another one than depth was made from.
    #[error("the picture has changed since its depth was made")]
    PictureChanged,
    /// There is no depth.
    #[error("no depth was saved, neither as depth-png nor as npy")]
    NoDepth,
    /// Depth has another size than the sidecar says.
    #[error("depth is {}, the sidecar says {}", by(*found), by(*expected))]
    DepthSize {
        /// Its width and height.
        found: (u32, u32),
        /// The sidecar's.
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
    fn what_is_wrong_with_small_files() {
        for (problem, said) in [
            (
                FrameProblem::Foreign {
                    file: "a.json".into(),
                    why: "no size".into(),
                },
                "a.json: not as this program writes it: no size",
            ),
            (
                FrameProblem::Undrawable {
                    undrawable: 2,
                    targets: 5,
                },
                "2 of 5 targets have no place or size",
            ),
            (
                FrameProblem::Undrawable {
                    undrawable: 1,
                    targets: 1,
                },
                "1 of 1 target has no place or size",
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
                "the sidecar's camera cannot be: fx is 0, expected a focal length above 0",
            ),
        ] {
            assert_eq!(problem.to_string(), said);
        }
    }

    #[test]
    fn what_is_wrong_with_pictures_and_depth() {
        let (found, expected) = ((96, 48), (200, 100));
        for (problem, said) in [
            (
                FrameProblem::PictureGone("drive/1.png".into()),
                "drive/1.png: the picture is not there any more",
            ),
            (
                FrameProblem::PictureAmongOthers("drive.mp4".into()),
                "drive.mp4: one picture among others, and none is kept beside the results",
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
            assert_eq!(problem.to_string(), said);
        }
    }
}
