//! An upright box around what is seen of an object, completed to what it must be.

use crate::silhouette::Silhouette;

/// A box on the ground, in the ground's axes (right, forward, height).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundBox {
    /// Middle of the footprint: right, forward, in metres.
    pub middle: [f32; 2],
    /// Angle from `right` to the length, towards `forward`, in radians; a box has none beyond half a turn.
    pub angle: f32,
    /// Length and width, in metres; length is not the smaller.
    pub footprint: [f32; 2],
    /// Height of the lower and the upper face over the ground, in metres.
    pub heights: [f32; 2],
    /// Share of the length and of the width that was seen.
    pub seen: [f32; 2],
    /// The point of the footprint that stays where it is if the extents are found to be others: the corner or the
    /// middle of the side that was seen, (right, forward) in metres.
    pub anchor: [f32; 2],
}

impl GroundBox {
    /// The four corners of the footprint: right, forward, in metres, around it.
    #[must_use]
    pub fn corners(&self) -> [[f32; 2]; 4] {
        let [along, across] = axes(self.angle);
        let [length, width] = self.footprint.map(|s| 0.5 * s);
        [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|[a, b]| {
            [0, 1].map(|k| self.middle[k] + a * length * along[k] + b * width * across[k])
        })
    }

    /// Middle of the footprint if its extents along its own length and width were these, in metres.
    #[must_use]
    pub fn middle_with(&self, extents: [f32; 2]) -> [f32; 2] {
        let mut middle = self.anchor;
        for (i, axis) in axes(self.angle).into_iter().enumerate() {
            let off = (self.middle[0] - self.anchor[0]) * axis[0]
                + (self.middle[1] - self.anchor[1]) * axis[1];
            let off = off * extents[i] / self.footprint[i].max(1e-3);
            middle = [middle[0] + off * axis[0], middle[1] + off * axis[1]];
        }
        middle
    }

    /// Area that two footprints share over that of the smaller, 0 to 1.
    #[must_use]
    pub fn overlap(&self, other: &Self) -> f32 {
        let apart = [0, 1].map(|k| self.middle[k] - other.middle[k]);
        let reach = |b: &Self| 0.5 * b.footprint[0].hypot(b.footprint[1]);
        if apart[0].hypot(apart[1]) > reach(self) + reach(other) {
            return 0.0;
        }
        let area = |b: &Self| b.footprint[0] * b.footprint[1];
        let shared = polygon_area(&clipped(self.corners().to_vec(), other));
        shared / area(self).min(area(other)).max(1e-6)
    }
}

/// A convex polygon's part inside a box (Sutherland and Hodgman).
fn clipped(mut polygon: Vec<[f32; 2]>, within: &GroundBox) -> Vec<[f32; 2]> {
    for (axis, half) in axes(within.angle).into_iter().zip(within.footprint) {
        for sign in [1.0, -1.0] {
            let inside = |p: &[f32; 2]| {
                let off = (p[0] - within.middle[0]) * axis[0] + (p[1] - within.middle[1]) * axis[1];
                0.5 * half - sign * off
            };
            let mut next = Vec::with_capacity(polygon.len() + 1);
            for (i, p) in polygon.iter().enumerate() {
                let q = &polygon[(i + 1) % polygon.len()];
                let (a, b) = (inside(p), inside(q));
                if a >= 0.0 {
                    next.push(*p);
                }
                if (a >= 0.0) != (b >= 0.0) {
                    let share = a / (a - b);
                    next.push([0, 1].map(|k| p[k] + share * (q[k] - p[k])));
                }
            }
            polygon = next;
        }
    }
    polygon
}

fn polygon_area(polygon: &[[f32; 2]]) -> f32 {
    let next = polygon.iter().cycle().skip(1);
    let twice: f32 = polygon
        .iter()
        .zip(next)
        .map(|(p, q)| p[0] * q[1] - p[1] * q[0])
        .sum();
    0.5 * twice.abs()
}

/// Length and width of a usual car, metres.
const CAR: [f32; 2] = [4.4, 1.8];
/// Length and width of the smallest car, metres.
const SHORTEST: [f32; 2] = [3.2, 1.45];
/// Up to this extent in metres something is taken for a person or a thing of that size, even where a part is hidden.
const SMALL: f32 = 1.0;
/// How near a point of the contour lies to a face that it belongs to, metres.
const FACE: f32 = 0.25;
/// Extent from which on a side that is seen says how long it is, metres.
const MEASURED: f32 = 0.6;
/// Less than this of something, in metres, says nothing about the rest.
const SLIVER: f32 = 0.8;
/// Smallest extent of a box, metres.
const THIN: f32 = 0.3;

/// Fits a box to a silhouette. `along`: the angle (as [`GroundBox::angle`]) most objects are expected to be turned
/// to, which decides only between fits that are about as good.
#[must_use]
pub fn fit(silhouette: &Silhouette, along: f32) -> Option<GroundBox> {
    let angle = best_angle(&silhouette.contour, along);
    let axes = axes(angle);
    let span = axes.map(|axis| extent(&silhouette.points, axis));
    let size = span.map(|[from, to]| to - from);
    let room = [0, 1].map(|i| room(silhouette, axes[i], span[i]));
    let whole = completed(size, room, angle, along, silhouette)?;
    let (mut middle, mut fixed) = ([0.0; 2], [0.0; 2]);
    for i in 0..2 {
        let [from, to] = span[i];
        let missing = (whole[i] - size[i]).max(0.0);
        let [low, high] = room[i];
        let away = if from + to >= 0.0 { 0.5 } else { -0.5 };
        // What is missing lies where it may; where it may lie at both ends, behind what is seen.
        let shift = match (low > 0.0, high > 0.0) {
            (true, false) => -0.5,
            (false, true) => 0.5,
            _ => 0.5 * away,
        };
        middle[i] = 0.5 * (from + to) + shift * missing;
        // The end that was not moved; the middle of a side that was seen whole.
        fixed[i] = middle[i] - if missing > 0.0 { shift * whole[i] } else { 0.0 };
    }
    let on_ground = |p: [f32; 2]| [0, 1].map(|k| p[0] * axes[0][k] + p[1] * axes[1][k]);
    let seen = [0, 1].map(|i| (size[i] / whole[i].max(1e-3)).min(1.0));
    let (first, turn) = if whole[0] >= whole[1] {
        (0, 0.0)
    } else {
        (1, std::f32::consts::FRAC_PI_2)
    };
    Some(GroundBox {
        middle: on_ground(middle),
        angle: half_turn(angle + turn),
        footprint: [whole[first], whole[1 - first]],
        heights: [0.0, silhouette.top],
        seen: [seen[first], seen[1 - first]],
        anchor: on_ground(fixed),
    })
}

fn axes(angle: f32) -> [[f32; 2]; 2] {
    let (sin, cos) = angle.sin_cos();
    [[cos, sin], [-sin, cos]]
}

/// An angle in [0, π).
fn half_turn(angle: f32) -> f32 {
    angle.rem_euclid(std::f32::consts::PI)
}

/// The angle at which most of the contour lies on the two faces that look at the camera (after the closeness
/// criterion of Zhang et al., "Efficient L-shape fitting for vehicle detection using laser scanners", 2017).
fn best_angle(contour: &[[f32; 2]], along: f32) -> f32 {
    const COARSE: usize = 30;
    let step = std::f32::consts::FRAC_PI_2 / COARSE as f32;
    let score = |angle: f32| {
        // Four times an angle is the same for all of a box's sides.
        let prior = 0.03 * (4.0 * (angle - along)).cos();
        closeness(contour, axes(angle)) / contour.len().max(1) as f32 + prior
    };
    let best_of = |angles: &mut dyn Iterator<Item = f32>| {
        angles
            .map(|angle| (score(angle), angle))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(along, |(_, angle)| angle)
    };
    // Counted from the expected angle, which thus is among those that are tried.
    let coarse = best_of(&mut (0..COARSE).map(|i| along + i as f32 * step));
    best_of(&mut (-4..=4).map(|i| coarse + i as f32 * step / 5.0))
}

fn closeness(contour: &[[f32; 2]], axes: [[f32; 2]; 2]) -> f32 {
    let near = axes.map(|axis| {
        let along = contour.iter().map(|p| p[0] * axis[0] + p[1] * axis[1]);
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        for x in along {
            low = low.min(x);
            high = high.max(x);
        }
        // The camera is at 0.
        if low + high >= 0.0 { low } else { high }
    });
    contour
        .iter()
        .map(|p| {
            let off = |i: usize| (p[0] * axes[i][0] + p[1] * axes[i][1] - near[i]).abs();
            let off = off(0).min(off(1)) / FACE;
            // Falls off slowly: a bumper is round.
            1.0 / (1.0 + off * off)
        })
        .sum()
}

/// From where to where the points reach along an axis, less the outermost ones.
fn extent(points: &[[f32; 3]], axis: [f32; 2]) -> [f32; 2] {
    let mut along: Vec<f32> = points
        .iter()
        .map(|p| p[0] * axis[0] + p[1] * axis[1])
        .collect();
    if along.is_empty() {
        return [0.0; 2];
    }
    let stray = along.len() / 100;
    let last = along.len() - 1 - stray;
    let low = *along.select_nth_unstable_by(stray, f32::total_cmp).1;
    let high = *along.select_nth_unstable_by(last, f32::total_cmp).1;
    [low, high]
}

/// How far an axis may go on beyond its low and its high end, in metres: 0 where a free end of the contour shows that
/// it does not. Behind what hides an end it may go on as far as it likes, towards the camera only up to it.
fn room(silhouette: &Silhouette, axis: [f32; 2], [from, to]: [f32; 2]) -> [f32; 2] {
    let contour = &silhouette.contour;
    let reach = 0.2 * (to - from) + 0.05;
    let ends = [contour[0], contour[contour.len() - 1]].map(|p| p[0] * axis[0] + p[1] * axis[1]);
    let far_is_high = from + to >= 0.0;
    [false, true].map(|high| {
        let at = |x: f32| {
            if high {
                x > to - reach
            } else {
                x < from + reach
            }
        };
        let nearer = if high { -axis[1] } else { axis[1] };
        let (mut room, mut shown) = (0.0f32, false);
        for (x, step) in ends.into_iter().zip(silhouette.hidden) {
            if at(x) && step > 0.0 {
                room = room.max(if nearer > 0.05 {
                    step / nearer
                } else {
                    f32::INFINITY
                });
            }
            shown |= at(x) && step == 0.0;
        }
        let far = high == far_is_high;
        if far && (!shown || to - from < MEASURED) {
            f32::INFINITY
        } else {
            room
        }
    })
}

/// Whole extents along the two axes, from those seen.
fn completed(
    size: [f32; 2],
    room: [[f32; 2]; 2],
    angle: f32,
    along: f32,
    silhouette: &Silhouette,
) -> Option<[f32; 2]> {
    // Where its lower half is hidden, what is seen is a roof, which is shorter than the whole.
    let roof_only = silhouette.bottom > 0.55 * silhouette.top && silhouette.top > 1.0;
    let hidden = silhouette.hidden.iter().any(|step| *step > 0.0) || roof_only;
    let largest = size[0].max(size[1]);
    if largest < SLIVER && hidden {
        return None;
    }
    // A car from behind is as wide as a container; it is higher. Of what is hidden there is more.
    let small = match (hidden, silhouette.top > 1.35) {
        (true, _) => SLIVER,
        (false, true) => SMALL,
        (false, false) => SHORTEST[1],
    };
    if largest < small || silhouette.top < 0.9 {
        return Some(size.map(|s| s.max(THIN)));
    }
    let room = room.map(|[low, high]| low + high);
    let usual = |i: usize, length_on: usize| CAR[usize::from(i != length_on)];
    // As a car with its length along the first or the second axis: the way that explains more of what was seen.
    let as_car = |length_on: usize| {
        let mut cost = 0.0;
        for i in 0..2 {
            let more = size[i] - usual(i, length_on);
            cost += if more > 0.0 {
                // A car may be longer than usual, hardly wider.
                if i == length_on { more } else { 3.0 * more }
            } else {
                // Too short, and no room to go on.
                0.5 * (-more - room[i]).max(0.0)
            };
        }
        let turned = angle + length_on as f32 * std::f32::consts::FRAC_PI_2 - along;
        cost + 0.25 * (1.0 - (2.0 * turned).cos())
    };
    let length_on = usize::from(as_car(1) < as_car(0));
    Some([0, 1].map(|i| {
        let usual = usual(i, length_on);
        let least = SHORTEST[usize::from(i != length_on)];
        if size[i] + room[i] < least {
            // Both ends are seen, but of less than any car: its far end was not, after all.
            size[i].max(usual)
        } else {
            size[i].max(usual.min(size[i] + room[i]))
        }
    }))
}
