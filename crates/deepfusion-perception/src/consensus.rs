//! The plane that most samples of a depth image agree on.

use crate::ground::{DisparityPlane, Sample, plane_of};
use crate::lanes::LANES;
use crate::{Ground, PerceptionConfig};
use nalgebra::{Matrix3, Vector3};

/// Number of hypotheses drawn.
const HYPOTHESES: usize = 160;
/// Smallest number of level samples for a ground plane.
const FEWEST: usize = 30;
/// Points more than this many tolerances below the plane count against it.
const BELOW: f32 = -2.5;

/// The best among the last frame's plane and planes through three level samples each; `None` if none has support.
pub(crate) fn consensus(
    samples: &[Sample],
    level: &[Sample],
    before: Option<&Ground>,
    config: &PerceptionConfig,
) -> Option<DisparityPlane> {
    if level.len() < FEWEST {
        return None;
    }
    let blocks = [SampleBlocks::of(level), SampleBlocks::of(samples)];
    let mut best: Option<(f32, DisparityPlane)> = None;
    let mut consider = |plane: DisparityPlane| {
        let plausible = plane_of(&plane)
            .is_some_and(|(up, height)| Ground::plane(up, height).is_plausible(config));
        if plausible {
            let score = score(&blocks, &plane);
            if best.is_none_or(|(highest, _)| score > highest) {
                best = Some((score, plane));
            }
        }
    };
    if let Some(ground) = before {
        let scale = -1.0 / ground.camera_height_m;
        consider(Vector3::from(ground.up) * scale);
    }
    let mut random = Random(0x2545_F491_4F6C_DD1D);
    for _ in 0..HYPOTHESES {
        let three = [0; 3].map(|_| level[random.below(level.len())]);
        let rays = Matrix3::from_fn(|i, j| if j < 2 { three[i].ray[j] } else { 1.0 });
        let disparities = Vector3::from_fn(|i, _| three[i].disparity);
        if let Some(inverse) = rays.try_inverse() {
            consider(inverse * disparities);
        }
    }
    let (score, plane) = best?;
    (score > 0.1 * level.len() as f32).then_some(plane)
}

/// Level points on the plane count for it, all points below it against it, because nothing is below the ground.
fn score([level, all]: &[SampleBlocks; 2], plane: &DisparityPlane) -> f32 {
    let on = level.sum(plane, |above| {
        let off = 1.0 - above * above;
        if off > 0.0 { off } else { 0.0 }
    });
    on - 0.5 * all.sum(plane, |above| if above < BELOW { 1.0 } else { 0.0 })
}

/// Samples in SIMD lanes; the last block is padded with samples above every plane, which have no effect.
struct SampleBlocks {
    /// Disparity, the ray's x and y, and 1, each divided by the tolerance 1 m below the camera.
    blocks: Vec<[[f32; LANES]; 4]>,
}

impl SampleBlocks {
    fn of(samples: &[Sample]) -> Self {
        let block = |samples: &[Sample]| {
            let mut block = [[0.0; LANES]; 4];
            block[0] = [f32::INFINITY; LANES];
            for (i, sample) in samples.iter().enumerate() {
                let scale = sample.depth / sample.tolerance();
                let [x, y] = sample.ray;
                for (lanes, value) in block.iter_mut().zip([sample.disparity, x, y, 1.0]) {
                    lanes[i] = scale * value;
                }
            }
            block
        };
        Self {
            blocks: samples.chunks(LANES).map(block).collect(),
        }
    }

    /// Sum of a function of each sample's height above the plane, in tolerances.
    fn sum(&self, plane: &DisparityPlane, of: impl Fn(f32) -> f32) -> f32 {
        let height = 1.0 / plane.norm();
        let [a, b, c] = [plane.x, plane.y, plane.z];
        let mut sums = [0.0; LANES];
        for [disparity, x, y, one] in &self.blocks {
            for i in 0..LANES {
                let on_plane = a * x[i] + b * y[i] + c * one[i];
                sums[i] += of((disparity[i] - on_plane) * height);
            }
        }
        sums.iter().sum()
    }
}

/// xorshift64* with a fixed seed, so that a frame always gives the same ground.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        ((self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize) % limit
    }
}
