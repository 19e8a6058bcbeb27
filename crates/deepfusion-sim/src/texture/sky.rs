//! The sky: a gradient and clouds, infinitely far away.

use super::noise::{Noise, length, smoothstep};
use super::{Rgb, mix};
use crate::primitive::V3;

/// The weather of a drive.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sky {
    /// Radiance at the horizon.
    pub horizon: Rgb,
    /// Radiance overhead.
    pub zenith: Rgb,
    /// Clouds, 0 (a few) to 1 (overcast); none at −1.
    pub clouds: f32,
}

impl Sky {
    /// Radiance from a direction of any length.
    pub(crate) fn radiance(&self, noise: &Noise, direction: &V3) -> Rgb {
        let flat = length(direction.x, direction.y).max(1e-6);
        let up = (direction.z / flat).max(0.0);
        let clear = mix(&self.horizon, &self.zenith, 1.0 - (-2.6 * up).exp());
        // Clouds lie on a plane above the viewer, so they merge towards the horizon.
        let height = up + 0.16;
        let (x, y) = (direction.x / flat / height, direction.y / flat / height);
        let heap = noise.fractal(x, y, 2.2, 5, 0.55, 0.03 / height);
        let cover = smoothstep(
            0.55 - 1.1 * self.clouds,
            1.15 - 1.1 * self.clouds,
            heap + 0.25,
        );
        let white = mix(
            &Rgb::new(1.0, 1.0, 1.0),
            &Rgb::new(0.5, 0.53, 0.6),
            (0.7 * heap + 0.4).clamp(0.0, 1.0),
        );
        mix(&clear, &white, 0.92 * cover)
    }
}
