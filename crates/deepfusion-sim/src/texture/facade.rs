//! Walls with windows, doors, shops, shutters and dirt; tiled roofs.

use super::noise::{Noise, band, bands, beyond, hash, unit};
use super::pattern::Pattern;
use super::{Patch, Rgb, mix, vary};
use crate::primitive::FACE_TOP;

/// Material of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wall {
    /// Render with stains.
    Plaster,
    /// Brick courses.
    Brick,
    /// Large blocks of stone.
    Stone,
}

/// How one house looks.
#[derive(Debug, Clone)]
pub(crate) struct Facade {
    /// Half extents of the house along its x and y axes, metres.
    pub half: [f32; 2],
    /// Height of the walls, metres.
    pub height: f32,
    /// Material of the walls.
    pub wall: Wall,
    /// Colour of the walls.
    pub colour: Rgb,
    /// Colour of ledges, window frames and corner stones.
    pub trim: Rgb,
    /// Colour of doors and shutters.
    pub accent: Rgb,
    /// Height of a floor, metres.
    pub floor: f32,
    /// Distance between windows, metres.
    pub pitch: f32,
    /// Width and height of a window, metres.
    pub window: [f32; 2],
    /// Whether windows have shutters.
    pub shutters: bool,
    /// Whether the ground floor is a shop.
    pub shop: bool,
    /// Whether there is a ledge between the floors.
    pub ledges: bool,
    /// How dirty it is, 0 to 1.
    pub grime: f32,
    /// Cladding of the walls, in place of `wall` and `colour`.
    pub skin: Option<Pattern>,
}

impl Facade {
    /// Albedo of the walls, and of the flat top.
    pub(crate) fn albedo(&self, noise: &Noise, patch: &Patch) -> Rgb {
        let p = &patch.point;
        if patch.face == FACE_TOP {
            let grain = noise.fractal(p.x, p.y, 2.0, 5, 0.6, patch.size);
            return vary(&Rgb::new(0.2, 0.19, 0.18), grain, 0.4);
        }
        let across = usize::from(patch.face >= 2);
        // Position along the wall from its left corner, and the wall's width.
        let (u, fu, width) = if across == 1 {
            (p.x + self.half[0], patch.extent.x, 2.0 * self.half[0])
        } else {
            (p.y + self.half[1], patch.extent.y, 2.0 * self.half[1])
        };
        let (v, fv) = (p.z, patch.extent.z);
        let side = u32::from(patch.face);
        let shift = (patch.seed % 977) as f32 + 31.7 * side as f32;
        let mut colour = self.wall_colour(noise, u, v, shift, fu, fv, patch.size, patch.seed);
        self.add_windows(noise, &mut colour, u, v, width, fu, fv, patch, side, shift);
        // Rain pipes and corner stones.
        let pipe = band(u, width - 0.55, width - 0.43, fu);
        colour = mix(&colour, &(self.trim * 0.35), pipe);
        // Dirt rises from the ground and runs down from the eaves.
        let splash = noise.fractal(u + shift, v * 0.6, 0.9, 3, 0.6, patch.size);
        let dirt = (-(v / (0.5 + 0.4 * splash).max(0.1))).exp() * 0.55;
        let run = noise
            .wave(u * 1.9 + shift, v * 0.16, 0.7, patch.size)
            .max(0.0);
        let streak = run * self.grime * (1.0 - 0.6 * v / self.height).max(0.0);
        colour * ((1.0 - dirt.min(0.7)) * (1.0 - 0.6 * streak))
    }

    #[inline]
    fn wall_colour(
        &self,
        noise: &Noise,
        u: f32,
        v: f32,
        shift: f32,
        fu: f32,
        fv: f32,
        size: f32,
        seed: u32,
    ) -> Rgb {
        let (x, y) = (u + shift, v + 0.37 * shift);
        if let Some(skin) = &self.skin {
            return self.trimmed(skin.at(noise, [u, v], [fu, fv], v, size, seed), v, fv);
        }
        let grain = noise.fractal(x, y, 2.3, 6, 0.82, size);
        let base = match self.wall {
            Wall::Plaster => {
                let flaked = noise.fractal(y - 9.0, x, 1.7, 4, 0.7, size);
                let bare = ((flaked - 0.75 + 0.3 * self.grime) * 4.0).clamp(0.0, 1.0);
                let crack = noise.ridge(x, y, 1.4, 0.02, size);
                mix(&self.colour, &(self.colour * 0.55), bare) * (1.0 - 0.5 * crack)
            }
            Wall::Brick => courses(&self.colour, u, v, [0.24, 0.08], 0.012, fu, fv, seed, 0.55),
            Wall::Stone => courses(&self.colour, u, v, [0.9, 0.42], 0.03, fu, fv, seed, 0.35),
        };
        let mut colour = vary(&base, grain, 0.33);
        if self.ledges {
            let line = bands(v, self.floor, 0.0, 0.16, fv);
            let shade = bands(v + 0.1, self.floor, 0.0, 0.1, fv);
            colour = mix(&colour, &self.trim, 0.85 * line) * (1.0 - 0.5 * shade);
        }
        let plinth = 1.0 - beyond(v, 0.65, fv);
        mix(&colour, &(vary(&self.trim, grain, 0.4) * 0.5), 0.8 * plinth)
    }

    /// Ledges and plinth on a clad wall.
    #[inline]
    fn trimmed(&self, mut colour: Rgb, v: f32, fv: f32) -> Rgb {
        if self.ledges {
            let line = bands(v, self.floor, 0.0, 0.16, fv);
            let shade = bands(v + 0.1, self.floor, 0.0, 0.1, fv);
            colour = mix(&colour, &self.trim, 0.85 * line) * (1.0 - 0.5 * shade);
        }
        let plinth = 1.0 - beyond(v, 0.65, fv);
        mix(&colour, &(self.trim * 0.45), 0.6 * self.grime * plinth)
    }

    #[inline]
    fn add_windows(
        &self,
        noise: &Noise,
        colour: &mut Rgb,
        u: f32,
        v: f32,
        width: f32,
        fu: f32,
        fv: f32,
        patch: &Patch,
        side: u32,
        shift: f32,
    ) {
        // Whole windows only, centred on the wall.
        let columns = ((width - 0.8) / self.pitch).floor().max(1.0);
        let margin = 0.5 * (width - columns * self.pitch);
        let inside = band(u, margin, width - margin, fu) * band(v, 0.3, self.height - 0.3, fv);
        let column = ((u - margin) / self.pitch).floor();
        let floor = (v / self.floor).floor();
        if inside <= 0.0 || column < 0.0 || column >= columns {
            return;
        }
        let cell = hash(column as i32, floor as i32, patch.seed ^ (side << 20));
        // Position in the cell, from its middle and from its floor.
        let x = u - margin - (column + 0.5) * self.pitch;
        let y = v - floor * self.floor;
        let ground = floor < 1.0;
        // The narrow sides of a house have few windows.
        let gable = side < 2;
        if unit(cell, 0) < if gable { 0.6 } else { 0.06 } && !(ground && self.shop && !gable) {
            return;
        }
        let door = ground && !gable && hash(column as i32, 77, patch.seed).is_multiple_of(5);
        let shop = ground && self.shop && !gable;
        let (half, sill, head) = if door {
            (0.55, 0.05, 2.15)
        } else if shop {
            (0.5 * self.pitch - 0.15, 0.45, 2.35)
        } else {
            let sill = 0.5 * (self.floor - self.window[1]) + 0.1;
            (0.5 * self.window[0], sill, sill + self.window[1])
        };
        let window = band(x, -half, half, fu) * band(y, sill, head, fv);
        let frame = 0.09;
        let opening =
            band(x, -half - frame, half + frame, fu) * band(y, sill - frame, head + frame, fv);
        *colour = mix(colour, &self.trim, 0.9 * opening * inside);
        let pane = if door {
            let panels = bands(y, 0.7, 0.12, 0.58, fv) * bands(x + half, 0.55, 0.1, 0.45, fu);
            self.accent * (0.6 + 0.4 * panels)
        } else {
            self.glass(
                noise, x, y, half, sill, head, fu, fv, cell, shift, patch.size,
            )
        };
        *colour = mix(colour, &pane, window * inside);
        // The recess is dark below the lintel, the sill is bright, and the wall below the sill is in its shadow.
        let lintel = band(x, -half, half, fu) * band(y, head - 0.12, head, fv);
        let ledge = band(x, -half - 0.12, half + 0.12, fu) * band(y, sill - 0.16, sill - 0.04, fv);
        let below = band(x, -half - 0.12, half + 0.12, fu) * band(y, sill - 0.3, sill - 0.16, fv);
        *colour = mix(colour, &(self.trim * 1.15), ledge * inside)
            * (1.0 - 0.6 * lintel * inside)
            * (1.0 - 0.45 * below * inside);
        if self.shutters && !ground {
            let leaf = 0.45 * self.window[0];
            let left = band(x, -half - leaf - frame, -half - frame, fu);
            let right = band(x, half + frame, half + leaf + frame, fu);
            let slats = 0.7 + 0.3 * bands(y, 0.12, 0.0, 0.07, fv);
            let area = (left + right) * band(y, sill, head, fv) * inside;
            *colour = mix(colour, &(self.accent * slats), area.min(1.0));
        }
        if shop {
            self.add_sign(noise, colour, x, v, fu, fv, column, patch, inside);
        }
    }

    /// Panes with bars and curtains, and a room or a reflection of the sky in them.
    #[inline]
    fn glass(
        &self,
        noise: &Noise,
        x: f32,
        y: f32,
        half: f32,
        sill: f32,
        head: f32,
        fu: f32,
        fv: f32,
        cell: u32,
        shift: f32,
        size: f32,
    ) -> Rgb {
        let blotch = noise.fractal(x + shift, y - shift, 0.8, 3, 0.6, size);
        let up = (y - sill) / (head - sill);
        let sky = 0.04 + 0.16 * up * unit(cell, 1);
        let mut pane = vary(&Rgb::new(0.8, 0.95, 1.15), blotch, 0.7) * sky;
        let kind = unit(cell, 2);
        if kind < 0.35 {
            // Curtains, partly drawn.
            let open = half * (0.2 + 0.7 * unit(cell, 3));
            let cloth = beyond(x.abs(), open, fu);
            let folds = 0.45 + 0.12 * noise.wave(x * 5.0, 0.3, 0.4, fu);
            pane = mix(&pane, &Rgb::new(folds, folds * 0.95, folds * 0.85), cloth);
        } else if kind < 0.6 {
            // A blind, partly lowered.
            let blind = beyond(y, head - (head - sill) * unit(cell, 3), fv);
            let slats = 0.42 + 0.14 * bands(y, 0.1, 0.0, 0.05, fv);
            pane = mix(&pane, &Rgb::new(slats, slats, slats * 0.92), blind);
        }
        let middle = band(x, -0.035, 0.035, fu);
        let bar = sill + 0.68 * (head - sill);
        let bars = middle.max(band(y, bar - 0.03, bar + 0.03, fv));
        let edge =
            1.0 - band(x, 0.06 - half, half - 0.06, fu) * band(y, sill + 0.06, head - 0.06, fv);
        mix(&pane, &(self.trim * 0.9), bars.max(edge))
    }

    /// The sign of a shop, with marks like letters.
    #[inline]
    fn add_sign(
        &self,
        noise: &Noise,
        colour: &mut Rgb,
        x: f32,
        v: f32,
        fu: f32,
        fv: f32,
        column: f32,
        patch: &Patch,
        inside: f32,
    ) {
        let board = band(v, 2.5, 3.05, fv);
        if board <= 0.0 {
            return;
        }
        let letter = ((x + 40.0) / 0.28).floor();
        let code = hash(letter as i32, column as i32 / 2, patch.seed ^ 0x51);
        let stroke = band(
            (x + 40.0) / 0.28 - letter,
            0.12,
            0.12 + 0.6 * unit(code, 0),
            fu / 0.28,
        ) * band(v, 2.6 + 0.15 * unit(code, 1), 2.95, fv);
        let hole = noise.wave(x * 3.0, v * 3.0, 0.3, patch.size).max(0.0);
        let ink = mix(&self.trim, &Rgb::new(0.9, 0.9, 0.85), 0.6);
        let face = mix(&self.accent, &ink, (stroke * (1.0 - hole)).clamp(0.0, 1.0));
        *colour = mix(colour, &face, board * inside);
    }
}

/// Courses of bricks, stones or slabs with joints: `tile` is [length, height], all metres. Each
/// tile has its own tone (`spread`).
#[inline]
pub(crate) fn courses(
    colour: &Rgb,
    u: f32,
    v: f32,
    tile: [f32; 2],
    joint: f32,
    fu: f32,
    fv: f32,
    seed: u32,
    spread: f32,
) -> Rgb {
    let row = (v / tile[1]).floor();
    let offset = u + 0.5 * tile[0] * (row - 2.0 * (0.5 * row).floor());
    let joints =
        (bands(v, tile[1], 0.0, joint, fv) + bands(offset, tile[0], 0.0, joint, fu)).min(1.0);
    let code = hash((offset / tile[0]).floor() as i32, row as i32, seed);
    // Tiles differ from each other only where a pixel is smaller than a tile.
    let seen = (1.6 - 1.2 * (fu / tile[0]).max(fv / tile[1])).clamp(0.0, 1.0);
    let tone = 1.0 + spread * seen * (unit(code, 0) - 0.5);
    let warm = 0.12 * seen * (unit(code, 1) - 0.5);
    let body = Rgb::new(
        colour.x * (tone + warm),
        colour.y * tone,
        colour.z * (tone - warm),
    );
    mix(&body, &Rgb::new(0.4, 0.38, 0.35), 0.75 * joints)
}

/// Rows of tiles on a roof.
pub(crate) fn roof(noise: &Noise, patch: &Patch, colour: &Rgb) -> Rgb {
    let p = &patch.point;
    // Rows of tiles run along each face, also along gables.
    let along = if patch.normal.y.abs() > patch.normal.x.abs() {
        p.x
    } else {
        p.y
    };
    let fu = patch.extent.x.max(patch.extent.y);
    let tiled = courses(
        colour,
        along,
        p.z,
        [0.3, 0.22],
        0.035,
        fu,
        patch.extent.z,
        patch.seed,
        0.5,
    );
    let moss = noise.fractal(
        along + patch.seed as f32 % 91.0,
        p.z * 1.4,
        2.0,
        5,
        0.65,
        patch.size,
    );
    vary(&tiled, moss, 0.35)
}
