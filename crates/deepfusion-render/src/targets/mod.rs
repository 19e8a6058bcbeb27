//! Draws targets: boxes on the image, seen from above, and as segments.

mod birds_eye;
mod line;
mod overlay;
mod segments;

pub use birds_eye::birds_eye;
pub use overlay::box_overlay;
pub use segments::target_segments;

use image::Rgb;

/// A target's colour: constant over frames, and different from its neighbours'.
#[must_use]
pub fn colour_of(id: u64) -> Rgb<u8> {
    /// Distinct on grey and on each other.
    const COLOURS: [[u8; 3]; 10] = [
        [255, 127, 14],
        [44, 160, 44],
        [31, 119, 180],
        [214, 39, 40],
        [148, 103, 189],
        [23, 190, 207],
        [227, 119, 194],
        [188, 189, 34],
        [255, 187, 120],
        [152, 223, 138],
    ];
    Rgb(COLOURS[(id % COLOURS.len() as u64) as usize])
}
