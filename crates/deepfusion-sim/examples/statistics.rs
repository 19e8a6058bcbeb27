//! Compares the pictures of the endless mode with real ones, in numbers:
//! `cargo run --release -p deepfusion-sim --example statistics -- [VIEWS] [FOLDER OF PICTURES]...`
//!
//! Real pictures are cropped about their middle to the aspect ratio of the views and reduced to their size. Each line gives the 10th, 50th
//! and 90th percentile over the pictures.

use deepfusion_sim::{Endless, EndlessConfig};
use image::imageops::{FilterType, crop_imm, resize};
use image::{DynamicImage, RgbImage};
use std::path::{Path, PathBuf};

const WIDTH: u32 = 320;
const HEIGHT: u32 = 96;

/// Names of the quantities measured of a picture.
const NAMES: [&str; 12] = [
    "mean",
    "deviation",
    "5th percentile",
    "95th percentile",
    "clipped, %",
    "black, %",
    "saturation",
    "mean |du|",
    "mean |dv|",
    "median |du|",
    "mean |Laplacian|",
    "red / blue",
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let count = arguments.first().map_or(Ok(64), |count| count.parse())?;
    let endless = Endless::new(EndlessConfig {
        width: WIDTH,
        height: HEIGHT,
        ..EndlessConfig::default()
    })?;
    let views: Vec<RgbImage> = (0..count).map(|i| endless.view(7 * i).rgb).collect();
    report("views", &views);
    for folder in arguments.iter().skip(1) {
        let mut paths = Vec::new();
        collect(Path::new(folder), &mut paths)?;
        paths.sort();
        let step = paths.len().div_ceil(40).max(1);
        let pictures: Result<Vec<RgbImage>, image::ImageError> = paths
            .iter()
            .step_by(step)
            .map(|path| image::open(path).map(|picture| small(&picture)))
            .collect();
        report(folder, &pictures?);
    }
    Ok(())
}

/// Colour pictures in a folder and below it.
fn collect(folder: &Path, paths: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.to_string_lossy().to_lowercase();
        if path.is_dir() {
            collect(&path, paths)?;
        } else if (name.ends_with(".png") || name.ends_with(".jpg")) && !name.contains("depth") {
            paths.push(path);
        }
    }
    Ok(())
}

fn small(picture: &DynamicImage) -> RgbImage {
    let picture = picture.to_rgb8();
    let (w, h) = picture.dimensions();
    let kept = h.min(w * HEIGHT / WIDTH);
    let cut = crop_imm(&picture, 0, (h - kept) / 2, w, kept).to_image();
    resize(&cut, WIDTH, HEIGHT, FilterType::Triangle)
}

fn report(name: &str, pictures: &[RgbImage]) {
    println!("{name}: {} pictures", pictures.len());
    let measured: Vec<[f64; 12]> = pictures.iter().map(measure).collect();
    for (i, quantity) in NAMES.iter().enumerate() {
        let mut values: Vec<f64> = measured.iter().map(|m| m[i]).collect();
        values.sort_by(f64::total_cmp);
        let [low, middle, high] = [0.1, 0.5, 0.9].map(|q| percentile(&values, q));
        println!("  {quantity:<18} {low:8.2} {middle:8.2} {high:8.2}");
    }
}

fn percentile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    let index = (share * last as f64).round() as usize;
    sorted.get(index).copied().unwrap_or(f64::NAN)
}

fn measure(picture: &RgbImage) -> [f64; 12] {
    let (w, h) = (picture.width() as usize, picture.height() as usize);
    let luma: Vec<f64> = picture
        .pixels()
        .map(|p| 0.299 * f64::from(p.0[0]) + 0.587 * f64::from(p.0[1]) + 0.114 * f64::from(p.0[2]))
        .collect();
    let n = luma.len() as f64;
    let mean = luma.iter().sum::<f64>() / n;
    let variance = luma.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / n;
    let mut sorted = luma.clone();
    sorted.sort_by(f64::total_cmp);
    let share =
        |test: &dyn Fn(f64) -> bool| 100.0 * luma.iter().filter(|y| test(**y)).count() as f64 / n;
    let saturation = picture
        .pixels()
        .map(|p| {
            let (most, least) = (p.0.iter().max(), p.0.iter().min());
            let (most, least) = (
                f64::from(*most.unwrap_or(&0)),
                f64::from(*least.unwrap_or(&0)),
            );
            (most - least) / most.max(20.0)
        })
        .sum::<f64>()
        / n;
    let across: Vec<f64> = luma
        .chunks(w)
        .flat_map(|row| row.windows(2).map(|p| (p[1] - p[0]).abs()))
        .collect();
    let down: f64 = luma
        .iter()
        .zip(&luma[w..])
        .map(|(a, b)| (b - a).abs())
        .sum();
    let mut steps = across.clone();
    steps.sort_by(f64::total_cmp);
    let mut curved = 0.0;
    for v in 1..h - 1 {
        for u in 1..w - 1 {
            let i = v * w + u;
            curved += (4.0 * luma[i] - luma[i - 1] - luma[i + 1] - luma[i - w] - luma[i + w]).abs();
        }
    }
    let channel = |c: usize| picture.pixels().map(|p| f64::from(p.0[c])).sum::<f64>() + 1.0;
    [
        mean,
        variance.sqrt(),
        percentile(&sorted, 0.05),
        percentile(&sorted, 0.95),
        share(&|y| y >= 250.0),
        share(&|y| y <= 8.0),
        saturation,
        across.iter().sum::<f64>() / across.len() as f64,
        down / (n - w as f64),
        percentile(&steps, 0.5),
        curved / ((w - 2) * (h - 2)) as f64,
        channel(0) / channel(2),
    ]
}
