//! The positional encoding of pixels as sines and cosines.

use std::f64::consts::TAU;

/// Wavelengths range from the size of the image to this many times that (Vaswani et al.).
const LONGEST: f64 = 10_000.0;

/// The Fourier encoding of pixels (as in DETR, XCiT and Lite-Mono): first m channels of rows, then m of columns. With p = 2π·(i + 1)/n for
/// row or column i of n, channel k is sin(p / 10,000^(k/m)) for an even k, and the cosine of channel k − 1's angle for an odd one.
///
/// # Shapes
/// - output: 2·`per_axis` × `height` × `width`
#[must_use]
pub fn position_code(per_axis: usize, height: usize, width: usize) -> Vec<f32> {
    let value = |channel: usize, index: usize, count: usize| {
        let place = TAU * (index + 1) as f64 / (count as f64 + 1e-6);
        let share = (channel / 2 * 2) as f64 / per_axis as f64;
        let angle = place / LONGEST.powf(share);
        if channel.is_multiple_of(2) {
            angle.sin() as f32
        } else {
            angle.cos() as f32
        }
    };
    let mut code = Vec::with_capacity(2 * per_axis * height * width);
    for channel in 0..per_axis {
        for y in 0..height {
            let here = value(channel, y, height);
            code.extend(std::iter::repeat_n(here, width));
        }
    }
    for channel in 0..per_axis {
        let row: Vec<f32> = (0..width).map(|x| value(channel, x, width)).collect();
        for _ in 0..height {
            code.extend_from_slice(&row);
        }
    }
    code
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two channels per axis, an image of 2×4, by hand: rows are at π and 2π, columns at π/2, π, …
    #[test]
    fn rows_come_first_and_the_last_pixel_is_a_whole_turn() {
        let code = position_code(2, 2, 4);
        let expected: [[f32; 8]; 4] = [
            [0.0; 8],
            [-1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0],
            [1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0],
            [0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 1.0],
        ];
        for (found, expected) in code.iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < 1e-5, "{code:?}");
        }
        assert_eq!(code.len(), 32);
    }

    /// Later channels vary more slowly: the third by √10,000.
    #[test]
    fn wavelengths_grow() {
        let code = position_code(4, 1, 1);
        let slow = (TAU / 100.0).sin() as f32;
        assert!((code[2] - slow).abs() < 1e-6, "{code:?}");
    }
}
