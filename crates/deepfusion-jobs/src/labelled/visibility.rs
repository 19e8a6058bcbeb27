//! Which boxes are seen well enough to be found.

use deepfusion_data::{Dataset, kitti::GtKind, read_depth_png};
use deepfusion_geometry::DepthMap;
use deepfusion_perception::Label;

use crate::Result;

/// Exact depth of simulated drives.
const EXACT_DEPTH: &str = "proj_depth/groundtruth/image_02";

/// Depth that says how much of a box is seen.
pub(super) struct VisibilityDepth {
    /// At the image's size.
    pub(super) depth: DepthMap,
    /// Every pixel, or a scan's points only.
    pub(super) dense: bool,
}

/// The exact depth of a simulated frame, else its scan; `None` where there is neither.
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

/// Whether a label is to be found: a free-standing thing of a target's size of which enough is seen.
pub(super) fn counts(label: &Label, class: &str, points: usize, least: usize) -> bool {
    /// The simulator's things that are no targets, and KITTI's regions without labels.
    const NEITHER: [&str; 5] = ["Pole", "Tree", "Building", "Fence", "DontCare"];
    let [length, width, height] = label.size_m;
    !NEITHER.contains(&class)
        && (0.4..=4.5).contains(&height)
        && length <= 13.0
        && width <= 3.5
        && points >= least
}
