//! Settings of a demo, and where it puts things.

use std::path::{Path, PathBuf};

use deepfusion_model::{Compute, InputSize};

/// How a demo is made. What is `None` is as is usual; the others make it short enough to be tested.
#[derive(Debug, Clone, Copy, Default)]
pub struct DemoSettings {
    /// Chooses the streets.
    pub seed: u64,
    /// Frames of each drive; fewer than 12 may leave no scan to measure on.
    pub frames: Option<usize>,
    /// Steps of training.
    pub steps: Option<usize>,
    /// Width and height of the pictures, and of what the network learns from.
    pub size: Option<(u32, u32)>,
    /// What it learns on.
    pub compute: Compute,
}

impl DemoSettings {
    /// Frames of a drive.
    pub(super) fn frames(&self, usual: usize) -> usize {
        self.frames.unwrap_or(usual)
    }

    /// Steps of training.
    pub(super) fn steps(&self, usual: usize) -> usize {
        self.steps.unwrap_or(usual)
    }

    /// Width and height of pictures.
    pub(super) fn size(&self, usual: (u32, u32)) -> (u32, u32) {
        self.size.unwrap_or(usual)
    }

    /// The size of what the network learns from.
    pub(super) fn input_size(&self, usual: InputSize) -> InputSize {
        self.size.map_or(usual, |(width, height)| InputSize {
            width: width as usize,
            height: height as usize,
        })
    }
}

/// The folder of everything that a demo makes.
#[derive(Debug, Clone)]
pub struct DemoFolder(PathBuf);

impl DemoFolder {
    /// Everything goes into this one.
    #[must_use]
    pub fn new(folder: PathBuf) -> Self {
        Self(folder)
    }

    /// Something in it, by its name.
    #[must_use]
    pub fn join(&self, name: impl AsRef<Path>) -> PathBuf {
        self.0.join(name)
    }

    /// The run that learned.
    #[must_use]
    pub fn model(&self) -> PathBuf {
        self.join("model")
    }

    /// The point cloud.
    #[must_use]
    pub fn cloud(&self) -> PathBuf {
        self.join("cloud.ply")
    }

    /// The folder of the pictures.
    #[must_use]
    pub fn pictures(&self) -> PathBuf {
        self.join("pictures")
    }

    /// The page.
    #[must_use]
    pub fn page(&self) -> PathBuf {
        self.join("report.html")
    }
}
