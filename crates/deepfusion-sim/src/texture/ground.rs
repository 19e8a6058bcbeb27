//! Asphalt, markings, kerbs, pavements, grass.

use super::facade::courses;
use super::ground_style::GroundStyle;
use super::noise::{Noise, band, bands, beyond, hash, length, lerp, smoothstep, unit};
use super::{Rgb, mix, vary};

/// A piece of ground that is visible in one pixel, or in one sample of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GroundPatch {
    /// World x, metres.
    pub x: f32,
    /// World y, metres.
    pub y: f32,
    /// Metres along the street.
    pub s: f32,
    /// Metres left of its centreline.
    pub lateral: f32,
    /// Half the carriageway's width here, metres.
    pub half_width: f32,
    /// Distance to the kerb, metres; negative on the carriageway.
    pub kerb: f32,
    /// Size of the patch, metres.
    pub size: f32,
    /// Extents along `s` and along `lateral`, metres.
    pub extent: [f32; 2],
}

/// Markings of a stretch of road, and the ground beside it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Stretch {
    /// Dashes along the middle: their period and length, metres; 0: none.
    pub dashes: [f32; 2],
    /// Whether there are lines along the edges.
    pub edge_lines: bool,
    /// Zebra crossing at this s; NaN: none.
    pub zebra: f32,
    /// Tone of the asphalt.
    pub asphalt: f32,
    /// Whether bays for parked cars are marked.
    pub bays: bool,
    /// Ground beyond the pavement: right, left.
    pub beyond: [Beyond; 2],
    /// Surface of the pavement: right, left.
    pub paving: [Paving; 2],
    /// The ground of a varied world, in place of all of the above.
    pub style: Option<GroundStyle>,
}

impl Stretch {
    /// A stretch of a varied world, where the style replaces all else.
    pub(crate) fn styled(style: GroundStyle) -> Self {
        Self {
            zebra: f32::NAN,
            style: Some(style),
            ..Self::default()
        }
    }
}

/// Ground beyond the pavement.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Beyond {
    /// A lawn.
    #[default]
    Grass,
    /// A paved yard.
    Paved,
    /// Gravel and bare soil.
    Gravel,
}

/// Surface of a pavement.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Paving {
    /// Square slabs.
    #[default]
    Slabs,
    /// Small red-grey stones.
    Cobbles,
    /// Asphalt.
    Asphalt,
}

/// The carriageway.
#[inline(never)]
pub(crate) fn road(noise: &Noise, p: &GroundPatch, stretch: &Stretch, seed: u32) -> Rgb {
    if let Some(style) = &stretch.style {
        return style.carriageway(noise, p, seed);
    }
    let mut tone = stretch.asphalt;
    // The asphalt of whole stretches differs in age, and patches were mended.
    tone *= 1.0 + 0.18 * noise.wave(p.x, p.y, 23.0, p.size);
    let (cell_s, cell_l) = (7.3, 2.1);
    let drift = 1.7 * noise.at(p.s * 0.02, 0.5);
    let (cs, cl) = (
        (p.s / cell_s).floor(),
        ((p.lateral + drift) / cell_l).floor(),
    );
    let code = hash(cs as i32, cl as i32, seed);
    if unit(code, 0) < 0.2 {
        let (u, v) = (p.s - cs * cell_s, p.lateral + drift - cl * cell_l);
        let (a, b) = (0.3 + 2.5 * unit(code, 1), 4.0 + 3.0 * unit(code, 2));
        let c = 0.1 + 0.7 * unit(code, 3);
        let inside = band(u, a, b, p.extent[0]) * band(v, c, 2.0, p.extent[1]);
        let core = band(u, a + 0.06, b - 0.06, p.extent[0]) * band(v, c + 0.06, 1.94, p.extent[1]);
        let new = if code & 1 == 0 { 0.68 } else { 1.3 };
        tone *= lerp(1.0, new, inside) * (1.0 - 0.5 * (inside - core));
    }
    // Oil drips on the middle of the lanes, and tyres polish their tracks.
    let lane = p.lateral.abs() - 0.5 * p.half_width.min(3.6);
    let track = (-(lane.abs() - 0.75).powi(2) * 9.0).exp();
    tone *= 1.0 - 0.1 * track - 0.1 * (-lane * lane * 7.0).exp();
    let grain = noise.fractal(p.x, p.y, 1.3, 6, 0.9, p.size);
    let stain = noise.fractal(p.y + 41.0, p.x, 3.4, 3, 0.6, p.size);
    tone *= (1.0 + 0.25 * grain).max(0.2) * (1.0 - 0.4 * smoothstep(0.35, 0.9, stain));
    // Cracks, and the seam between the lanes sealed with tar.
    let crack = noise.ridge(p.x, p.y, 2.7, 0.025, p.size)
        + noise.ridge(p.y - 7.0, p.x, 1.1, 0.014, p.size)
            * smoothstep(0.0, 0.4, noise.at(p.x * 0.13, p.y * 0.13));
    let seam = p.lateral - 0.15 - 0.09 * noise.at(p.s * 0.7, 3.0);
    tone *= 1.0 - 0.55 * crack.min(1.0);
    if hash(3, 4, seed) % 5 < 2 {
        tone *= 1.0 - 0.45 * band(seam, -0.035, 0.035, p.extent[1]);
    }
    let mut colour = Rgb::new(1.0, 0.985, 0.96) * tone;
    colour = mix(
        &colour,
        &Rgb::new(0.62, 0.61, 0.58),
        markings(noise, p, stretch),
    );
    colour = manhole(noise, p, &colour, seed);
    // The gutter: stones, sand and leaves.
    let gutter = beyond(p.kerb, -0.32, p.extent[1]);
    let stones = courses(
        &Rgb::new(0.2, 0.19, 0.18),
        p.s,
        p.lateral,
        [0.5, 0.16],
        0.02,
        p.extent[0],
        p.extent[1],
        seed,
        0.5,
    );
    colour = mix(&colour, &vary(&stones, grain, 0.25), gutter);
    leaves(
        p,
        &colour,
        0.05 + 0.35 * smoothstep(-1.4, -0.1, p.kerb),
        seed,
    )
}

/// Paint on the road, 0 to 1, worn by traffic.
#[inline]
fn markings(noise: &Noise, p: &GroundPatch, stretch: &Stretch) -> f32 {
    let [fs, fl] = p.extent;
    let mut paint = 0.0f32;
    if stretch.dashes[0] > 0.0 && p.lateral.abs() < 1.0 + fl {
        let dash = bands(p.s, stretch.dashes[0], 0.0, stretch.dashes[1], fs);
        paint = dash * band(p.lateral, -0.07, 0.07, fl);
    }
    if stretch.edge_lines {
        let edge = p.half_width - 0.55;
        paint = paint.max(band(p.lateral.abs(), edge - 0.07, edge + 0.07, fl));
    }
    if stretch.bays {
        let edge = p.half_width - 2.1;
        let line =
            band(p.lateral.abs(), edge - 0.06, edge + 0.06, fl) * bands(p.s, 1.5, 0.0, 0.75, fs);
        let ends = bands(p.s, 5.6, 0.0, 0.12, fs) * beyond(p.lateral.abs(), edge, fl);
        paint = paint.max(line.max(ends));
    }
    let zebra = p.s - stretch.zebra;
    if zebra.abs() < 2.0 + fs {
        let stripes = bands(p.lateral + 50.0, 1.0, 0.0, 0.5, fl);
        paint = paint.max(stripes * band(zebra, -1.9, 1.9, fs));
    }
    if paint <= 0.0 {
        return 0.0;
    }
    let wear = noise.fractal(p.x + 3.0, p.y, 0.9, 5, 0.8, p.size);
    let kept = (0.8 - 0.45 * wear).clamp(0.15, 1.0);
    paint * kept * beyond(-p.kerb, 0.1, fl)
}

/// A manhole cover in some places.
#[inline]
pub(crate) fn manhole(noise: &Noise, p: &GroundPatch, colour: &Rgb, seed: u32) -> Rgb {
    let (cs, cl) = ((p.s / 11.0).floor(), (p.lateral / 2.9).floor());
    let code = hash(cs as i32, cl as i32, seed ^ 0xAB);
    if unit(code, 0) > 0.33 || p.size > 0.3 {
        return *colour;
    }
    let du = p.s - (cs + 0.15 + 0.7 * unit(code, 1)) * 11.0;
    let dv = p.lateral - (cl + 0.25 + 0.5 * unit(code, 2)) * 2.9;
    let away = length(du, dv);
    if away > 1.2 {
        return *colour;
    }
    let lid = 1.0 - beyond(away, 0.34, p.size);
    let ring = 1.0 - beyond(away, 0.45, p.size);
    let pattern =
        bands(du + dv, 0.13, 0.0, 0.06, p.size) * bands(du - dv + 9.0, 0.13, 0.0, 0.06, p.size);
    let rust = 1.0 + 0.3 * noise.wave(p.x, p.y, 0.2, p.size);
    let iron = Rgb::new(0.1, 0.085, 0.075) * (rust * (0.7 + 0.9 * pattern));
    mix(&(colour * (1.0 - 0.45 * ring)), &iron, lid)
}

/// Fallen leaves and litter: at most one in each cell of 0.4 m.
#[inline]
pub(crate) fn leaves(p: &GroundPatch, colour: &Rgb, density: f32, seed: u32) -> Rgb {
    const CELL: f32 = 0.4;
    let seen = (1.5 - p.size / 0.09).clamp(0.0, 1.0);
    if seen <= 0.0 {
        return *colour;
    }
    let (cx, cy) = ((p.x / CELL).floor(), (p.y / CELL).floor());
    let code = hash(cx as i32, cy as i32, seed ^ 0x1EAF);
    if unit(code, 0) > density {
        return *colour;
    }
    let size = 0.035 + 0.05 * unit(code, 1);
    let dx = p.x - (cx + 0.3 + 0.4 * unit(code, 2)) * CELL;
    let dy = p.y - (cy + 0.3 + 0.4 * unit(code, 3)) * CELL;
    let leaf = 1.0
        - beyond(
            (dx * dx + 1.8 * dy * dy + 0.9 * dx * dy).max(0.0).sqrt(),
            size,
            p.size,
        );
    let autumn = unit(code.rotate_left(9), 0);
    let tint = Rgb::new(
        0.3 + 0.25 * autumn,
        0.14 + 0.22 * autumn,
        0.04 + 0.05 * autumn,
    );
    mix(colour, &tint, leaf * seen)
}

/// The upright face of the kerb; `height` metres above the road.
pub(crate) fn kerb(noise: &Noise, p: &GroundPatch, height: f32) -> Rgb {
    let grain = noise.fractal(p.x + p.y, p.y - p.x, 0.8, 5, 0.7, p.size);
    let joints = bands(p.s + p.lateral, 1.0, 0.0, 0.02, p.extent[0].max(p.size));
    let code = hash((p.s + p.lateral).floor() as i32, 5, 11);
    let tone = 0.3 * (0.8 + 0.4 * unit(code, 0)) * (0.7 + 2.0 * height);
    vary(&Rgb::new(tone, tone * 0.98, tone * 0.94), grain, 0.3) * (1.0 - 0.6 * joints)
}

/// Beside the road: kerb stone, verge, pavement, and what lies beyond them. `verge` and `pavement`
/// are their widths.
#[inline(never)]
pub(crate) fn beside(
    noise: &Noise,
    p: &GroundPatch,
    stretch: &Stretch,
    verge: f32,
    pavement: f32,
    seed: u32,
) -> Rgb {
    if let Some(style) = &stretch.style {
        return style.beside(noise, p, verge, pavement, seed);
    }
    let side = usize::from(p.lateral > 0.0);
    let fl = p.extent[1];
    let grain = noise.fractal(p.x - 13.0, p.y, 1.2, 6, 0.9, p.size);
    if p.kerb < 0.16 - 0.5 * fl {
        return vary(&kerb(noise, p, 0.13), grain, 0.1);
    }
    let (inner, outer) = (0.16 + verge, 0.16 + verge + pavement);
    let paved = band(p.kerb, inner, outer, fl);
    let mut colour = Rgb::zeros();
    if paved > 0.0 {
        colour += paving(noise, p, stretch.paving[side], grain, seed) * paved;
    }
    if paved < 1.0 {
        let rest = if p.kerb < inner {
            grass(noise, p, grain)
        } else {
            match stretch.beyond[side] {
                Beyond::Grass => grass(noise, p, grain),
                Beyond::Paved => paving(noise, p, Paving::Cobbles, grain, seed ^ 7),
                Beyond::Gravel => {
                    let soil = noise.fractal(p.y, p.x + 5.0, 4.0, 3, 0.6, p.size);
                    let base = mix(
                        &Rgb::new(0.3, 0.27, 0.22),
                        &Rgb::new(0.14, 0.12, 0.08),
                        0.5 + 0.5 * soil,
                    );
                    vary(&base, grain, 0.3)
                }
            }
        };
        colour += rest * (1.0 - paved);
    }
    leaves(p, &colour, 0.22, seed)
}

#[inline]
fn paving(noise: &Noise, p: &GroundPatch, kind: Paving, grain: f32, seed: u32) -> Rgb {
    let [fs, fl] = p.extent;
    let base = match kind {
        Paving::Slabs => courses(
            &Rgb::new(0.33, 0.31, 0.28),
            p.s,
            p.lateral,
            [0.6, 0.45],
            0.025,
            fs,
            fl,
            seed,
            0.5,
        ),
        Paving::Cobbles => courses(
            &Rgb::new(0.27, 0.2, 0.17),
            p.s,
            p.lateral,
            [0.2, 0.12],
            0.02,
            fs,
            fl,
            seed,
            0.7,
        ),
        Paving::Asphalt => Rgb::new(0.16, 0.16, 0.155),
    };
    let stain = noise.fractal(p.y + 77.0, p.x, 2.8, 4, 0.65, p.size);
    vary(&base, grain, 0.28) * (1.0 - 0.4 * smoothstep(0.3, 0.9, stain))
}

#[inline]
fn grass(noise: &Noise, p: &GroundPatch, grain: f32) -> Rgb {
    let dry = noise.fractal(p.x + 91.0, p.y, 5.0, 4, 0.65, p.size);
    let green = mix(
        &Rgb::new(0.075, 0.13, 0.03),
        &Rgb::new(0.2, 0.18, 0.075),
        smoothstep(-0.4, 1.0, dry),
    );
    vary(&green, grain, 0.42)
}
