//! From an image file's bytes to the network's numbers: `cargo bench -p deepfusion-images --bench image`.
//!
//! The picture is generated, with the size of a KITTI frame (1242×375), as a JPEG of quality 92 with half the colour resolution
//! (usual for KITTI's copies in JPEG), as one with full colour resolution, and as a PNG. The files stay in the folder that
//! `DEEPFUSION_BENCH_DIR` names (default: `deepfusion-bench` among the system's temporary files), so that
//! `benches/peers/image_to_tensor.py` measures the same files.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a benchmark that cannot run may panic"
)]

use criterion::{Criterion, criterion_main};
use deepfusion_images::{RgbImage, decode_rgb, to_network_input};
use std::hint::black_box;
use std::path::{Path, PathBuf};

const SIZE: (u32, u32) = (1242, 375);
const WHOLE: [u32; 4] = [0, 0, SIZE.0, SIZE.1];
const NETWORK: (u32, u32) = (640, 192);

/// Sky over a textured street with hard edges: about 0.5 bytes a pixel as a JPEG, like real frames.
fn picture() -> RgbImage {
    let noise = |x: u32, y: u32, seed: u32| {
        let h = (x.wrapping_mul(7919) ^ y.wrapping_mul(104_729) ^ seed.wrapping_mul(31_337))
            .wrapping_mul(2_654_435_761);
        f32::from((h >> 16) as u8) / 255.0
    };
    RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        let ground = (y as f32 / SIZE.1 as f32 - 0.35).max(0.0);
        let wall = noise(x / 90, y / 120, 1) * 120.0;
        let detail: f32 = [(2, 30.0), (5, 40.0), (13, 30.0)]
            .iter()
            .map(|(step, weight)| (noise(x / step, y / step, *step) - 0.5) * weight)
            .sum();
        let light = if ground > 0.0 {
            70.0 + wall + detail + (noise(x, y, 9) - 0.5) * 24.0
        } else {
            200.0 - 0.2 * y as f32
        };
        let tint = noise(x / 60, y / 40, 3) * 30.0;
        image::Rgb([light + tint, light, light - tint].map(|v| v.clamp(0.0, 255.0) as u8))
    })
}

fn folder() -> PathBuf {
    std::env::var_os("DEEPFUSION_BENCH_DIR").map_or_else(
        || std::env::temp_dir().join("deepfusion-bench"),
        PathBuf::from,
    )
}

/// Writes the files, and returns the name and the bytes of each.
fn files(folder: &Path) -> Vec<(&'static str, Vec<u8>)> {
    use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
    std::fs::create_dir_all(folder).expect("the bench's folder can be created");
    let picture = picture();
    let mut files = Vec::new();
    for (name, sampling) in [
        ("street_420.jpg", SamplingFactor::F_2_2),
        ("street_444.jpg", SamplingFactor::F_1_1),
    ] {
        let mut bytes = Vec::new();
        let mut encoder = Encoder::new(&mut bytes, 92);
        encoder.set_sampling_factor(sampling);
        encoder
            .encode(
                picture.as_raw(),
                SIZE.0 as u16,
                SIZE.1 as u16,
                ColorType::Rgb,
            )
            .expect("a picture of this size can be a JPEG");
        files.push((name, bytes));
    }
    let mut png = std::io::Cursor::new(Vec::new());
    picture
        .write_to(&mut png, image::ImageFormat::Png)
        .expect("writing to memory");
    files.push(("street.png", png.into_inner()));
    for (name, bytes) in &files {
        std::fs::write(folder.join(name), bytes).expect("the bench's folder can be written");
    }
    files
}

fn image(criterion: &mut Criterion) {
    for (name, bytes) in files(&folder()) {
        let mut group = criterion.benchmark_group(format!("{name} ({} kB)", bytes.len() / 1000));
        group.bench_function("decode", |b| {
            b.iter(|| decode_rgb(black_box(&bytes), Path::new(name)).expect("a whole image"));
        });
        group.bench_function("decode, resize, to tensor", |b| {
            b.iter(|| {
                let image = decode_rgb(black_box(&bytes), Path::new(name)).expect("a whole image");
                to_network_input(&image, WHOLE, NETWORK.0, NETWORK.1)
            });
        });
    }
    let picture = picture();
    criterion.bench_function("resize, to tensor", |b| {
        b.iter(|| to_network_input(black_box(&picture), WHOLE, NETWORK.0, NETWORK.1));
    });
}

// The macro makes a public function that cannot be documented.
#[allow(missing_docs)]
mod group {
    use super::{Criterion, image};
    use criterion::criterion_group;
    use std::time::Duration;

    criterion_group! {
        name = images;
        config = Criterion::default().sample_size(40).warm_up_time(Duration::from_millis(300))
            .measurement_time(Duration::from_secs(2));
        targets = image
    }
}
use group::images;
criterion_main!(images);
