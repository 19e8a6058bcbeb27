//! Test-time augmentation: one depth from several predictions of an image.

use serde::{Deserialize, Serialize};

/// Test-time augmentation: the disparities of several predictions of an image are averaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PostProcess {
    /// The image and the mirrored image, as in Monodepth2's post-processed rows; takes twice the time.
    Flip,
    /// A smaller and a larger input; takes two to two and a half times the time.
    MultiScale,
    /// A smaller and a larger input, both also mirrored; takes four to five times the time.
    MultiScaleFlip,
}

impl PostProcess {
    /// All variants.
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

    /// What it does and costs, for the reader of a table.
    #[must_use]
    pub fn explained(self) -> &'static str {
        match self {
            Self::Flip => {
                "averaged with the mirrored image's prediction, which takes two passes of the network"
            }
            Self::MultiScale => {
                "average of predictions at a smaller and a larger input size, which takes two passes of the network"
            }
            Self::MultiScaleFlip => {
                "average of predictions at a smaller and a larger input size, also mirrored, which takes four passes of the network"
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_has_the_command_lines_names() {
        for how in PostProcess::ALL {
            let written = serde_json::to_string(&how).unwrap();
            assert_eq!(written, format!("{:?}", how.name()));
        }
    }
}
