//! The camera's path as a recording measured it.

use crate::Dataset;
use deepfusion_geometry::Se3;

/// A camera's path over consecutively numbered frames.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPath {
    /// Indices in [`Dataset::frames`].
    pub frames: Vec<usize>,
    /// Their times, in seconds from the drive's first time stamp; empty where there are none.
    pub times_s: Vec<f64>,
    /// The camera in a world that does not move. KITTI's has x east, y north, z up, and its origin at the
    /// unit's first place; an RGB-D folder's is the recording's own.
    pub world_from_cam: Vec<Se3>,
}

impl Dataset {
    /// Stretches of at least two frames whose numbers follow each other, by index.
    #[must_use]
    pub fn stretches(&self) -> Vec<Vec<usize>> {
        let frames = self.frames();
        let indices: Vec<usize> = (0..frames.len()).collect();
        indices
            .chunk_by(|a, b| frames[*a].number + 1 == frames[*b].number)
            .filter(|stretch| stretch.len() > 1)
            .map(<[usize]>::to_vec)
            .collect()
    }
}
