//! The obstacles on the line of a row, split at their gaps.

use super::{HALF_M, Row, View};
use crate::Detection;
use crate::box_fit::CAR;
use crate::obstacles::NONE;
use crate::outermost::ends;

/// Size of the cells in which objects that reach the ceiling are found, in metres, and the number of cells to each side and ahead.
const CELL_M: f32 = 0.25;
/// See [`CELL_M`].
const CELLS: [usize; 2] = [160, 280];
/// Anything higher than this, in metres, is a pillar; a car is not as high.
const TALL_M: f32 = 2.1;
/// Heights between which points of a car lie, in metres.
const HEIGHTS_M: [f32; 2] = [0.1, 2.0];
/// Largest lateral distance, in metres.
const SIDE_M: f32 = 14.0;
/// Size of the bins along a row, and smallest width of a gap, in metres.
const PLACE_M: f32 = 0.1;
/// See [`PLACE_M`].
const GAP_M: f32 = 0.25;
/// Widest segment that is a single car, and spacing of cars, in metres.
const WIDEST_M: f32 = 2.4;
/// See [`WIDEST_M`].
const BAY_M: f32 = 2.6;
/// A segment with more cars than this is a wall or a hedge.
const MOST_CARS: usize = 3;
/// Smallest depth of a segment across the row, for one car and for several, in metres: a fence is thinner.
const DEPTH_M: [f32; 2] = [0.15, 0.5];
/// A segment at least this wide, in metres, shows both ends of a car.
const WHOLE_M: f32 = 1.4;
/// Smallest visible length of a car's side for its near end to be known, in metres.
const SIDE_SEEN_M: f32 = 0.5;
/// For the direction of a side: the width of the strips across the row whose nearest points are used, their number, how many must show the
/// side, and their largest distance from a line, in metres.
const STRIP_M: f32 = 0.25;
/// See [`STRIP_M`].
const STRIPS: usize = 24;
/// See [`STRIP_M`].
const SIDE_STRIPS: usize = 5;
/// See [`STRIP_M`].
const STRAIGHT_M: f32 = 0.08;
/// Steepest direction of a side.
const STEEPEST: f32 = 0.7;

/// A point of an obstacle that may be a car.
struct Point {
    at: [f32; 2],
    height: f32,
    pixel: u32,
}

/// The obstacle points, without objects that reach the ceiling.
pub(super) struct ObstaclePoints {
    points: Vec<Point>,
}

impl ObstaclePoints {
    /// Finds these points in an image, leaving out the pixels of `others`, which are known not to be parked.
    pub(super) fn find<'a>(view: &View, others: impl Iterator<Item = &'a Detection>) -> Self {
        let width = view.rays.x.len();
        let mut taken = vec![false; view.depth.len()];
        for run in others.flat_map(|detection| &detection.runs) {
            taken[run.pixels(width)].fill(true);
        }
        let mut points = Vec::new();
        let mut tall = vec![false; CELLS[0] * CELLS[1]];
        for (pixel, height) in view.obstacles.height.iter().enumerate() {
            if *height == NONE || taken[pixel] {
                continue;
            }
            let z = view.depth[pixel];
            let p = view.rays.point(pixel % width, pixel / width, z);
            let [right, forward, _] = view.ground.locate(p);
            let at = [right, forward];
            if right.abs() > SIDE_M {
                continue;
            }
            if *height > TALL_M {
                if let Some(cell) = cell(at) {
                    tall[cell] = true;
                }
            } else if (HEIGHTS_M[0]..HEIGHTS_M[1]).contains(height) {
                points.push(Point {
                    at,
                    height: *height,
                    pixel: pixel as u32,
                });
            }
        }
        points.retain(|p| cell(p.at).is_none_or(|cell| !tall[cell]));
        Self { points }
    }

    /// The segments on a row between two positions along it, in order.
    pub(super) fn segments(&self, row: &Row, [from, to]: [f32; 2], view: &View) -> Vec<Segment> {
        let places = ((to - from).max(0.0) / PLACE_M) as usize + 1;
        let mut taken = vec![false; places];
        let mut there = Vec::new();
        for point in &self.points {
            if point.at[1] < from - HALF_M || point.at[1] > to + HALF_M {
                continue;
            }
            let [along, off] = row.locate(point.at);
            if off.abs() < HALF_M && along > from && along < to {
                let place = ((along - from) / PLACE_M) as usize;
                taken[place] = true;
                there.push((
                    place,
                    RowPoint {
                        along,
                        off,
                        height: point.height,
                        pixel: point.pixel,
                    },
                ));
            }
        }
        let mut parts: Vec<Segment> = Vec::new();
        let mut part_of = vec![0; places];
        let mut last: Option<usize> = None;
        for place in (0..places).filter(|place| taken[*place]) {
            let near = last.is_some_and(|last| ((place - last - 1) as f32) * PLACE_M < GAP_M);
            let start = from + place as f32 * PLACE_M;
            match parts.last_mut().filter(|_| near) {
                Some(part) => part.along[1] = start + PLACE_M,
                None => parts.push(Segment {
                    along: [start, start + PLACE_M],
                    points: Vec::new(),
                }),
            }
            part_of[place] = parts.len() - 1;
            last = Some(place);
        }
        for (place, seen) in there {
            parts[part_of[place]].points.push(seen);
        }
        let area = view.depth.len() as f32 / (640.0 * 192.0);
        let least = ((view.config.min_pixels * area) as usize).max(4);
        parts.retain(|part| part.points.len() >= least);
        parts
    }
}

fn cell([right, forward]: [f32; 2]) -> Option<usize> {
    let x = right / CELL_M + 0.5 * CELLS[0] as f32;
    let y = forward / CELL_M;
    let inside = x >= 0.0 && y >= 0.0 && (x as usize) < CELLS[0] && (y as usize) < CELLS[1];
    inside.then(|| y as usize * CELLS[0] + x as usize)
}

/// A point in its row's coordinates, in metres.
pub(super) struct RowPoint {
    /// Position along the line.
    pub along: f32,
    /// Offset to the right of the row's line.
    pub off: f32,
    /// Height above the ground.
    pub height: f32,
    /// Index of its pixel.
    pub pixel: u32,
}

/// A contiguous stretch of a row that is occupied.
pub(super) struct Segment {
    /// Start and end along the row, metres.
    pub along: [f32; 2],
    points: Vec<RowPoint>,
}

impl Segment {
    /// Its cars: for each one the position of its middle along the row, and its points.
    pub(super) fn cars(&self, row: &Row, view: &View) -> Vec<(f32, Vec<&RowPoint>)> {
        let [from, to] = self.along;
        let width = to - from;
        let count = if width > WIDEST_M {
            ((width + 0.5) / BAY_M).round().max(1.0) as usize
        } else {
            1
        };
        if count > MOST_CARS || self.depth() < DEPTH_M[usize::from(count > 1)] {
            return Vec::new();
        }
        if count == 1 {
            return vec![(self.middle(row, view), self.points.iter().collect())];
        }
        let (piece, step) = (width / count as f32, (width - CAR[1]) / (count - 1) as f32);
        let which = |p: &RowPoint| (((p.along - from) / piece) as usize).min(count - 1);
        (0..count)
            .map(|i| {
                let own = self.points.iter().filter(|p| which(p) == i).collect();
                (from + 0.5 * CAR[1] + i as f32 * step, own)
            })
            .collect()
    }

    /// Depth across the row, metres.
    fn depth(&self) -> f32 {
        let mut off: Vec<f32> = self.points.iter().map(|p| p.off).collect();
        ends(&mut off, 20).map_or(0.0, |[low, high]| high - low)
    }

    /// Position of a single car's middle along the row: a half width inwards from the segment's visible end.
    fn middle(&self, row: &Row, view: &View) -> f32 {
        let [near, far] = self.along;
        let by_near = near + 0.5 * CAR[1];
        if far - near > WHOLE_M || self.shows_side() {
            return by_near;
        }
        // Points nearer along the row are farther out in the image.
        let outwards = if row.at(near) > 0.0 { 1 } else { -1 };
        match [
            self.is_hidden(near, outwards, view),
            self.is_hidden(far, -outwards, view),
        ] {
            [true, false] => far - 0.5 * CAR[1],
            _ => by_near,
        }
    }

    /// Whether the side towards the camera is visible.
    fn shows_side(&self) -> bool {
        let near = self.points.iter();
        let near = near.filter(|p| p.along < self.along[0] + 0.2);
        let ends = [f32::INFINITY, f32::NEG_INFINITY];
        let [low, high] = near.fold(ends, |[low, high], p| [low.min(p.off), high.max(p.off)]);
        high - low > SIDE_SEEN_M
    }

    /// Whether something nearer, or the image's border, hides a continuation at an end, `step` columns farther.
    fn is_hidden(&self, end: f32, step: i64, view: &View) -> bool {
        let width = view.rays.x.len() as i64;
        let (mut hidden, mut all) = (0, 0);
        let there = self.points.iter().filter(|p| (p.along - end).abs() < 0.2);
        for pixel in there.map(|p| i64::from(p.pixel)) {
            let here = view.depth[pixel as usize];
            let nearer = |z: f32| z > 0.0 && z < here - 0.4 - 0.01 * here;
            let inside = (0..width).contains(&(pixel % width + 2 * step));
            all += 1;
            hidden += usize::from(!inside || nearer(view.depth[(pixel + 2 * step) as usize]));
        }
        2 * hidden > all
    }

    /// The slope of a row at a right angle to the near side of its first car, if that side is visible.
    pub(super) fn slope(&self, row: &Row) -> Option<f32> {
        let half = 0.5 * STRIP_M * STRIPS as f32;
        let (mut near, mut counts) = ([f32::INFINITY; STRIPS], [0; STRIPS]);
        for p in self.points.iter().filter(|p| p.along < self.along[0] + 1.0) {
            let strip = ((p.off + half) / STRIP_M) as usize;
            if strip < STRIPS {
                near[strip] = near[strip].min(p.along);
                counts[strip] += 1;
            }
        }
        let middle = |strip: usize| (strip as f32 + 0.5) * STRIP_M - half;
        let side: Vec<[f32; 2]> = (0..STRIPS)
            .filter(|strip| counts[*strip] > 2)
            .map(|strip| [middle(strip), near[strip]])
            .collect();
        if side.len() < SIDE_STRIPS {
            return None;
        }
        // The median over pairs, because a hood or a roof lies farther back.
        let pairs = side
            .iter()
            .enumerate()
            .flat_map(|(i, a)| side[i + 1..].iter().map(move |b| (a, b)));
        let mut turns: Vec<f32> = pairs
            .filter(|(a, b)| b[0] - a[0] > 2.0 * STRIP_M)
            .map(|(a, b)| (b[1] - a[1]) / (b[0] - a[0]))
            .collect();
        turns.sort_unstable_by(f32::total_cmp);
        let turn = *turns.get(turns.len() / 2)?;
        let mut off: Vec<f32> = side.iter().map(|p| p[1] - turn * p[0]).collect();
        off.sort_unstable_by(f32::total_cmp);
        let spread = off[off.len() * 3 / 4] - off[off.len() / 4];
        let slope = row.slope(self.along[0]);
        let straight = spread <= STRAIGHT_M && turn.abs() <= STEEPEST;
        straight.then(|| (slope - turn) / (1.0 + slope * (turn - slope)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parking::row::Parked;
    use crate::parking::scene::Scene;

    /// The segments between two positions on a row 6 m to the right; boxes have this depth across the row, in metres.
    fn standing(pieces: &[[f32; 3]]) -> ObstaclePoints {
        let mut points = Vec::new();
        for [from, to, deep] in pieces {
            let steps = ((to - from) / 0.05) as usize;
            for (i, j) in (0..steps).flat_map(|i| (0..20).map(move |j| (i, j))) {
                let j = j as f32 / 20.0;
                points.push(Point {
                    at: [4.2 + deep * j, from + 0.05 * i as f32],
                    height: 0.2 + 1.2 * j,
                    pixel: points.len() as u32,
                });
            }
        }
        ObstaclePoints { points }
    }

    fn row() -> Row {
        let car = |forward: f32| Parked {
            middle: [6.0, forward],
            slope: 0.0,
            weight: 3.0,
        };
        Row::all(&[car(2.0), car(5.0)]).remove(0)
    }

    #[test]
    fn obstacles_on_a_row_are_split_at_gaps() {
        let scene = Scene::of(&[]);
        let standing = standing(&[[9.0, 10.8, 2.0], [11.4, 13.2, 2.0]]);
        let parts = standing.segments(&row(), [6.0, 20.0], &scene.view());
        assert_eq!(parts.len(), 2);
        let cars = parts[1].cars(&row(), &scene.view());
        let [(along, points)] = &cars[..] else {
            panic!("{} cars", cars.len());
        };
        assert!((along - 12.3).abs() < 0.15, "{along}");
        assert!(points.len() > 400);
        // Only segments between the positions given.
        assert_eq!(
            standing.segments(&row(), [6.0, 11.0], &scene.view()).len(),
            1
        );
    }

    #[test]
    fn cars_side_by_side_are_split_by_width_and_a_wall_is_not_a_car() {
        let scene = Scene::of(&[]);
        let count = |piece: [f32; 3]| {
            let parts = standing(&[piece]).segments(&row(), [6.0, 40.0], &scene.view());
            parts[0].cars(&row(), &scene.view()).len()
        };
        assert_eq!(count([9.0, 10.9, 2.0]), 1);
        assert_eq!(count([9.0, 13.6, 2.0]), 2);
        assert_eq!(count([9.0, 16.1, 2.0]), 3);
        // Longer than three cars, or a fence: neither consists of cars.
        assert_eq!(count([9.0, 24.0, 2.0]), 0);
        assert_eq!(count([9.0, 13.6, 0.2]), 0);
    }

    #[test]
    fn a_visible_side_gives_the_rows_direction() {
        let scene = Scene::of(&[]);
        // The side towards the camera, turned by 0.15 like the whole car.
        let points = (0..400).map(|i| {
            let across = (i / 5) as f32 * 0.05;
            Point {
                at: [4.0 + across, 9.0 + 0.15 * across],
                height: 0.3 + 0.2 * (i % 5) as f32,
                pixel: i,
            }
        });
        let standing = ObstaclePoints {
            points: points.collect(),
        };
        let parts = standing.segments(&row(), [6.0, 20.0], &scene.view());
        let slope = parts[0].slope(&row()).unwrap();
        assert!((slope + 0.15).abs() < 0.03, "{slope}");
    }
}
