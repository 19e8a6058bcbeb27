//! Sharpness of the ground truth of simulated streets itself, shrunk to a half, a quarter, … of its size and enlarged again: the best that
//! a network of that output size could reach.
//!
//! ```text
//! cargo run -p deepfusion-eval --example enlarged_truth
//! ```

use std::time::Instant;

use deepfusion_eval::{Crop, Evaluator, Grid, Prediction, Protocol};
use deepfusion_sim::{SimConfig, Simulation};

const SIZE: (usize, usize) = (640, 192);
const FACTORS: [usize; 5] = [1, 2, 4, 8, 16];
const STREETS: std::ops::Range<u64> = 301..307;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let garg = || Protocol {
        crop: Crop::Garg,
        ..Protocol::default()
    };
    let mut evaluators = FACTORS.map(|factor| (factor, Evaluator::new(garg())));
    let (mut seconds, mut images) = (0.0, 0);
    for seed in STREETS {
        let street = Simulation::new(&SimConfig {
            seed,
            frames: 31,
            width: SIZE.0 as u32,
            height: SIZE.1 as u32,
            moving_cars: 6,
            scan_every: 0,
            ..SimConfig::default()
        })?;
        for frame in (0..31).step_by(10) {
            // 0 means sky.
            let depth = street.frame(frame).depth;
            let depths = depth.data.iter().map(|d| match f64::from(*d) {
                0.0 => f64::INFINITY,
                d => d,
            });
            let truth = Grid::new(depth.width, depth.height, depths.collect())?;
            for (factor, evaluator) in &mut evaluators {
                let evaluator = evaluator.as_mut().map_err(|e| e.to_string())?;
                let prediction = Prediction::Disparity(reduced(&truth, *factor)?);
                let start = Instant::now();
                evaluator.add(&format!("{seed} {frame}"), &prediction, &truth)?;
                seconds += start.elapsed().as_secs_f64();
                images += 1;
            }
        }
    }
    for (factor, evaluator) in &evaluators {
        let report = evaluator.as_ref().map_err(|e| e.to_string())?.report()?;
        println!(
            "1/{factor} abs_rel {:.3} {:?}",
            report.unscaled.abs_rel, report.sharpness
        );
    }
    println!("{:.1} ms an image", 1e3 * seconds / f64::from(images));
    Ok(())
}

/// Disparity, averaged over blocks; the sky is put at 300 m.
fn reduced(truth: &Grid, factor: usize) -> Result<Grid, deepfusion_eval::Error> {
    let (width, height) = (truth.width() / factor, truth.height() / factor);
    let block = |i: usize| {
        let (x, y) = (i % width * factor, i / width * factor);
        let rows =
            (y..y + factor).flat_map(|v| (x..x + factor).map(move |u| v * width * factor + u));
        rows.map(|j| 1.0 / truth.values()[j].min(300.0))
            .sum::<f64>()
            / (factor * factor) as f64
    };
    Grid::new(width, height, (0..width * height).map(block).collect())
}
