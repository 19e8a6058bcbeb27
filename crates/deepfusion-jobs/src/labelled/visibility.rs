//! Decides which boxes are visible enough to be found.

use deepfusion_data::{Dataset, kitti::GtKind, read_depth_png};
use deepfusion_geometry::DepthMap;
use deepfusion_perception::Label;

use crate::Result;

/// Folder with the exact depth of simulated drives.
const EXACT_DEPTH: &str = "proj_depth/groundtruth/image_02";

/// Depth that shows how much of a box is visible.
pub(super) struct VisibilityDepth {
    /// The depth, at the image's size.
    pub(super) depth: DepthMap,
    /// Whether every pixel has a depth; otherwise only a scan's points.
    pub(super) dense: bool,
}

/// The exact depth of a simulated frame, otherwise its scan; `None` if it has neither.
pub(super) fn visibility(dataset: &Dataset, index: usize) -> Result<Option<VisibilityDepth>> {
    let frame = &dataset.frames()[index];
    let exact = dataset
        .folder()
        .join(EXACT_DEPTH)
        .join(format!("{:010}.png", frame.number));
    if exact.is_file() {
        let depth = read_depth_png(&exact)?;
        return Ok(Some(VisibilityDepth { depth, dense: true }));
    }
    let scan = dataset.ground_truth(index, GtKind::Z)?;
    Ok(scan.map(|depth| VisibilityDepth {
        depth,
        dense: false,
    }))
}

/// Whether a label should be found: a free-standing object of a target's size, visible enough.
pub(super) fn counts(label: &Label, class: &str, points: usize, least: usize) -> bool {
    /// Objects of the simulator that are not targets, and KITTI's regions without labels.
    const NEITHER: [&str; 5] = ["Pole", "Tree", "Building", "Fence", "DontCare"];
    let [length, width, height] = label.size_m;
    !NEITHER.contains(&class)
        && (0.4..=4.5).contains(&height)
        && length <= 13.0
        && width <= 3.5
        && points >= least
}
