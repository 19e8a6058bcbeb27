//! The values of a graph, and their shapes.

/// A value in a [`Graph`](crate::Graph): 0 is the normalised image, `i + 1` is the output of node `i`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ValueId(pub usize);

impl ValueId {
    /// The normalised image.
    pub const IMAGE: Self = Self(0);
}

/// Shape of a value, relative to the image's size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ValueShape {
    /// Channels.
    pub channels: usize,
    /// The image's width and height are divided by 2 this many times, rounding up.
    pub halvings: u32,
    /// Whether it is a single pixel, a mean over the image; `halvings` is then 0.
    pub pooled: bool,
}

impl ValueShape {
    /// Width and height of the value for an image of this size.
    #[must_use]
    pub fn size(&self, width: usize, height: usize) -> (usize, usize) {
        if self.pooled {
            (1, 1)
        } else {
            let halved = |side: usize| side.div_ceil(1 << self.halvings);
            (halved(width), halved(height))
        }
    }
}
