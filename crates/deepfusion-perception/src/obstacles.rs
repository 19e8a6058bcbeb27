//! Which pixels belong to obstacles on the ground.

use crate::clusters::Cluster;
use crate::{Ground, PerceptionConfig, Rays};
use rayon::prelude::*;

/// Heights above the ground, pixel by pixel, of the obstacles.
#[derive(Debug, Clone, Default)]
pub struct Obstacles {
    /// H·W heights above the ground in metres, row by row; negative where the pixel has no depth, is too far away, is ground, or hangs too
    /// high.
    pub height: Vec<f32>,
}

/// Smallest number of rows for which another core pays off.
const ROWS: usize = 16;

/// Not an obstacle.
pub(crate) const NONE: f32 = -1.0;

impl Obstacles {
    /// The obstacles without the pixels of these clusters.
    pub(crate) fn without(&self, clusters: &[&Cluster], width: usize) -> Self {
        let mut rest = self.clone();
        for run in clusters.iter().flat_map(|cluster| &cluster.runs) {
            let row = run.v as usize * width;
            rest.height[row + run.from as usize..row + run.to as usize].fill(NONE);
        }
        rest
    }

    /// Fills in the heights of a depth image, row by row.
    pub fn find(&mut self, depth: &[f32], rays: &Rays, ground: &Ground, config: &PerceptionConfig) {
        let width = rays.x.len();
        self.height.clear();
        self.height.resize(depth.len(), NONE);
        // Per column, what the ray's x adds to the distance along `up` and `forward` at depth 1.
        let up_x: Vec<f32> = rays.x.iter().map(|x| ground.up[0] * x).collect();
        let rows = depth.par_chunks_exact(width);
        let rows = rows.zip(self.height.par_chunks_exact_mut(width));
        let rows = rows.with_min_len(ROWS).enumerate();
        rows.for_each(|(v, (row, heights))| {
            // Copies, so that the compiler knows that writing heights does not change them, and vectorises the loop.
            let (ground, config) = (ground.clone(), config.clone());
            let up_y = ground.up[1] * rays.y[v] + ground.up[2];
            let forward_y = ground.forward[1] * rays.y[v] + ground.forward[2];
            for ((z, height), up_x) in row.iter().zip(heights).zip(&up_x) {
                let above = z * (up_x + up_y) + ground.camera_height_m;
                // `forward` has almost no component along x (from the camera's roll), which is left out here.
                let above = above - ground.profile_at(forward_y * z);
                // Far away, an error of the ground's tilt exceeds a kerb's height.
                let lowest = config.min_height_m + 0.004 * z;
                let is = (*z > 0.0)
                    & (*z <= config.max_depth_m)
                    & (above > lowest)
                    & (above < config.join_height_m);
                *height = if is { above } else { NONE };
            }
        });
    }
}
