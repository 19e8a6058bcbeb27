//! Objects in a row that are not part of a car: a person, a pillar's base, a trolley. A car that is visible from side to side is larger.

use super::View;
use crate::Detection;
use crate::box_fit::SMALL;
use crate::obstacles::NONE;

/// Number of columns beside an object that are checked.
const BESIDE: u32 = 2;

/// Whether a detection is small and nothing nearer hides a continuation on either side: then it is not part of a car.
pub(super) fn stands_alone(detection: &Detection, view: &View) -> bool {
    let small = detection.place.footprint.iter().all(|side| *side <= SMALL);
    small && is_open(detection, view)
}

/// Whether both its ends are visible: in most of its rows, what is beside it is farther away.
fn is_open(detection: &Detection, view: &View) -> bool {
    let width = view.rays.x.len() as u32;
    let (mut rows, mut closed) = (0, [0; 2]);
    for row in detection.runs.chunk_by(|a, b| a.v == b.v) {
        let first = row.iter().map(|run| run.from).min().unwrap_or(0);
        let last = row.iter().map(|run| run.to).max().unwrap_or(1) - 1;
        rows += 1;
        let left = (first, first.checked_sub(BESIDE));
        let right = (last, Some(last + BESIDE).filter(|u| *u < width));
        for (closed, (edge, beside)) in closed.iter_mut().zip([left, right]) {
            let pixel = |u: u32| (row[0].v * width + u) as usize;
            let goes_on = beside.is_none_or(|u| may_continue(pixel(edge), pixel(u), view));
            *closed += usize::from(goes_on);
        }
    }
    rows > 0 && closed.iter().all(|closed| 3 * closed <= rows)
}

/// Whether the object in one pixel may continue at another: something nearer is there, or an obstacle at the same distance.
fn may_continue(from: usize, at: usize, view: &View) -> bool {
    let (here, there) = (view.depth[from], view.depth[at]);
    let step = 0.4 + 0.01 * here;
    let obstacle = view.obstacles.height[at] != NONE;
    there > 0.0 && (there < here - step || obstacle && there < here + step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parking::scene::{Scene, person};

    #[test]
    fn hidden_or_large_objects_do_not_stand_alone() {
        let small = person([0.0, 12.0]);
        let mut beside = person([-0.7, 10.0]);
        let alone = |boxes: &[_]| {
            let scene = Scene::of(boxes);
            stands_alone(&scene.detection(boxes[0]), &scene.view())
        };
        assert!(alone(&[small]));
        // If it is farther away, the object beside it hides nothing.
        assert!(alone(&[small, person([-0.5, 14.0])]));
        beside.footprint = [1.0, 1.0];
        assert!(!alone(&[small, beside]), "hidden on the left");
        assert!(
            !alone(&[small, person([0.5, 12.0])]),
            "continues to the right"
        );
        let mut large = small;
        large.footprint = [1.8, 0.5];
        assert!(!alone(&[large]));
    }
}
