//! The street's centreline and the coordinates along it.
//!
//! World frame: x and y horizontal, z up, metres; the road surface is z = 0. Street coordinates:
//! `s` metres along the centreline, `lateral` metres to its left.

use crate::texture::noise::smoothstep;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Distance between two samples of the centreline, in metres.
pub(crate) const STEP: f64 = 0.5;

/// Height of pavements and gardens above the road, in metres.
pub(crate) const KERB_HEIGHT: f32 = 0.13;

/// Side of a cell of the look-up grid, in metres.
const CELL: f64 = 4.0;

/// Half the width of the look-up grid across the road, in cells.
const CELL_REACH: i64 = 36;

/// Length of a side street, measured from the centreline, in metres.
pub(crate) const SIDE_STREET_LENGTH: f32 = 75.0;

/// Largest heading of the road against the world's x axis, in radians: a road that never turns back
/// cannot cross itself.
const MAX_HEADING: f64 = 1.0;

/// One sample of the centreline.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RoadSample {
    /// World position, metres.
    pub x: f64,
    /// World position, metres.
    pub y: f64,
    /// Direction against world x, radians.
    pub heading: f64,
    /// Curvature, 1/m, positive to the left.
    pub curvature: f64,
    /// Half the width of the carriageway, metres.
    pub half_width: f32,
    /// Width of the pavements, metres: right, left.
    pub pavement: [f32; 2],
    /// Width of the strips of grass between kerb and pavement, metres: right, left.
    pub verge: [f32; 2],
    /// Index into [`Road::side_streets`] + 1 of a nearby side street, or 0: right, left.
    side_street: [u16; 2],
}

/// A street that leaves the main one at a right angle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SideStreet {
    /// Position of the junction, metres along the centreline.
    pub s: f32,
    /// 0: to the right, 1: to the left.
    pub side: usize,
    /// Half its width, metres.
    pub half_width: f32,
}

/// Street coordinates of a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StreetPoint {
    /// Index of the nearest sample.
    pub index: usize,
    /// Metres along the centreline.
    pub s: f32,
    /// Metres to the left of it.
    pub lateral: f32,
}

/// The street.
pub(crate) struct Road {
    /// `s` of the first sample, metres (negative: the street begins behind the start).
    pub start: f64,
    /// Height of the ground beside the carriageway above it, metres.
    pub kerb: f32,
    samples: Vec<RoadSample>,
    /// Unit tangents, curvature and widths again, in f32 and packed for the renderer.
    packed: Vec<[f32; 5]>,
    side_streets: Vec<SideStreet>,
    grid: Vec<Vec<u32>>,
    grid_x0: f64,
}

impl Road {
    /// A random centreline from `start` to at least `end` (metres), without widths yet.
    pub(crate) fn generate(rng: &mut ChaCha8Rng, start: f64, end: f64) -> Self {
        let count = ((end - start) / STEP).ceil() as usize + 2;
        Self::curved(&curvature_profile(rng, count), start)
    }

    /// A straight centreline from `start` to at least `end` (metres), without widths yet.
    pub(crate) fn straight(start: f64, end: f64) -> Self {
        let count = ((end - start) / STEP).ceil() as usize + 2;
        Self::curved(&vec![0.0; count], start)
    }

    /// A road with gentle bends from `start` to at least `end` (metres): a motorway or a country road, with radii of 150 to 1500 m.
    pub(crate) fn gentle(rng: &mut ChaCha8Rng, start: f64, end: f64) -> Self {
        let count = ((end - start) / STEP).ceil() as usize + 2;
        let scale: f64 = rng.random_range(0.08..0.4);
        let profile: Vec<f64> = curvature_profile(rng, count)
            .into_iter()
            .map(|k| k * scale)
            .collect();
        Self::curved(&profile, start)
    }

    /// A centreline with these curvatures.
    fn curved(curvature: &[f64], start: f64) -> Self {
        let count = curvature.len();
        let mut samples = Vec::with_capacity(count);
        let mut here = RoadSample::default();
        for (i, k) in curvature.iter().enumerate() {
            here.curvature = *k;
            samples.push(here);
            // Midpoint steps along the clothoid, fine enough for 1e-7 m.
            let next = curvature.get(i + 1).copied().unwrap_or(*k);
            const PARTS: usize = 10;
            let h = STEP / PARTS as f64;
            for part in 0..PARTS {
                let k0 = k + (next - k) * (part as f64 / PARTS as f64);
                let k_mid = k + (next - k) * ((part as f64 + 0.5) / PARTS as f64);
                let middle = here.heading + 0.5 * h * 0.5 * (k0 + k_mid);
                here.x += h * middle.cos();
                here.y += h * middle.sin();
                here.heading += h * k_mid;
            }
        }
        // The world's origin and x axis are those of s = 0.
        let zero = ((-start / STEP).round() as usize).min(count - 1);
        let origin = samples[zero];
        for sample in &mut samples {
            sample.x -= origin.x;
            sample.y -= origin.y;
        }
        let mut road = Self {
            start,
            kerb: KERB_HEIGHT,
            samples,
            packed: Vec::new(),
            side_streets: Vec::new(),
            grid: Vec::new(),
            grid_x0: 0.0,
        };
        road.index();
        road
    }

    /// Removes everything beyond `end` metres.
    pub(crate) fn truncate(&mut self, end: f64) {
        let keep = (((end - self.start) / STEP).ceil() as usize + 1).min(self.samples.len());
        self.samples.truncate(keep);
        self.index();
    }

    /// Where the street ends, in metres.
    pub(crate) fn end(&self) -> f64 {
        self.start + STEP * (self.samples.len() - 1) as f64
    }

    /// The samples, for the layout to fill in the widths.
    pub(crate) fn samples_mut(&mut self) -> &mut [RoadSample] {
        &mut self.samples
    }

    /// The sample at an index of [`StreetPoint`].
    #[inline]
    pub(crate) fn sample(&self, index: usize) -> &RoadSample {
        &self.samples[index]
    }

    /// The road's direction at an index of [`StreetPoint`], a unit vector.
    #[inline]
    pub(crate) fn tangent(&self, index: usize) -> (f32, f32) {
        (self.packed[index][0], self.packed[index][1])
    }

    /// Index of the sample nearest to `s`, clamped to the street.
    pub(crate) fn index_at(&self, s: f64) -> usize {
        let index = ((s - self.start) / STEP).round();
        (index.max(0.0) as usize).min(self.samples.len() - 1)
    }

    /// The side streets.
    pub(crate) fn side_streets(&self) -> &[SideStreet] {
        &self.side_streets
    }

    /// Adds a side street.
    pub(crate) fn add_side_street(&mut self, street: SideStreet) {
        self.side_streets.push(street);
        let number = self.side_streets.len() as u16;
        let reach = f64::from(street.half_width) + 14.0;
        let from = self.index_at(f64::from(street.s) - reach);
        let to = self.index_at(f64::from(street.s) + reach);
        for sample in &mut self.samples[from..=to] {
            sample.side_street[street.side] = number;
        }
    }

    /// Centre, heading and curvature at `s`, smooth between the samples (cubic Hermite).
    pub(crate) fn centre(&self, s: f64) -> (f64, f64, f64, f64) {
        let position = ((s - self.start) / STEP).clamp(0.0, (self.samples.len() - 2) as f64);
        let index = (position.floor() as usize).min(self.samples.len() - 2);
        let (a, b) = (&self.samples[index], &self.samples[index + 1]);
        let t = position - index as f64;
        let (t2, t3) = (t * t, t * t * t);
        let h = [
            2.0 * t3 - 3.0 * t2 + 1.0,
            (t3 - 2.0 * t2 + t) * STEP,
            3.0 * t2 - 2.0 * t3,
            (t3 - t2) * STEP,
        ];
        let mix = |p0, m0, p1, m1| h[0] * p0 + h[1] * m0 + h[2] * p1 + h[3] * m1;
        (
            mix(a.x, a.heading.cos(), b.x, b.heading.cos()),
            mix(a.y, a.heading.sin(), b.y, b.heading.sin()),
            mix(a.heading, a.curvature, b.heading, b.curvature),
            a.curvature + (b.curvature - a.curvature) * t,
        )
    }

    /// World position of street coordinates, and the heading there.
    pub(crate) fn world(&self, s: f64, lateral: f64) -> (f64, f64, f64) {
        let (x, y, heading, _) = self.centre(s);
        (
            x - lateral * heading.sin(),
            y + lateral * heading.cos(),
            heading,
        )
    }

    /// Street coordinates of a world point, found from the grid.
    #[inline]
    pub(crate) fn locate(&self, x: f64, y: f64) -> StreetPoint {
        let column = (((x - self.grid_x0) / CELL).max(0.0) as usize).min(self.grid.len() - 1);
        let cells = &self.grid[column];
        // The first entry of a column is the row of the centreline; the others are hints.
        let row = (y / CELL).floor() as i64 - i64::from(cells[0] as i32) + CELL_REACH;
        let row = row.clamp(0, 2 * CELL_REACH) as usize;
        self.locate_from(x, y, cells[1 + row] as usize)
    }

    /// As [`Road::locate`], from the index of a sample nearby.
    #[inline]
    pub(crate) fn locate_from(&self, x: f64, y: f64, hint: usize) -> StreetPoint {
        let last = self.packed.len() - 1;
        let mut index = hint.min(last);
        let (mut along, mut lateral, mut stretch) = self.offsets(x, y, index);
        for _ in 0..5 {
            // Slightly more than half a step: otherwise a point midway between two samples would alternate between them.
            if along.abs() <= 0.502 * STEP as f32 {
                break;
            }
            let shift = (along / STEP as f32).round();
            let next = (index as f32 + shift).clamp(0.0, last as f32) as usize;
            if next == index {
                break;
            }
            index = next;
            (along, lateral, stretch) = self.offsets(x, y, index);
        }
        let k = self.packed[index][2];
        StreetPoint {
            index,
            s: (self.start + index as f64 * STEP) as f32 + along,
            // The centreline deviates from its tangent by k·along²/2.
            lateral: lateral - 0.5 * k * along * along * stretch,
        }
    }

    /// Metres along the centreline from a sample to a point, metres to the left of the centreline, and the length of a parallel through the
    /// point as a share of the centreline's.
    #[inline]
    fn offsets(&self, x: f64, y: f64, index: usize) -> (f32, f32, f32) {
        let sample = &self.samples[index];
        let [tx, ty, k, ..] = self.packed[index];
        let (dx, dy) = ((x - sample.x) as f32, (y - sample.y) as f32);
        let lateral = dy * tx - dx * ty;
        let stretch = (1.0 - k * lateral).max(0.25);
        ((dx * tx + dy * ty) / stretch, lateral, stretch)
    }

    /// Signed distance to the kerb, metres: negative on a carriageway.
    #[inline]
    pub(crate) fn kerb_distance(&self, p: &StreetPoint) -> f32 {
        let half_width = self.half_width(p);
        let main = p.lateral.abs() - half_width;
        let side = usize::from(p.lateral > 0.0);
        let number = self.samples[p.index].side_street[side];
        if number == 0 {
            return main;
        }
        let street = &self.side_streets[usize::from(number) - 1];
        let across =
            ((p.s - street.s).abs() - street.half_width).max(p.lateral.abs() - SIDE_STREET_LENGTH);
        // A smooth minimum rounds the kerb at the corner.
        let (radius, gap) = (5.0, (main - across).abs());
        let blend = (radius - gap).max(0.0) / radius;
        main.min(across) - 0.25 * radius * blend * blend
    }

    /// Half the width of the carriageway at a point, interpolated.
    #[inline]
    pub(crate) fn half_width(&self, p: &StreetPoint) -> f32 {
        let [_, _, _, width, slope] = self.packed[p.index];
        let along = p.s - (self.start + p.index as f64 * STEP) as f32;
        width + slope * along
    }

    /// Builds the look-up tables. Call it after any change of the samples.
    pub(crate) fn index(&mut self) {
        let n = self.samples.len();
        self.packed = (0..n)
            .map(|i| {
                let sample = &self.samples[i];
                let before = &self.samples[i.saturating_sub(1)];
                let after = &self.samples[(i + 1).min(n - 1)];
                let slope = (after.half_width - before.half_width) / (2.0 * STEP as f32);
                [
                    sample.heading.cos() as f32,
                    sample.heading.sin() as f32,
                    sample.curvature as f32,
                    sample.half_width,
                    slope,
                ]
            })
            .collect();
        self.grid_x0 = self.samples[0].x - 100.0;
        let columns = ((self.samples[n - 1].x + 100.0 - self.grid_x0) / CELL).ceil() as usize;
        let mut middle = 0;
        self.grid = (0..columns)
            .map(|column| {
                let x = self.grid_x0 + (column as f64 + 0.5) * CELL;
                // x grows with s, since the heading never reaches a right angle.
                while middle + 1 < n && self.samples[middle].x < x {
                    middle += 1;
                }
                let base = (self.samples[middle].y / CELL).floor() as i64;
                let mut cells = vec![base as i32 as u32];
                for row in -CELL_REACH..=CELL_REACH {
                    let y = ((base + row) as f64 + 0.5) * CELL;
                    cells.push(self.nearest(x, y, middle) as u32);
                }
                cells
            })
            .collect();
    }

    /// Index of the sample nearest to a point, among those near `middle`.
    fn nearest(&self, x: f64, y: f64, middle: usize) -> usize {
        let away = (y - self.samples[middle].y).abs();
        let reach = ((away / STEP) as usize + 20) / 2 * 2;
        let (from, to) = (
            middle.saturating_sub(reach),
            (middle + reach).min(self.samples.len() - 1),
        );
        let distance = |i: usize| {
            let sample = &self.samples[i];
            (sample.x - x).powi(2) + (sample.y - y).powi(2)
        };
        let coarse = (from..=to)
            .step_by(4)
            .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
            .unwrap_or(middle);
        (coarse.saturating_sub(4)..=(coarse + 4).min(self.samples.len() - 1))
            .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
            .unwrap_or(coarse)
    }
}

/// Straights and curves with smooth ends, the heading kept within [`MAX_HEADING`].
fn curvature_profile(rng: &mut ChaCha8Rng, count: usize) -> Vec<f64> {
    let mut curvature = vec![0.0; count];
    let (mut position, mut heading) = (rng.random_range(20.0..70.0), 0.0f64);
    while position < count as f64 * STEP {
        // Turn towards a new heading. The farther the road is off the axis, the more likely it turns back.
        let target: f64 = rng.random_range(-MAX_HEADING..MAX_HEADING);
        let turn = target - heading;
        let radius: f64 = if rng.random_bool(0.35) {
            rng.random_range(32.0..60.0)
        } else {
            rng.random_range(60.0..220.0)
        };
        let ramp = (0.3 * radius).clamp(12.0, 40.0);
        // A ramp by smoothstep turns half as much as the full curve of its length.
        let full = (turn.abs() * radius - ramp).max(0.0);
        let scale = turn.abs() * radius / (full + ramp);
        let length = full + 2.0 * ramp;
        let k = turn.signum() * scale / radius;
        let first = (position / STEP) as usize;
        let last = (((position + length) / STEP) as usize).min(count - 1);
        for (i, value) in curvature.iter_mut().enumerate().take(last).skip(first) {
            let along = (i - first) as f64 * STEP;
            let rise = (along / ramp).min(1.0);
            let fall = ((length - along) / ramp).clamp(0.0, 1.0);
            *value = k * f64::from(smoothstep(0.0, 1.0, rise.min(fall) as f32));
        }
        heading = target;
        position += length + rng.random_range(8.0..70.0);
    }
    curvature
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn road(seed: u64) -> Road {
        let mut road = Road::generate(&mut ChaCha8Rng::seed_from_u64(seed), -60.0, 900.0);
        for sample in road.samples_mut() {
            sample.half_width = 4.0;
        }
        road.index();
        road
    }

    #[test]
    fn locate_inverts_world() {
        for seed in 0..6 {
            let road = road(seed);
            for step in 0..800 {
                let s = f64::from(step) * 1.07 - 20.0;
                for lateral in [-24.0, -6.3, 0.0, 1.7, 13.0, 26.0] {
                    let (x, y, _) = road.world(s, lateral);
                    let p = road.locate(x, y);
                    let error = (f64::from(p.s) - s)
                        .abs()
                        .max((f64::from(p.lateral) - lateral).abs());
                    assert!(error < 0.02, "seed {seed}, s {s}, {lateral}: {p:?}");
                }
            }
        }
    }

    #[test]
    fn street_coordinates_are_continuous_near_the_road() {
        let road = road(3);
        let mut before: Option<StreetPoint> = None;
        for step in 0..40_000 {
            let (x, y, _) = road.world(f64::from(step) * 0.01, 5.0);
            let p = road.locate(x, y);
            if let Some(b) = before {
                assert!((p.lateral - b.lateral).abs() < 2e-3, "{b:?} {p:?}");
                assert!(p.s > b.s - 2e-3 && p.s - b.s < 0.02, "{b:?} {p:?}");
            }
            before = Some(p);
        }
    }

    #[test]
    fn the_heading_stays_bounded_and_the_road_bends() {
        for seed in 0..10 {
            let road = road(seed);
            let widest = road
                .samples
                .iter()
                .map(|sample| sample.heading.abs())
                .fold(0.0, f64::max);
            assert!(widest < MAX_HEADING + 0.1, "seed {seed}: {widest}");
            assert!(widest > 0.15, "seed {seed}: {widest}");
        }
    }

    #[test]
    fn the_kerb_is_open_at_a_side_street() {
        let mut road = road(5);
        road.add_side_street(SideStreet {
            s: 100.0,
            side: 1,
            half_width: 3.0,
        });
        let at = |s, lateral| {
            let (x, y, _) = road.world(s, lateral);
            road.kerb_distance(&road.locate(x, y))
        };
        assert!(at(100.0, 3.0) < 0.0 && at(100.0, 15.0) < 0.0);
        assert!(at(100.0, -15.0) > 0.0, "only to the left");
        assert!(at(120.0, 15.0) > 0.0 && at(120.0, 3.0) < 0.0);
    }
}
