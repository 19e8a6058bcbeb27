//! Paths of the targets, in the world's axes (those of the recording's first camera).

use std::collections::{HashMap, VecDeque};

use re_sdk_types::archetypes::LineStrips3D;

use super::targets::SeenTarget;

/// How many frames back a path is drawn.
const FRAMES: usize = 50;

/// The paths of the tracks seen so far.
#[derive(Default)]
pub(super) struct Tracks {
    paths: HashMap<u64, TrackPath>,
    frame: usize,
}

/// Centres in world axes, in metres, each with its frame's number.
type TrackPath = VecDeque<(usize, [f32; 3])>;

impl Tracks {
    /// Adds a frame and returns the paths of its targets, if there are any. Without the camera's pose, world axes are unknown and there
    /// are none.
    pub(super) fn add(
        &mut self,
        targets: &[SeenTarget],
        world_from_cam: Option<[f64; 12]>,
    ) -> Option<LineStrips3D> {
        let world_from_cam = world_from_cam?;
        self.frame += 1;
        for target in targets {
            let path = self.paths.entry(target.id).or_default();
            path.push_back((self.frame, moved(&world_from_cam, target.centre)));
        }
        let oldest = self.frame.saturating_sub(FRAMES);
        self.paths.retain(|_, path| {
            path.retain(|(seen, _)| *seen > oldest);
            !path.is_empty()
        });
        let paths: Vec<_> = targets
            .iter()
            .filter_map(|t| Some((t, self.paths.get(&t.id).filter(|path| path.len() > 1)?)))
            .collect();
        let points = |path: &TrackPath| -> Vec<[f32; 3]> { path.iter().map(|(_, p)| *p).collect() };
        (!paths.is_empty()).then(|| {
            LineStrips3D::new(paths.iter().map(|(_, path)| points(path)))
                .with_colors(paths.iter().map(|(t, _)| t.colour()))
        })
    }
}

/// A point moved by a rigid motion, row by row.
fn moved(m: &[f64; 12], [x, y, z]: [f64; 3]) -> [f32; 3] {
    std::array::from_fn(|i| {
        let row = &m[4 * i..4 * i + 4];
        (row[0] * x + row[1] * y + row[2] * z + row[3]) as f32
    })
}
