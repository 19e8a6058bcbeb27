use std::sync::LazyLock;

use colorgrad::Gradient;
use image::Rgb;

/// A map from [0, 1] to colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColourMap {
    /// Blue over green and yellow to red: for depth.
    Turbo,
    /// Black over purple to light yellow: for disparity and magnitudes.
    Magma,
    /// Blue over white to red: for signed errors.
    Diverging,
}

impl ColourMap {
    /// The colour of `t`, clamped to [0, 1]; NaN is the colour of 0.
    #[must_use]
    pub fn colour(self, t: f32) -> Rgb<u8> {
        const LAST: f32 = 255.0;
        static TABLES: LazyLock<[Vec<Rgb<u8>>; 3]> = LazyLock::new(|| {
            let table = |gradient: &dyn Gradient| {
                (0..=255u8)
                    .map(|i| of(gradient, f32::from(i) / LAST))
                    .collect()
            };
            [
                table(&colorgrad::preset::turbo()),
                table(&colorgrad::preset::magma()),
                table(&colorgrad::preset::rd_bu()),
            ]
        });
        // `as` turns NaN into 0.
        let place = (t.clamp(0.0, 1.0) * LAST).round() as usize;
        match self {
            Self::Turbo => TABLES[0][place],
            Self::Magma => TABLES[1][place],
            // The preset runs from red to blue.
            Self::Diverging => TABLES[2][255 - place],
        }
    }
}

fn of(gradient: &dyn Gradient, t: f32) -> Rgb<u8> {
    let [r, g, b, _] = gradient.at(t).to_rgba8();
    Rgb([r, g, b])
}

/// The colour of pixels without depth.
pub(crate) const NOTHING: Rgb<u8> = Rgb([40, 40, 44]);

/// The colour scale of depth: logarithmic, red at `near_m`, blue at `far_m`, clamped beyond.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthScale {
    /// Depth at the warm end, in metres.
    pub near_m: f32,
    /// Depth at the cold end, in metres.
    pub far_m: f32,
}

impl Default for DepthScale {
    /// 2 m to 80 m: a street.
    fn default() -> Self {
        Self {
            near_m: 2.0,
            far_m: 80.0,
        }
    }
}

impl DepthScale {
    /// Position of `depth_m` on the scale: 0 near, 1 far.
    #[must_use]
    pub fn place(&self, depth_m: f32) -> f32 {
        ((depth_m / self.near_m).ln() / (self.far_m / self.near_m).ln()).clamp(0.0, 1.0)
    }

    /// The colour of a depth; dark grey for none (0, negative, NaN).
    #[must_use]
    pub fn colour(&self, depth_m: f32) -> Rgb<u8> {
        if depth_m > 0.0 {
            // Turbo's ends are nearly black: without them, near and far differ from "no depth".
            ColourMap::Turbo.colour(0.95 - 0.88 * self.place(depth_m))
        } else {
            NOTHING
        }
    }

    /// Round depths for a legend, in metres: 1, 2, 5 times powers of ten between the ends, and the ends if they are
    /// round themselves; from near to far.
    #[must_use]
    pub fn ticks_m(&self) -> Vec<f32> {
        let inside = |t: &f32| *t >= self.near_m * 0.999 && *t <= self.far_m * 1.001;
        let mut ticks: Vec<f32> = (-2..=4)
            .flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10f32.powi(power)))
            .filter(inside)
            .collect();
        // 80 m is the field's cap, but not a 1-2-5 number.
        if self.far_m >= 1.3 * ticks.last().copied().unwrap_or(0.0) {
            ticks.push(self.far_m);
        }
        ticks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_warm_and_far_is_cold() {
        let scale = DepthScale::default();
        let [r, _, b] = scale.colour(2.0).0;
        assert!(r > 150 && b < 60, "{r} {b}");
        let [r, _, b] = scale.colour(80.0).0;
        assert!(b > 100 && r < 90, "{r} {b}");
        assert_eq!(scale.colour(0.0), NOTHING);
        assert_eq!(scale.colour(f32::NAN), NOTHING);
        assert_eq!(scale.colour(0.1), scale.colour(2.0));
    }

    #[test]
    fn the_maps_have_their_known_ends() {
        assert!(ColourMap::Magma.colour(0.0).0.iter().all(|c| *c < 10));
        assert!(ColourMap::Magma.colour(1.0).0[0] > 240);
        let [r, _, b] = ColourMap::Diverging.colour(0.0).0;
        assert!(b > r);
        let middle = ColourMap::Diverging.colour(0.5).0;
        assert!(middle.iter().all(|c| *c > 230), "{middle:?}");
        assert_eq!(
            ColourMap::Turbo.colour(f32::NAN),
            ColourMap::Turbo.colour(0.0)
        );
    }

    #[test]
    fn legends_have_round_numbers() {
        assert_eq!(
            DepthScale::default().ticks_m(),
            [2.0, 5.0, 10.0, 20.0, 50.0, 80.0]
        );
        let indoors = DepthScale {
            near_m: 0.3,
            far_m: 10.0,
        };
        assert_eq!(indoors.ticks_m(), [0.5, 1.0, 2.0, 5.0, 10.0]);
    }
}
