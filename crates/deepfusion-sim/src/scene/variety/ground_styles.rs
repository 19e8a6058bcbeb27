//! Random grounds: asphalt from nearly black to light grey, cobbles, paint, pavements, lawns, fields.

use super::site::Site;
use crate::texture::Rgb;
use crate::texture::ground_style::{GroundStyle, Kind, Line, Surface};
use crate::texture::pattern::{colour, wall_colour};
use rand::Rng;

impl Site<'_> {
    /// A grey of this tone, with a random tint.
    fn grey(&mut self, low: f32, high: f32) -> Rgb {
        let tone = low * (high / low).powf(self.rng.random_range(0.0..1.0));
        let warm = self.rng.random_range(-0.05..0.12f32);
        Rgb::new(tone * (1.0 + 0.5 * warm), tone, tone * (1.0 - warm))
    }

    fn grain(&mut self) -> [f32; 2] {
        let strength = self.rng.random_range(0.0..1.0f32);
        [
            0.1 * 20f32.powf(self.rng.random_range(0.0..1.0)),
            0.05 + 0.35 * strength * strength,
        ]
    }

    /// Asphalt or concrete.
    pub(super) fn asphalt(&mut self) -> Surface {
        let colour = self.grey(0.035, 0.4);
        Surface {
            kind: Kind::Asphalt,
            colour,
            other: colour * 0.6,
            tile: [1.0; 2],
            grain: self.grain(),
            stain: self.rng.random_range(0.0..0.3),
        }
    }

    /// Stones, slabs, bricks or tiles.
    pub(super) fn laid(&mut self) -> Surface {
        let base = if self.rng.random_bool(0.6) {
            self.grey(0.07, 0.5)
        } else {
            wall_colour(self.rng) * 0.8
        };
        let width = 0.07 * 12f32.powf(self.rng.random_range(0.0..1.0));
        Surface {
            kind: Kind::Laid,
            colour: base,
            other: base * self.rng.random_range(0.3..1.3),
            tile: [width * self.rng.random_range(1.0..2.4), width],
            grain: self.grain(),
            stain: self.rng.random_range(0.0..0.35),
        }
    }

    /// Lawn, meadow, dry grass.
    pub(super) fn grass(&mut self) -> Surface {
        let tone = self.rng.random_range(0.5..1.6f32);
        let green = Rgb::new(
            self.rng.random_range(0.05..0.13),
            self.rng.random_range(0.1..0.17),
            self.rng.random_range(0.015..0.05),
        ) * tone;
        let dry = Rgb::new(0.24, 0.2, 0.09) * self.rng.random_range(0.5..1.7f32);
        Surface {
            kind: Kind::Grass,
            colour: green,
            other: if self.rng.random_bool(0.6) {
                dry
            } else {
                green * 0.6
            },
            tile: [1.0; 2],
            grain: [
                self.rng.random_range(0.2..1.5),
                self.rng.random_range(0.2..0.6),
            ],
            stain: self.rng.random_range(0.0..0.3),
        }
    }

    /// Gravel, soil, sand.
    pub(super) fn loose(&mut self) -> Surface {
        let tone = 0.06 * 7f32.powf(self.rng.random_range(0.0..1.0));
        let base = Rgb::new(tone, tone * 0.88, tone * self.rng.random_range(0.55..0.95));
        Surface {
            kind: Kind::Gravel,
            colour: base,
            other: base * self.rng.random_range(0.4..0.9),
            tile: [1.0; 2],
            grain: self.grain(),
            stain: self.rng.random_range(0.1..0.4),
        }
    }

    /// A field: furrows, stubble, young corn.
    pub(super) fn field(&mut self) -> Surface {
        let (soil, plants) = (self.loose(), self.grass());
        Surface {
            kind: Kind::Field,
            colour: soil.colour,
            other: plants.colour,
            tile: [1.0, self.rng.random_range(0.15..2.5)],
            grain: [0.8, 0.4],
            stain: 0.2,
        }
    }

    /// Any of these grounds.
    fn any_ground(&mut self) -> Surface {
        let mut surface = self.laid();
        surface.colour = colour(self.rng, 0.8);
        surface.other = colour(self.rng, 0.8);
        surface
    }

    /// Ground beside a street.
    pub(super) fn yard(&mut self) -> Surface {
        match self.rng.random_range(0..10) {
            0..=3 => self.grass(),
            4..=5 => self.laid(),
            6..=7 => self.asphalt(),
            _ => self.loose(),
        }
    }

    /// The ground of a stretch of street with this half width, with road markings.
    pub(super) fn style(&mut self, half_width: f32) -> GroundStyle {
        let road = match self.rng.random_range(0..20) {
            0..=15 => self.asphalt(),
            16..=18 => self.laid(),
            _ if self.variety.wild > 0.3 => self.any_ground(),
            _ => self.loose(),
        };
        let pavement = if self.rng.random_bool(0.75) {
            self.laid()
        } else {
            self.asphalt()
        };
        let other_side = if self.rng.random_bool(0.7) {
            pavement
        } else {
            self.laid()
        };
        let paint = match self.rng.random_range(0..8) {
            0 => Rgb::new(0.65, 0.48, 0.05),
            _ => {
                let tone = self.rng.random_range(0.35..0.85f32);
                Rgb::new(tone, tone, tone * 0.97)
            }
        };
        GroundStyle {
            road,
            pavement: [pavement, other_side],
            beyond: [self.yard(), self.yard()],
            verge: if self.rng.random_bool(0.7) {
                self.grass()
            } else {
                self.loose()
            },
            kerb: self.grey(0.12, 0.6),
            lines: self.lines(half_width),
            paint,
            wear: self.rng.random_range(0.0..1.0),
            crossing: if self.rng.random_bool(0.6) {
                self.rng.random_range(28.0..90.0)
            } else {
                0.0
            },
            mended: self.rng.random_range(0.0f32..1.0).powi(2) * 0.6,
            cracks: self.rng.random_range(0.0f32..1.0).powi(2) * 0.7,
            leaves: [
                self.rng.random_range(0.0f32..1.0).powi(3) * 0.5,
                self.rng.random_range(0.0f32..1.0).powi(2) * 0.6,
            ],
            second: [0.0; 2],
            indoors: false,
        }
    }

    fn lines(&mut self, half_width: f32) -> [Option<Line>; 6] {
        let mut lines = [None; 6];
        let half = self.rng.random_range(0.05..0.1);
        let dashes = [[6.0, 3.0], [12.0, 6.0], [9.0, 3.0], [4.0, 1.5], [2.0, 1.0]];
        let mut dash = || -> [f32; 2] { dashes[self.rng.random_range(0..dashes.len())] };
        let (middle, bays) = (dash(), dash());
        let marked = half_width > 3.2 && self.rng.random_bool(0.6);
        if marked {
            let solid = self.rng.random_bool(0.2);
            lines[0] = Some(Line {
                at: self.rng.random_range(-0.15..0.25),
                half,
                dash: if solid { [0.0; 2] } else { middle },
            });
            if solid && self.rng.random_bool(0.5) {
                lines[1] = Some(Line {
                    at: 0.45,
                    half,
                    dash: middle,
                });
            }
        }
        if self.rng.random_bool(0.35) {
            let edge = half_width - self.rng.random_range(0.2..0.6);
            for (slot, side) in [(2, -1.0), (3, 1.0)] {
                lines[slot] = Some(Line {
                    at: side * edge,
                    half,
                    dash: [0.0; 2],
                });
            }
        }
        if half_width > 4.9 && self.rng.random_bool(0.7) {
            let edge = half_width - 2.1;
            for (slot, side) in [(4, -1.0), (5, 1.0)] {
                lines[slot] = Some(Line {
                    at: side * edge,
                    half,
                    dash: if half_width > 6.5 { middle } else { bays },
                });
            }
        }
        lines
    }
}
