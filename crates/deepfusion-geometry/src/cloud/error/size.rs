//! Sizes that do not match the points of a cloud, or the depth map that it is made from.

use deepfusion_hint::count_of;

/// A size that does not match the points of a cloud, or the depth map that it is made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SizeProblem {
    /// A column does not have one entry per point.
    #[error("{column}: {}, expected one per point, {points}", entries_of(*entries))]
    Column {
        /// Name of the column.
        column: &'static str,
        /// Number of entries in the column.
        entries: usize,
        /// Number of points.
        points: usize,
    },
    /// The camera intrinsics are for images of another size.
    #[error(
        "camera intrinsics: {}x{}, expected the depth map's {}x{}",
        camera.0, camera.1, map.0, map.1
    )]
    Camera {
        /// Width and height of the camera's images.
        camera: (u32, u32),
        /// Width and height of the depth map.
        map: (usize, usize),
    },
    /// A depth map does not have one value per pixel.
    #[error(
        "depth or disparity: {}, expected {} ({}x{})",
        count_of(*values, "value"), map.0 * map.1, map.0, map.1
    )]
    Values {
        /// Number of values.
        values: usize,
        /// Width and height of the depth map.
        map: (usize, usize),
    },
    /// An image does not have three bytes per pixel.
    #[error(
        "colour image: {}, expected {} ({}x{}x3)",
        count_of(*bytes, "byte"), map.0 * map.1 * 3, map.0, map.1
    )]
    Colours {
        /// Number of bytes.
        bytes: usize,
        /// Width and height of the depth map.
        map: (usize, usize),
    },
}

/// Counts entries; the plural of "entry" is irregular.
fn entries_of(count: usize) -> String {
    match count {
        1 => "1 entry".to_owned(),
        n => format!("{n} entries"),
    }
}
