//! Renders some frames of a drive into a folder, with their depth, and prints how long each took:
//! `cargo run --release -p deepfusion-sim --example frames -- DIR [SEED] [FRAMES] [EVERY] [WIDTHxHEIGHT] [CARS]`

use deepfusion_sim::{SimConfig, Simulation};
use image::{Rgb, RgbImage};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, otherwise: usize| {
        arguments
            .get(i)
            .and_then(|a| a.parse().ok())
            .unwrap_or(otherwise)
    };
    let folder = std::path::PathBuf::from(arguments.first().map_or("frames", String::as_str));
    let (seed, frames, every) = (number(1, 1), number(2, 60), number(3, 20).max(1));
    let size = arguments.get(4).map_or("640x192", String::as_str);
    let (width, height) = size.split_once('x').ok_or("a size looks like 640x192")?;
    let config = SimConfig {
        seed: seed as u64,
        frames,
        width: width.parse()?,
        height: height.parse()?,
        moving_cars: number(5, 0),
        ..SimConfig::default()
    };
    std::fs::create_dir_all(&folder)?;
    let begin = Instant::now();
    let simulation = Simulation::new(&config)?;
    let scans = std::env::var_os("NOSCAN").is_none();
    println!(
        "street laid out in {:.0} ms",
        begin.elapsed().as_secs_f64() * 1e3
    );
    for index in (0..frames).step_by(every) {
        let begin = Instant::now();
        let frame = simulation.frame(index);
        let took = begin.elapsed().as_secs_f64() * 1e3;
        let begin = Instant::now();
        let points = if scans {
            simulation.velodyne(index).xyz.len()
        } else {
            0
        };
        let scan = begin.elapsed().as_secs_f64() * 1e3;
        println!(
            "frame {index}: {took:.1} ms, {:.1} m/s; scan of {points} points: {scan:.1} ms",
            frame.speed_mps
        );
        let (w, h) = frame.rgb.dimensions();
        let mut both = RgbImage::new(w, 2 * h);
        for (x, y, pixel) in frame.rgb.enumerate_pixels() {
            both.put_pixel(x, y, *pixel);
            let depth = frame.depth.get(x as usize, y as usize).unwrap_or(0.0);
            let tone = if depth > 0.0 {
                (255.0 * (4.0 / depth).min(1.0)) as u8
            } else {
                0
            };
            let red = if frame.moving[(y * w + x) as usize] {
                255
            } else {
                tone
            };
            both.put_pixel(x, y + h, Rgb([red, tone, tone]));
        }
        both.save(folder.join(format!("{seed}-{index:04}.png")))?;
    }
    Ok(())
}
