//! Leaves of a crown: each clump has its own tone, and the inner ones are in the shade of the outer ones.

use super::noise::{Noise, unit};
use super::{Patch, Rgb, mix, vary};
use crate::crown::{clump, shell_of};

/// The leaves of one lobe; `cell` and `fill` are those of the lobe.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leaves {
    /// Colour in the light.
    pub colour: Rgb,
    /// Colour of some clumps: blossom, dry leaves.
    pub other: Rgb,
    /// Share of clumps with the other colour.
    pub turned: f32,
    /// Side of the cell of a clump, metres.
    pub cell: f32,
    /// Density of the cells, 0 to 1.
    pub fill: f32,
}

impl Leaves {
    /// Albedo of a patch; the seed of the solid is the salt of the lobe.
    pub(crate) fn albedo(&self, noise: &Noise, patch: &Patch) -> Rgb {
        let p = &patch.point;
        let code = clump(p, self.cell, self.fill, patch.seed).unwrap_or(0);
        // Clumps differ from each other only where a pixel is smaller than a clump.
        let seen = (1.5 - patch.size / self.cell).clamp(0.0, 1.0);
        let own = if unit(code, 1) < self.turned {
            self.other
        } else {
            self.colour
        };
        let colour = mix(&mix(&self.colour, &self.other, self.turned), &own, seen);
        let tone = 1.0 + seen * 1.1 * (unit(code, 2) - 0.5);
        let shift = (patch.seed % 509) as f32;
        let leaf = noise.fractal(
            p.x + 0.61 * p.z + shift,
            p.y - 0.53 * p.z,
            0.5 * self.cell,
            3,
            0.9,
            patch.size,
        ) + noise.fractal(
            p.z - 0.47 * p.x,
            p.y + 0.7 * p.x - shift,
            0.4 * self.cell,
            3,
            0.9,
            patch.size,
        );
        let inner = [1.0, 0.72, 0.48, 0.3][usize::from(shell_of(patch.face))];
        vary(&(colour * (tone * inner)), leaf, 0.45)
    }
}
