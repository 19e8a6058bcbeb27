//! A grid of endless views, each above its depth, and the time they took:
//! `cargo run --release -p deepfusion-sim --example contact_sheet -- OUT.png [FIRST] [COLUMNS] [ROWS] [WIDTHxHEIGHT] [SEED]`

use deepfusion_sim::{Endless, EndlessConfig, View};
use image::{Rgb, RgbImage, imageops};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, otherwise: u64| match arguments.get(i) {
        Some(argument) => argument.parse::<u64>(),
        None => Ok(otherwise),
    };
    let path = arguments.first().map_or("views.png", String::as_str);
    let (first, columns, rows) = (number(1, 0)?, number(2, 4)?, number(3, 6)?);
    let size = arguments.get(4).map_or("320x96", String::as_str);
    let (width, height) = size.split_once('x').ok_or("a size looks like 640x192")?;
    let config = EndlessConfig {
        seed: number(5, 1)?,
        width: width.parse()?,
        height: height.parse()?,
        ..EndlessConfig::default()
    };
    let (w, h) = (config.width, config.height);
    let endless = Endless::new(config)?;
    let mut sheet = RgbImage::new(columns as u32 * (w + 4), rows as u32 * (2 * h + 6));
    let (mut cold, mut warm) = (0.0, 0.0);
    for index in 0..columns * rows {
        let begin = Instant::now();
        let _ = endless.view(first + index);
        let built = begin.elapsed().as_secs_f64() * 1e3;
        let begin = Instant::now();
        let view = endless.view(first + index);
        warm += begin.elapsed().as_secs_f64() * 1e3;
        cold += built;
        let (x, y) = (index % columns, index / columns);
        let (x, y) = (x as i64 * i64::from(w + 4), y as i64 * i64::from(2 * h + 6));
        imageops::replace(&mut sheet, &view.rgb, x, y);
        imageops::replace(&mut sheet, &tones(&view), x, y + i64::from(h));
        println!(
            "{:>4}: {:?}, {:?}, {:.2} m, {:.0}° wide{}",
            first + index,
            view.scene,
            view.weather,
            view.height_m,
            2.0 * (0.5 * f64::from(w) / view.intrinsics.fx)
                .atan()
                .to_degrees(),
            if view.grey { ", grey" } else { "" }
        );
    }
    let count = (columns * rows) as f64;
    println!(
        "{:.1} ms a view, {:.1} ms with its world",
        warm / count,
        cold / count
    );
    sheet.save(path)?;
    Ok(())
}

/// Near is bright; dynamic objects are red.
fn tones(view: &View) -> RgbImage {
    let (w, h) = view.rgb.dimensions();
    RgbImage::from_fn(w, h, |x, y| {
        let depth = view.depth.get(x as usize, y as usize).unwrap_or(0.0);
        let tone = if depth > 0.0 {
            (255.0 * (3.0 / depth).min(1.0)) as u8
        } else {
            0
        };
        let moving = view.moving[(y * w + x) as usize];
        Rgb(if moving { [255, tone, tone] } else { [tone; 3] })
    })
}
