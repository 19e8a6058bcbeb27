//! The last refinement: every block of the image has its own growth, and the image may roll.
//!
//! Near objects grow faster than far ones: with a single growth, a house on one side looks like a turn to the other side. A turn moves all
//! pixels alike, and a roll rotates them about the centre; driving moves each pixel along its own ray from the centre by its own amount.
//! With a growth per block, shift, drop and roll only explain what driving cannot.

use super::{Plane, Reading, Warp, aligned_rows, centre};
use nalgebra::{Matrix4, Vector4};

/// Number of blocks across and down.
const GRID: (usize, usize) = (10, 3);
/// Prior standard deviation of the blocks' growths, per pair of frames.
const SPREAD: f64 = 0.1;
const ITERATIONS: usize = 8;

/// The normal equations. Shift, drop, roll and brightness are shared, but growths are not, so each growth is eliminated separately (Schur's
/// complement).
#[derive(Clone, Copy, Default)]
struct Block {
    growth: f64,
    shared: Vector4<f64>,
    own: f64,
    gradient: f64,
}

/// Refines a warp; its growth remains that of the whole image.
pub(super) fn refine(before: &Plane, after: &Plane, mut warp: Warp) -> Option<Warp> {
    let start = Block {
        growth: warp.growth,
        ..Block::default()
    };
    let mut blocks = [start; GRID.0 * GRID.1];
    let mut scale = f64::INFINITY;
    for _ in 0..ITERATIONS {
        let (step, usual) = step(before, after, &warp, &mut blocks, scale)?;
        scale = usual;
        warp.right += step[0];
        warp.down += step[1];
        warp.clockwise += step[2];
        warp.brightness += step[3];
        if step[0].abs() < 1e-4 && step[1].abs() < 1e-4 && step[2].abs() < 1e-6 {
            break;
        }
    }
    Some(warp)
}

fn step(
    before: &Plane,
    after: &Plane,
    warp: &Warp,
    blocks: &mut [Block],
    scale: f64,
) -> Option<(Vector4<f64>, f64)> {
    let (cx, cy) = centre(before.width, before.height);
    let rows = aligned_rows(before.height);
    let (mut normal, mut gradient) = (Matrix4::zeros(), Vector4::zeros());
    let (mut count, mut differences) = (0.0, 0.0);
    for block in blocks.iter_mut() {
        *block = Block {
            growth: block.growth,
            ..Block::default()
        };
    }
    for y in rows.clone() {
        let block_row = (y - rows.start) * GRID.1 / rows.len();
        for x in 0..before.width {
            let block = &mut blocks[block_row * GRID.0 + x * GRID.0 / before.width];
            let (dx, dy) = (x as f64 - cx, y as f64 - cy);
            let Some(reading) = Reading::at(before, after, warp, (x, y), (dx, dy), block.growth)
            else {
                continue;
            };
            let Reading { right, down, .. } = reading;
            let jacobian = Vector4::new(right, down, down * dx - right * dy, -1.0);
            let outward = right * dx + down * dy;
            let weight = reading.weight(scale);
            normal += jacobian * jacobian.transpose() * weight;
            gradient += jacobian * (reading.difference * weight);
            block.shared += jacobian * (outward * weight);
            block.own += outward * outward * weight;
            block.gradient += outward * reading.difference * weight;
            count += 1.0;
            differences += reading.difference.abs();
        }
    }
    if count < 1.0 {
        return None;
    }
    let usual = (differences / count).max(1e-3);
    // Blocks without texture stay near the whole image's growth.
    let prior = (usual / SPREAD).powi(2);
    for block in blocks.iter_mut() {
        block.own += prior;
        block.gradient += prior * (warp.growth - block.growth);
        normal -= block.shared * block.shared.transpose() / block.own;
        gradient -= block.shared * (block.gradient / block.own);
    }
    let step = normal.cholesky()?.solve(&gradient);
    for block in blocks.iter_mut() {
        block.growth += (block.gradient - block.shared.dot(&step)) / block.own;
    }
    let finite = step.iter().all(|s| s.is_finite());
    finite.then_some((step, usual))
}
