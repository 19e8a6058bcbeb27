//! The weights that can be imported, for people.

use serde::Serialize;

/// Another project's weights that can be imported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct KnownWeights {
    /// Names of the networks.
    pub name: &'static str,
    /// Names of their files.
    pub files: &'static str,
    /// What a run gets from them.
    pub gives: &'static str,
    /// Their licence, and the licensor.
    pub terms: &'static str,
}

/// All weights that can be imported.
pub const KNOWN: &[KnownWeights] = &[
    KnownWeights {
        name: "torchvision ResNet-18, 34, 50, 101",
        files: "resnet*.pth or .safetensors",
        gives: "encoders of both networks, trained on ImageNet",
        terms: "BSD-3-Clause (torchvision); ImageNet's own terms for the data",
    },
    KnownWeights {
        name: "Monodepth2",
        files: "encoder.pth, depth.pth, pose_encoder.pth, pose.pth",
        gives: "the whole networks; depth up to an unknown factor",
        terms: "non-commercial (Niantic)",
    },
    KnownWeights {
        name: "Lite-Mono, -small, -tiny, -8m",
        files: "encoder.pth, depth.pth",
        gives: "the depth network; depth up to an unknown factor",
        terms: "MIT (its authors)",
    },
    KnownWeights {
        name: "R-MSFM3, R-MSFM6",
        files: "encoder.pth, depth.pth, pose_encoder.pth, pose.pth",
        gives: "the whole networks; depth up to an unknown factor",
        terms: "its authors' own; see their repository",
    },
    KnownWeights {
        name: "SfMLearner's DispNet",
        files: "dispnet_model_best.pth.tar",
        gives: "the depth network; depth up to an unknown factor",
        terms: "its authors' own; see their repository",
    },
];
