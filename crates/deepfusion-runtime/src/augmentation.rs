/// Test-time augmentation: several predictions of one image, at several input sizes, mirrored or not. The mean of their disparities usually
/// has a smaller error on images unlike the training images, but takes the time of all predictions. Gains and losses are in
/// docs/benchmarks/test-time-augmentation.md.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Augmentation {
    /// Input sizes, as multiples of the size that fits the image; each is rounded to a size that the network accepts.
    pub scales: &'static [f64],
    /// Whether to predict the mirrored image, too, at each size. The two predictions are blended as by Godard et al. (CVPR 2017, section
    /// 3.4), like Monodepth2's evaluation.
    pub flip: bool,
}

impl Augmentation {
    /// One prediction at the size that fits.
    pub const NONE: Self = Self {
        scales: &[1.0],
        flip: false,
    };
    /// The image and its mirror image, at the size that fits.
    pub const FLIP: Self = Self {
        flip: true,
        ..Self::NONE
    };
    /// A smaller input, in which the network sees more of the scene at once, and a larger one, in which it sees more of what is far. For
    /// 640×192: 512×160 and 736×224.
    pub const MULTI_SCALE: Self = Self {
        scales: &[0.8, 1.2],
        flip: false,
    };
    /// [`Self::MULTI_SCALE`], with each size mirrored as well.
    pub const MULTI_SCALE_FLIP: Self = Self {
        flip: true,
        ..Self::MULTI_SCALE
    };

    /// Whether it needs input sizes other than the one that fits the image.
    #[must_use]
    pub fn resizes(&self) -> bool {
        self.scales.iter().any(|scale| *scale != 1.0)
    }
}

impl Default for Augmentation {
    fn default() -> Self {
        Self::NONE
    }
}

/// Where the blending with the mirrored image's disparity begins and ends: distances from an edge, as shares of the width.
const EDGE: (f64, f64) = (0.05, 0.10);

/// Blends the values of an image with those of its mirror image, in place in `own`. The result is the mean of both, but the mirrored
/// image's values alone in the leftmost twentieth and the image's own in the rightmost, with a ramp of the same width in between. A network
/// that learned from views to the right predicts poorly at an image's left edge, which they do not show; mirrored, this edge is on the
/// right.
///
/// # Shapes
/// - `own`: H×`width`
/// - `mirrored`: H×`width`, the mirrored image's values mirrored back
pub(crate) fn blend_flipped(own: &mut [f32], mirrored: &[f32], width: usize) {
    let (from, to) = EDGE;
    let last = width.saturating_sub(1).max(1) as f64;
    let near_left = |column: usize| {
        let x = column as f64 / last;
        1.0 - ((x - from) / (to - from)).clamp(0.0, 1.0)
    };
    // Weight of the image's own value; the rest is the mirrored one's.
    let weights: Vec<f32> = (0..width)
        .map(|column| {
            let (left, right) = (near_left(column), near_left(width - 1 - column));
            (right + (1.0 - left - right) / 2.0) as f32
        })
        .collect();
    let rows = own.chunks_exact_mut(width.max(1));
    for (own, mirrored) in rows.zip(mirrored.chunks_exact(width.max(1))) {
        for ((own, mirrored), weight) in own.iter_mut().zip(mirrored).zip(&weights) {
            *own = mirrored + (*own - mirrored) * weight;
        }
    }
}

/// Mirrors an image with rows of `width` values from left to right.
pub(crate) fn mirror(values: &mut [f32], width: usize) {
    for row in values.chunks_exact_mut(width.max(1)) {
        row.reverse();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_edge_is_taken_from_the_better_prediction() {
        let mut blended = vec![1.0; 202];
        blend_flipped(&mut blended, &[3.0; 202], 101);
        let at = |column: usize| blended[column];
        assert_eq!([0, 5, 50, 95, 100].map(at), [3.0, 3.0, 2.0, 1.0, 1.0]);
        // Halfway down the ramp, between the seventh column and the eighth: weights of three quarters and one.
        assert!((f32::midpoint(at(7), at(8)) - 2.5).abs() < 1e-6);
        assert!((f32::midpoint(at(92), at(93)) - 1.5).abs() < 1e-6);
        assert_eq!(blended[..101], blended[101..]);
    }

    #[test]
    fn blending_keeps_equal_values_and_images_of_one_column() {
        let mut own = vec![7.5; 101];
        blend_flipped(&mut own, &[7.5; 101], 101);
        assert_eq!(own, vec![7.5; 101]);
        let mut narrow = vec![1.0, 2.0];
        blend_flipped(&mut narrow, &[1.0, 2.0], 1);
        assert_eq!(narrow, [1.0, 2.0]);
    }

    #[test]
    fn a_mirror_is_its_own_inverse() {
        let mut values = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        mirror(&mut values, 3);
        assert_eq!(values, [3.0, 2.0, 1.0, 6.0, 5.0, 4.0]);
        mirror(&mut values, 3);
        assert_eq!(values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    }
}
