//! Brightness and sharpness of one picture, measured at full size, where blur shows.

use image::RgbImage;

/// Grey levels of 255 below and above which a pixel holds no information.
const DARK: f32 = 8.0;
const WHITE: f32 = 250.0;

/// Variance of the Laplacian at half the size below which there is no detail, squared grey levels.
const LEAST_DETAIL: f64 = 2.0;

/// A picture's brightness and sharpness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ImageQuality {
    /// Mean grey level, 0 to 255.
    pub(crate) mean: f64,
    /// Share of pixels that are almost black.
    pub(crate) dark: f64,
    /// Share of pixels that are almost white.
    pub(crate) white: f64,
    /// Variance of the Laplacian over the variance of the Laplacian at half the size. A sharp picture of
    /// the world has about as much detail at any size; a blurred one lacks the finest. `None` if there
    /// is no detail at either size, as in the dark.
    pub(crate) sharpness: Option<f64>,
}

impl ImageQuality {
    pub(crate) fn of(image: &RgbImage) -> Self {
        let (width, height) = (image.width() as usize, image.height() as usize);
        let grey: Vec<f32> = image
            .pixels()
            .map(|p| {
                let [r, g, b] = p.0.map(f32::from);
                0.299 * r + 0.587 * g + 0.114 * b
            })
            .collect();
        let count = grey.len().max(1) as f64;
        let share = |is: fn(f32) -> bool| grey.iter().filter(|v| is(**v)).count() as f64 / count;
        let (half, half_width, half_height) = halved(&grey, width, height);
        // Rounding to whole grey levels alone has a variance of 1/12, and a Laplacian 1 + 1 + 1 + 1 + 16 times that;
        // a mean of four pixels has a quarter of it.
        const ROUNDING: f64 = 20.0 / 12.0;
        let fine = (laplacian_variance(&grey, width, height) - ROUNDING).max(0.0);
        let coarse = laplacian_variance(&half, half_width, half_height) - 0.25 * ROUNDING;
        Self {
            mean: grey.iter().map(|v| f64::from(*v)).sum::<f64>() / count,
            dark: share(|v| v < DARK),
            white: share(|v| v > WHITE),
            sharpness: (coarse > LEAST_DETAIL).then_some(fine / coarse),
        }
    }
}

/// Each pixel the mean of four.
fn halved(grey: &[f32], width: usize, height: usize) -> (Vec<f32>, usize, usize) {
    let (w, h) = (width / 2, height / 2);
    let mut half = Vec::with_capacity(w * h);
    for y in 0..h {
        let (top, bottom) = (2 * y * width, (2 * y + 1) * width);
        for x in 0..w {
            let x = 2 * x;
            let sum = grey[top + x] + grey[top + x + 1] + grey[bottom + x] + grey[bottom + x + 1];
            half.push(0.25 * sum);
        }
    }
    (half, w, h)
}

/// Mean square of the four-neighbour Laplacian, in squared grey levels.
fn laplacian_variance(grey: &[f32], width: usize, height: usize) -> f64 {
    if width < 3 || height < 3 {
        return 0.0;
    }
    let mut sum = 0.0;
    for y in 1..height - 1 {
        let mut row = 0.0_f32;
        for x in 1..width - 1 {
            let i = y * width + x;
            let l = grey[i - 1] + grey[i + 1] + grey[i - width] + grey[i + width] - 4.0 * grey[i];
            row += l * l;
        }
        sum += f64::from(row);
    }
    sum / ((width - 2) * (height - 2)) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn blur_removes_the_finest_detail() {
        let noisy = RgbImage::from_fn(128, 96, |x, y| {
            let v = ((f64::from(x) * 12.9898 + f64::from(y) * 78.233).sin() * 43758.5453).fract();
            Rgb([(128.0 + 100.0 * v) as u8; 3])
        });
        let sharp = ImageQuality::of(&noisy);
        let blurred = ImageQuality::of(&image::imageops::blur(&noisy, 2.0));
        assert!(
            blurred.sharpness.unwrap() < 0.2 * sharp.sharpness.unwrap(),
            "{blurred:?} {sharp:?}"
        );
        assert!((blurred.mean - sharp.mean).abs() < 2.0);
    }

    #[test]
    fn black_and_white_are_counted() {
        let image = RgbImage::from_fn(10, 10, |x, _| Rgb([if x < 3 { 0 } else { 255 }; 3]));
        let quality = ImageQuality::of(&image);
        assert!((quality.dark - 0.3).abs() < 1e-9 && (quality.white - 0.7).abs() < 1e-9);
        assert_eq!(ImageQuality::of(&RgbImage::new(2, 2)).sharpness, None);
    }
}
