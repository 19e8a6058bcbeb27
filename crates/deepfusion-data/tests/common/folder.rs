//! The tiny drive of `TinyDrive` as a folder of images with tables.

use image::{Rgb, RgbImage};
use std::fs;
use std::path::Path;

/// The image of a frame, the same as in `TinyDrive`.
pub(crate) fn picture(n: u64) -> RgbImage {
    RgbImage::from_fn(62, 19, |x, y| {
        Rgb([(x * 4) as u8, (y * 13) as u8, (n * 30) as u8])
    })
}

/// Writes `images/<name>.png` for each name.
pub(crate) fn write_images(folder: &Path, names: &[&str]) {
    fs::create_dir_all(folder.join("images")).unwrap();
    for (n, name) in names.iter().enumerate() {
        let path = folder.join(format!("images/{name}.png"));
        picture(n as u64).save(path).unwrap();
    }
}

/// A folder of `frames` images, one every 0.103 s, at `speed_mps` with a yaw rate, and the camera of `TinyDrive`.
pub(crate) fn write_drive(folder: &Path, frames: u64, speed_mps: f64, yaw_rate_radps: f64) {
    let names: Vec<String> = (0..frames).map(|n| format!("{n:06}")).collect();
    write_images(
        folder,
        &names.iter().map(String::as_str).collect::<Vec<_>>(),
    );
    let mut table = "time_s,file\n".to_owned();
    // The first frame at 0.345 s, the first speed at 0.349 s, as in `TinyDrive`.
    for (n, name) in names.iter().enumerate() {
        table += &format!("{:.9},{name}.png\n", 0.345 + 0.103 * n as f64);
    }
    fs::write(folder.join("frames.csv"), table).unwrap();
    let mut table = "time_s,speed_kmh,yaw_rate_dps\n".to_owned();
    for n in 0..frames {
        let t = 0.349 + 0.103 * n as f64;
        table += &format!(
            "{t:.9},{},{}\n",
            3.6 * speed_mps,
            yaw_rate_radps.to_degrees()
        );
    }
    fs::write(folder.join("speed.csv"), table).unwrap();
    fs::write(folder.join("intrinsics.txt"), "36 36 30.5 8.6\n").unwrap();
}
