//! Compares two engines: test pictures, and the deviation of their outputs.

use crate::DepthMaps;

/// Largest allowed deviation of a file from the network it was made from.
///
/// Sums of some thousand f32 products in another order differ by about 1e-6 of the largest output; a wrong
/// border, a wrong order of channels or a missing layer by far more than this.
pub const TOLERANCE: f64 = 1e-4;

/// Deviation of one engine's maps from another's: max |a − b| / max |b| over a set of pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Deviation of the depth in metres.
    pub depth: f64,
    /// Deviation of the disparity in 1/m.
    pub disparity: f64,
}

impl Deviation {
    /// The larger of the two.
    #[must_use]
    pub fn worst(&self) -> f64 {
        self.depth.max(self.disparity)
    }

    /// Whether both are within [`TOLERANCE`].
    #[must_use]
    pub fn is_small(&self) -> bool {
        self.worst() <= TOLERANCE
    }
}

/// Deviation of `found` from `expected`, one entry per picture.
#[must_use]
pub fn deviation(found: &[DepthMaps], expected: &[DepthMaps]) -> Deviation {
    let of = |map: fn(&DepthMaps) -> &[f32]| {
        let all = |maps: &[DepthMaps]| maps.iter().flat_map(map).copied().collect::<Vec<f32>>();
        relative(&all(found), &all(expected))
    };
    Deviation {
        depth: of(|m| &m.depth),
        disparity: of(|m| &m.disparity),
    }
}

/// max |a − b| / max |b|; infinite if a value is not finite or the lengths differ.
#[must_use]
pub fn relative(a: &[f32], b: &[f32]) -> f64 {
    let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
    if a.len() != b.len() || !finite(a) || !finite(b) {
        return f64::INFINITY;
    }
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
    let apart = a
        .iter()
        .zip(b)
        .map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs());
    let apart = largest(&mut apart.into_iter());
    if apart == 0.0 {
        return 0.0;
    }
    apart / largest(&mut b.iter().map(|b| f64::from(b.abs())))
}

/// Names of the [`pictures`].
pub const PICTURES: [&str; 4] = ["noise", "ramps", "checkerboard", "street"];

/// Pictures that reveal a wrong network: noise in every pixel, ramps in a different direction for each colour
/// (channels and axes), a checkerboard (strides and offsets), a street of flat areas with edges.
///
/// # Shapes
/// - each: `height` × `width` × 3 bytes, RGB
#[must_use]
pub fn pictures(width: usize, height: usize) -> [Vec<u8>; 4] {
    // Knuth's multiplicative generator: any sequence without a pattern will do.
    let mut state = 1_u64;
    let mut noise = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    let share = |part: usize, whole: usize| (255 * part / whole) as u8;
    let paint = |colour: &mut dyn FnMut(usize, usize) -> [u8; 3]| {
        let mut picture = Vec::with_capacity(3 * width * height);
        for y in 0..height {
            for x in 0..width {
                picture.extend(colour(x, y));
            }
        }
        picture
    };
    [
        paint(&mut |_, _| [noise(), noise(), noise()]),
        paint(&mut |x, y| {
            let down = share(y, height);
            [share(x, width), down, 255 - down / 2]
        }),
        paint(&mut |x, y| {
            if (x / 5 + y / 3) % 2 == 0 {
                [250, 240, 20]
            } else {
                [10, 30, 200]
            }
        }),
        paint(&mut |x, y| {
            let (across, below) = (x.abs_diff(width / 2), y.saturating_sub(height / 2));
            match (y < height / 2, across < 2 * below) {
                (true, _) if across > width / 3 => [140, 90, 70],
                (true, _) => [170, 200, 240],
                (false, true) => [90, 90, 95],
                (false, false) => [60, 110, 50],
            }
        }),
    ]
}
