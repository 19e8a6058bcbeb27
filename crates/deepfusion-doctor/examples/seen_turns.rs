//! How well the images of a drive show its turns, compared with sensors that measure them:
//! `cargo run --release -p deepfusion-doctor --example seen_turns -- DRIVE…`

use deepfusion_data::{Dataset, Ego, OpenOptions, Result, SeenTurn};
use std::path::PathBuf;

fn main() -> Result<()> {
    for path in std::env::args_os().skip(1).map(PathBuf::from) {
        for drive in Dataset::open(&path, &OpenOptions::default())? {
            let turns = deepfusion_doctor::seen_turns(&drive).turns;
            let pairs = drive.frames().len().saturating_sub(1);
            println!("{}: {} turns of {pairs} pairs", drive.name(), turns.len());
            print_errors(&drive.ego()?, &turns);
        }
    }
    Ok(())
}

/// Means and standard deviations of the sensors' turns from image to image, and of the images' turns less the sensors', in degrees.
fn print_errors(ego: &Ego<'_>, turns: &[SeenTurn]) {
    let known = |turn: &SeenTurn| {
        let motion = ego.vehicle_motion(turn.from_s, turn.to_s)?;
        let [roll, pitch] = motion.tilt_rad;
        Some([roll, pitch, motion.yaw_rad])
    };
    let pairs: Vec<_> = turns
        .iter()
        .filter_map(|turn| {
            let [roll, pitch] = turn.tilt_rad;
            Some((known(turn)?, [roll, pitch, turn.yaw_rad]))
        })
        .collect();
    println!("  axis    measured          seen - measured");
    for (axis, name) in ["roll", "pitch", "yaw"].into_iter().enumerate() {
        let measured = pairs.iter().map(|(known, _)| known[axis]);
        let off = pairs.iter().map(|(known, seen)| seen[axis] - known[axis]);
        let [(m, m_sd), (o, o_sd)] = [spread(measured), spread(off)];
        println!("  {name:<6} {m:>7.3} ± {m_sd:.3}   {o:>7.3} ± {o_sd:.3}");
    }
}

/// Mean and standard deviation of angles, in degrees.
fn spread(radians: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = radians.clone().count().max(1) as f64;
    let mean = radians.clone().sum::<f64>() / n;
    let square = radians.map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    (mean.to_degrees(), square.sqrt().to_degrees())
}
