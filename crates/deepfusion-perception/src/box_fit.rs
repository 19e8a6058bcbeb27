//! An upright box around the visible part of an object, completed to its likely size.

use crate::angle::{FACE, best_angle};
use crate::ground_box::{GroundBox, axes};
use crate::outermost::ends;
use crate::rows::{Turn, Vote};
use crate::silhouette::{FOOT_M, Silhouette};

/// Length and width of a typical car, in metres.
pub(crate) const CAR: [f32; 2] = [4.4, 1.8];
/// Length and width of the smallest car, metres.
const SHORTEST: [f32; 2] = [3.2, 1.45];
/// Up to this extent, in metres, an object counts as a person or something of that size, even if partly hidden.
pub(crate) const SMALL: f32 = 1.0;
/// Smallest visible extent of a side that counts as a measurement of its length, in metres.
const MEASURED: f32 = 0.6;
/// A visible part smaller than this, in metres, does not determine the rest.
const SLIVER: f32 = 0.8;
/// Smallest visible width of a bumper that is completed to a car, in metres.
const BUMPER: f32 = 1.2;
/// Smallest extent of a box, in metres.
const THIN: f32 = 0.3;

/// Fits a box to a silhouette. `expected` is the expected orientation, which only decides between fits of about equal quality. Returned
/// with the box is its vote on the orientation of its neighbours.
#[must_use]
pub(crate) fn fit(silhouette: &Silhouette, expected: Turn) -> Option<Vote> {
    let angle = best_angle(&silhouette.contour, expected.angle());
    let axes = axes(angle);
    let span = axes.map(|axis| extent(&silhouette.points, axis));
    let size = span.map(|[from, to]| to - from);
    let room = [0, 1].map(|i| room(silhouette, axes[i], axes[1 - i], span[i]));
    let (whole, margin) = completed(size, room, angle, expected, silhouette)?;
    let (mut middle, mut fixed) = ([0.0; 2], [0.0; 2]);
    for i in 0..2 {
        let [from, to] = span[i];
        let missing = (whole[i] - size[i]).max(0.0);
        let [low, high] = room[i];
        let away = if from + to >= 0.0 { 0.5 } else { -0.5 };
        // The missing part is added where there is room; with room at both ends, behind the visible part.
        let shift = match (low > 0.0, high > 0.0) {
            (true, false) => -0.5,
            (false, true) => 0.5,
            _ => 0.5 * away,
        };
        middle[i] = 0.5 * (from + to) + shift * missing;
        // The end that was not moved; for a completely visible side, its middle.
        fixed[i] = middle[i] - if missing > 0.0 { shift * whole[i] } else { 0.0 };
    }
    let on_ground = |p: [f32; 2]| [0, 1].map(|k| p[0] * axes[0][k] + p[1] * axes[1][k]);
    let seen = [0, 1].map(|i| (size[i] / whole[i].max(1e-3)).min(1.0));
    let (first, turn) = if whole[0] >= whole[1] {
        (0, 0.0)
    } else {
        (1, std::f32::consts::FRAC_PI_2)
    };
    let place = GroundBox {
        middle: on_ground(middle),
        angle: half_turn(angle + turn),
        footprint: [whole[first], whole[1 - first]],
        heights: [0.0, silhouette.top],
        seen: [seen[first], seen[1 - first]],
        anchor: on_ground(fixed),
    };
    let at = on_ground(span.map(|[from, to]| 0.5 * (from + to)));
    Some(Vote { at, place, margin })
}

/// An angle in [0, π).
fn half_turn(angle: f32) -> f32 {
    angle.rem_euclid(std::f32::consts::PI)
}

/// The extent of the points along an axis, without the outermost ones.
fn extent(points: &[[f32; 3]], axis: [f32; 2]) -> [f32; 2] {
    let mut along: Vec<f32> = points
        .iter()
        .map(|p| p[0] * axis[0] + p[1] * axis[1])
        .collect();
    ends(&mut along, 100).unwrap_or_default()
}

/// How far the box may extend beyond its low and its high end along an axis, in metres: 0 where a free end of the contour or a visible face
/// shows its limit. Behind an occluder it may extend without limit, but towards the camera only up to the occluder.
fn room(
    silhouette: &Silhouette,
    axis: [f32; 2],
    across: [f32; 2],
    [from, to]: [f32; 2],
) -> [f32; 2] {
    let contour = &silhouette.contour;
    let reach = 0.2 * (to - from) + 0.05;
    let ends = [contour[0], contour[contour.len() - 1]].map(|p| p[0] * axis[0] + p[1] * axis[1]);
    let far_is_high = from + to >= 0.0;
    let near = if far_is_high { from } else { to };
    let face = face_width(silhouette, axis, across, near);
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
        } else if !far && face > MEASURED {
            0.0
        } else {
            room
        }
    })
}

/// How much of the face at `place` along `axis` is visible down to the ground, in metres. Above an occluder, the visible part may lie
/// farther in.
fn face_width(silhouette: &Silhouette, axis: [f32; 2], across: [f32; 2], place: f32) -> f32 {
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for (p, foot) in silhouette.contour.iter().zip(&silhouette.feet) {
        let off = p[0] * axis[0] + p[1] * axis[1] - place;
        if off.abs() < FACE && *foot < FOOT_M {
            let x = p[0] * across[0] + p[1] * across[1];
            low = low.min(x);
            high = high.max(x);
        }
    }
    high - low
}

/// Full extents along the two axes, estimated from the visible ones.
fn completed(
    size: [f32; 2],
    room: [[f32; 2]; 2],
    angle: f32,
    expected: Turn,
    silhouette: &Silhouette,
) -> Option<([f32; 2], f32)> {
    // If the lower half is hidden, only a roof is visible, which is shorter than the whole.
    let roof_only = silhouette.bottom > 0.55 * silhouette.top && silhouette.top > 1.0;
    let hidden = silhouette.hidden.iter().any(|step| *step > 0.0) || roof_only;
    let largest = size[0].max(size[1]);
    if largest < SLIVER && hidden {
        return None;
    }
    // A car from behind is as wide as a container, but higher. A partly hidden object is larger than its visible part.
    let small = match (hidden, silhouette.top > 1.35) {
        (true, _) => SLIVER,
        (false, true) => SMALL,
        (false, false) => SHORTEST[1],
    };
    // If the rest of a car is hidden, only its bumper may be visible.
    let lowest = if hidden && largest > BUMPER { 0.6 } else { 0.9 };
    if largest < small || silhouette.top < lowest {
        return Some((size.map(|s| s.max(THIN)), 0.0));
    }
    let room = room.map(|[low, high]| low + high);
    let usual = |i: usize, length_on: usize| CAR[usize::from(i != length_on)];
    // As a car with its length along the first or the second axis: the cost of what the car does not explain.
    let as_car = |length_on: usize| {
        let mut cost = 0.0;
        for i in 0..2 {
            let more = size[i] - usual(i, length_on);
            cost += if more > 0.0 {
                // A car may be longer than usual, but hardly wider.
                if i == length_on { more } else { 3.0 * more }
            } else {
                // Too short, without room to extend.
                0.5 * (-more - room[i]).max(0.0)
            };
        }
        cost
    };
    let costs = [0, 1].map(as_car);
    let against =
        |i: usize| costs[i] + expected.against(angle + i as f32 * std::f32::consts::FRAC_PI_2);
    let length_on = usize::from(against(1) < against(0));
    let margin = costs[1 - length_on] - costs[length_on];
    let whole = [0, 1].map(|i| {
        let usual = usual(i, length_on);
        let least = SHORTEST[usize::from(i != length_on)];
        if size[i] + room[i] < least {
            // Shorter than any car: the far end that seemed visible was not the car's end.
            size[i].max(usual)
        } else {
            size[i].max(usual.min(size[i] + room[i]))
        }
    });
    Some((whole, margin))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The front of a car, 1.7 m of it along x = 4, and 1 m of its side; the image ends behind that.
    fn corner() -> Silhouette {
        let front = (0..18).map(|i| [4.0, 9.7 - 0.1 * i as f32]);
        let side = (1..11).map(|i| [4.0 + 0.1 * i as f32, 8.0]);
        let contour: Vec<[f32; 2]> = front.chain(side).collect();
        Silhouette {
            points: contour.iter().map(|p| [p[0], p[1], 0.5]).collect(),
            feet: vec![0.3; contour.len()],
            top: 1.5,
            bottom: 0.3,
            hidden: [0.0, f32::INFINITY],
            contour,
            ..Silhouette::default()
        }
    }

    #[test]
    fn a_box_does_not_extend_in_front_of_a_visible_face() {
        let seen = fit(&corner(), Turn::ahead()).unwrap();
        // Its length points away from the lane: both ends of the front are visible, and no car is that short.
        let [right, forward] = seen.place.middle;
        assert!(
            (right - 6.2).abs() < 0.2 && (forward - 8.85).abs() < 0.2,
            "{seen:?}"
        );
        assert!(
            seen.place.angle.sin().abs() < 0.1 && seen.margin > 0.5,
            "{seen:?}"
        );
        // If the foot of the side is hidden, its visible end may lie farther in than the car's end.
        let mut hidden = corner();
        hidden.feet.fill(0.9);
        let seen = fit(&hidden, Turn::ahead()).unwrap();
        assert!(seen.place.angle.sin() > 0.9, "{seen:?}");
    }

    #[test]
    fn neighbours_decide_the_orientation_of_an_unclear_box() {
        // A corner with both ends hidden.
        let unclear = Silhouette {
            hidden: [f32::INFINITY; 2],
            feet: vec![0.9; corner().contour.len()],
            ..corner()
        };
        let alone = fit(&unclear, Turn::ahead()).unwrap();
        let in_row = fit(&unclear, Turn::new(0.0, 2.0)).unwrap();
        assert!(alone.place.angle.sin() > 0.9, "{alone:?}");
        assert!(in_row.place.angle.sin().abs() < 0.1, "{in_row:?}");
    }
}
