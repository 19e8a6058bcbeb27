//! What does not fit the points of a cloud, or the depth map that they are made of.

/// What does not fit the points of a cloud, or the depth map that they are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SizeProblem {
    /// A column has not one entry for each point.
    #[error("{column}: {entries} entries, expected one a point, {points}")]
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
    #[error("depth or disparity: {values} values, expected {} ({}x{})", map.0 * map.1, map.0, map.1)]
    Values {
        /// How many it has.
        values: usize,
        /// Width and height of the depth map.
        map: (usize, usize),
    },
    /// An image has not three bytes for each pixel.
    #[error("colour image: {bytes} bytes, expected {} ({}x{}x3)", map.0 * map.1 * 3, map.0, map.1)]
    Colours {
        /// How many it has.
        bytes: usize,
        /// Width and height of the depth map.
        map: (usize, usize),
    },
}
