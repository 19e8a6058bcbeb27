//! A sheet of varied worlds, each view above its depth:
//! `cargo run --release -p deepfusion-sim --example worlds -- FILE.png [FIRST_SEED] [COUNT] [SCENE] [COLUMNS]`

use deepfusion_sim::{Scene, SimConfig, Simulation, Variety};
use image::{Rgb, RgbImage};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, otherwise: u64| {
        arguments
            .get(i)
            .and_then(|a| a.parse().ok())
            .unwrap_or(otherwise)
    };
    let path = arguments.first().map_or("worlds.png", String::as_str);
    let (first, count) = (number(1, 1), number(2, 6));
    let only = arguments.get(3).map(String::as_str);
    let columns = number(4, 2).max(1) as u32;
    let (width, height) = (640u32, 192u32);
    let rows = (count as u32).div_ceil(columns);
    let mut sheet = RgbImage::new(columns * width, rows * 2 * height);
    for (place, seed) in (first..first + count).enumerate() {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let variety = Variety::draw(&mut rng);
        let scene = Scene::EVERY
            .into_iter()
            .find(|scene| Some(scene.name()) == only)
            .unwrap_or(Scene::EVERY[seed as usize % Scene::EVERY.len()]);
        let config = SimConfig {
            seed,
            frames: 20,
            width,
            height,
            moving_cars: 4,
            scene,
            ..SimConfig::default()
        };
        let begin = Instant::now();
        let simulation = Simulation::varied(&config, &variety)?;
        let built = begin.elapsed().as_secs_f64() * 1e3;
        let begin = Instant::now();
        let frame = simulation.frame(10);
        let drawn = begin.elapsed().as_secs_f64() * 1e3;
        let objects = simulation.objects(10).len();
        println!(
            "{seed} {}: built in {built:.0} ms, drawn in {drawn:.0} ms, {objects} objects",
            scene.name()
        );
        let (x0, y0) = (
            place as u32 % columns * width,
            place as u32 / columns * 2 * height,
        );
        for (x, y, pixel) in frame.rgb.enumerate_pixels() {
            sheet.put_pixel(x0 + x, y0 + y, *pixel);
            let depth = frame.depth.get(x as usize, y as usize).unwrap_or(0.0);
            let tone = if depth > 0.0 {
                (255.0 * (3.0 / depth).min(1.0).sqrt()) as u8
            } else {
                0
            };
            sheet.put_pixel(x0 + x, y0 + height + y, Rgb([tone; 3]));
        }
    }
    sheet.save(path)?;
    Ok(())
}
