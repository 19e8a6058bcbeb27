//! What does not fit the points of a cloud, or the depth map that they are made of.

use deepfusion_hint::count_of;

/// What does not fit the points of a cloud, or the depth map that they are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SizeProblem {
    /// A column has not one entry for each point.
    #[error("{column}: {}, expected one a point, {points}", entries_of(*entries))]
    Column {
        /// The column.
        column: &'static str,
        /// How many it has.
        entries: usize,
        /// How many points there are.
        points: usize,
    },
    /// A camera is one of images of another size.
    #[error(
        "camera intrinsics: {}x{}, expected the depth map's {}x{}",
        camera.0, camera.1, map.0, map.1
    )]
    Camera {
        /// Width and height of its images.
        camera: (u32, u32),
        /// Those of the depth map.
        map: (usize, usize),
    },
    /// A map has not one value for each pixel.
    #[error(
        "depth or disparity: {}, expected {} ({}x{})",
        count_of(*values, "value"), map.0 * map.1, map.0, map.1
    )]
    Values {
        /// How many it has.
        values: usize,
        /// Width and height of the depth map.
        map: (usize, usize),
    },
    /// An image has not three bytes for each pixel.
    #[error(
        "colour image: {}, expected {} ({}x{}x3)",
        count_of(*bytes, "byte"), map.0 * map.1 * 3, map.0, map.1
    )]
    Colours {
        /// How many it has.
        bytes: usize,
        /// Width and height of the depth map.
        map: (usize, usize),
    },
}

/// "Entry" has no regular plural.
fn entries_of(count: usize) -> String {
    match count {
        1 => "1 entry".to_owned(),
        n => format!("{n} entries"),
    }
}
