//! Settings of a demo, and the paths of its files.

use std::path::{Path, PathBuf};

use deepfusion_model::{Compute, InputSize};

/// How a demo is made. `None` stands for the usual value; other values make it short enough for tests.
#[derive(Debug, Clone, Copy, Default)]
pub struct DemoSettings {
    /// Seed of the streets.
    pub seed: u64,
    /// Number of frames of each drive; fewer than 12 may leave no scan to evaluate on.
    pub frames: Option<usize>,
    /// Number of training steps.
    pub steps: Option<usize>,
    /// Width and height of the pictures and of the training images.
    pub size: Option<(u32, u32)>,
    /// The kind of device that it trains on.
    pub compute: Compute,
}

impl DemoSettings {
    /// Number of frames of a drive.
    pub(super) fn frames(&self, usual: usize) -> usize {
        self.frames.unwrap_or(usual)
    }

    /// Number of training steps.
    pub(super) fn steps(&self, usual: usize) -> usize {
        self.steps.unwrap_or(usual)
    }

    /// Width and height of pictures.
    pub(super) fn size(&self, usual: (u32, u32)) -> (u32, u32) {
        self.size.unwrap_or(usual)
    }

    /// Size of the network's input in training.
    pub(super) fn input_size(&self, usual: InputSize) -> InputSize {
        self.size.map_or(usual, |(width, height)| InputSize {
            width: width as usize,
            height: height as usize,
        })
    }
}

/// The folder of all files that a demo makes.
#[derive(Debug, Clone)]
pub struct DemoFolder(PathBuf);

impl DemoFolder {
    /// A demo in this folder.
    #[must_use]
    pub fn new(folder: PathBuf) -> Self {
        Self(folder)
    }

    /// Path of a file or folder in it.
    #[must_use]
    pub fn join(&self, name: impl AsRef<Path>) -> PathBuf {
        self.0.join(name)
    }

    /// Path of the training run.
    #[must_use]
    pub fn model(&self) -> PathBuf {
        self.join("model")
    }

    /// Path of the point cloud.
    #[must_use]
    pub fn cloud(&self) -> PathBuf {
        self.join("cloud.ply")
    }

    /// Path of the pictures' folder.
    #[must_use]
    pub fn pictures(&self) -> PathBuf {
        self.join("pictures")
    }

    /// Path of the page.
    #[must_use]
    pub fn page(&self) -> PathBuf {
        self.join("report.html")
    }
}
