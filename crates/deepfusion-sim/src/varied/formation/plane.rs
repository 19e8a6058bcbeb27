//! Three colour planes and separable filters on them.

use crate::texture::Rgb;

/// Red, green and blue, each row by row.
#[derive(Debug, Clone)]
pub(super) struct Planes {
    /// Width, in pixels.
    pub width: usize,
    /// Height, in pixels.
    pub height: usize,
    /// The planes.
    pub of: [Vec<f32>; 3],
}

impl Planes {
    /// The planes of colours, row by row.
    pub(super) fn of(light: &[Rgb], width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            of: [0, 1, 2].map(|c| light.iter().map(|colour| colour[c]).collect()),
        }
    }
}

/// The taps of a Gaussian with this deviation, from the middle to one side; over both sides they sum to 1.
pub(super) fn bell(deviation: f32) -> Vec<f32> {
    let reach = (2.6 * deviation).ceil().max(1.0) as usize;
    let mut taps: Vec<f32> = (0..=reach)
        .map(|i| (-0.5 * (i as f32 / deviation).powi(2)).exp())
        .collect();
    let sum = taps[0] + 2.0 * taps[1..].iter().sum::<f32>();
    for tap in &mut taps {
        *tap /= sum;
    }
    taps
}

/// A symmetric filter along both axes; `taps` from the middle to one side.
pub(super) fn filter(plane: &mut [f32], work: &mut [f32], width: usize, taps: &[f32]) {
    let height = plane.len() / width;
    for (row, out) in plane.chunks(width).zip(work.chunks_mut(width)) {
        along_row(row, out, taps);
    }
    // Along columns, whole rows are combined.
    for v in 0..height {
        let out = &mut plane[v * width..(v + 1) * width];
        let middle = &work[v * width..(v + 1) * width];
        for (o, m) in out.iter_mut().zip(middle) {
            *o = m * taps[0];
        }
        for (i, tap) in taps.iter().enumerate().skip(1) {
            let (up, down) = (v.saturating_sub(i), (v + i).min(height - 1));
            let up = &work[up * width..(up + 1) * width];
            let down = &work[down * width..(down + 1) * width];
            for ((o, a), b) in out.iter_mut().zip(up).zip(down) {
                *o += tap * (a + b);
            }
        }
    }
}

fn along_row(row: &[f32], out: &mut [f32], taps: &[f32]) {
    let (n, reach) = (row.len(), taps.len() - 1);
    let slow = |u: usize| {
        let mut sum = row[u] * taps[0];
        for (i, tap) in taps.iter().enumerate().skip(1) {
            sum += tap * (row[u.saturating_sub(i)] + row[(u + i).min(n - 1)]);
        }
        sum
    };
    if n <= 2 * reach {
        for (u, o) in out.iter_mut().enumerate() {
            *o = slow(u);
        }
        return;
    }
    for u in (0..reach).chain(n - reach..n) {
        out[u] = slow(u);
    }
    let inner = &mut out[reach..n - reach];
    for (o, m) in inner.iter_mut().zip(&row[reach..]) {
        *o = m * taps[0];
    }
    for (i, tap) in taps.iter().enumerate().skip(1) {
        for ((o, a), b) in inner
            .iter_mut()
            .zip(&row[reach - i..])
            .zip(&row[reach + i..])
        {
            *o += tap * (a + b);
        }
    }
}

/// The value of the plane at fractional coordinates within it, bilinear.
#[inline]
pub(super) fn sample(plane: &[f32], width: usize, x: f32, y: f32) -> f32 {
    let height = plane.len() / width;
    let x = x.clamp(0.0, (width - 1) as f32);
    let y = y.clamp(0.0, (height - 1) as f32);
    let (x0, y0) = ((x as usize).min(width - 2), (y as usize).min(height - 2));
    let (fx, fy) = (x - x0 as f32, y - y0 as f32);
    let at = y0 * width + x0;
    let top = plane[at] + (plane[at + 1] - plane[at]) * fx;
    let bottom = plane[at + width] + (plane[at + width + 1] - plane[at + width]) * fx;
    top + (bottom - top) * fy
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_spreads_a_point_and_keeps_its_sum() {
        let (width, height) = (31, 21);
        let mut plane = vec![0.0; width * height];
        plane[10 * width + 15] = 1.0;
        let taps = bell(1.3);
        filter(&mut plane, &mut vec![0.0; width * height], width, &taps);
        assert!((plane.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        for (dx, dy) in [(0usize, 0usize), (1, 0), (2, 3), (0, 3)] {
            let value = plane[(10 + dy) * width + 15 - dx];
            assert!((value - taps[dx] * taps[dy]).abs() < 1e-6);
        }
    }

    #[test]
    fn a_flat_picture_stays_flat_up_to_its_border() {
        for (width, height) in [(3, 2), (40, 9)] {
            let mut plane = vec![0.7; width * height];
            filter(
                &mut plane,
                &mut vec![0.0; width * height],
                width,
                &bell(2.0),
            );
            assert!(plane.iter().all(|x| (x - 0.7).abs() < 1e-5));
        }
    }

    #[test]
    fn samples_are_bilinear() {
        let plane: Vec<f32> = (0..20)
            .map(|i| (i % 5) as f32 + 10.0 * (i / 5) as f32)
            .collect();
        assert!((sample(&plane, 5, 2.25, 1.5) - 17.25).abs() < 1e-5);
        assert!((sample(&plane, 5, -3.0, 9.0) - 30.0).abs() < 1e-5);
    }
}
