//! Test-time augmentation: one depth of several predictions of an image.

use serde::{Deserialize, Serialize};

/// Several predictions of each image, whose disparities become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PostProcess {
    /// The image and the mirrored image, as Monodepth2's post-processed rows have it; at twice the time.
    Flip,
    /// A smaller input and a larger one; at two to two and a half times the time.
    MultiScale,
    /// The same, each mirrored as well; at four to five times the time.
    MultiScaleFlip,
}

impl PostProcess {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Flip, Self::MultiScale, Self::MultiScaleFlip];

    /// Its name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Flip => "flip",
            Self::MultiScale => "multi-scale",
            Self::MultiScaleFlip => "multi-scale-flip",
        }
    }

    /// What it does, and what that takes, for the reader of a table.
    #[must_use]
    pub fn explained(self) -> &'static str {
        match self {
            Self::Flip => {
                "the mean with the mirrored image's prediction, which takes two passes of the network"
            }
            Self::MultiScale => {
                "the mean of a smaller input's and a larger one's prediction, which takes two passes of the network"
            }
            Self::MultiScaleFlip => {
                "the mean of a smaller input's and a larger one's prediction and of the mirrored images', which takes four passes of the network"
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_the_command_lines_names() {
        for how in PostProcess::ALL {
            let written = serde_json::to_string(&how).unwrap();
            assert_eq!(written, format!("{:?}", how.name()));
        }
    }
}
