//! Points on the ground in SIMD lanes.

/// Number of lanes.
pub(crate) const LANES: usize = 8;

/// Points in blocks of lanes; the last block is padded with the last point.
pub(crate) struct Points {
    /// Right and forward positions of the points, in metres.
    pub blocks: Vec<[[f32; LANES]; 2]>,
    /// Number of points.
    pub count: usize,
}

impl Points {
    /// Packs the points.
    pub(crate) fn new(points: impl IntoIterator<Item = [f32; 2]>) -> Self {
        let mut blocks: Vec<[[f32; LANES]; 2]> = Vec::new();
        let mut count = 0;
        for point in points {
            let lane = count % LANES;
            if lane == 0 {
                blocks.push([[0.0; LANES]; 2]);
            }
            if let Some(block) = blocks.last_mut() {
                for (lanes, x) in block.iter_mut().zip(point) {
                    lanes[lane..].fill(x);
                }
            }
            count += 1;
        }
        Self { blocks, count }
    }

    /// Squared distance of a point from the nearest of these points, infinite without any.
    pub(crate) fn nearest(&self, [x, y]: [f32; 2]) -> f32 {
        let mut nearest = [f32::INFINITY; LANES];
        for [right, forward] in &self.blocks {
            for i in 0..LANES {
                let distance = (right[i] - x).powi(2) + (forward[i] - y).powi(2);
                nearest[i] = less(distance, nearest[i]);
            }
        }
        nearest.into_iter().fold(f32::INFINITY, less)
    }

    /// The points' extent along an axis.
    pub(crate) fn extent(&self, axis: [f32; 2]) -> [f32; 2] {
        let (mut low, mut high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
        for [right, forward] in &self.blocks {
            for i in 0..LANES {
                let x = right[i] * axis[0] + forward[i] * axis[1];
                low[i] = less(x, low[i]);
                high[i] = more(x, high[i]);
            }
        }
        let low = low.into_iter().fold(f32::INFINITY, less);
        [low, high.into_iter().fold(f32::NEG_INFINITY, more)]
    }
}

/// The smaller of two numbers, in one instruction: unlike [`f32::min`] it does not handle NaN.
fn less(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger of two numbers, as [`less`].
fn more(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padding_of_the_last_lanes_has_no_effect() {
        for count in [1, 7, 8, 9] {
            let all: Vec<[f32; 2]> = (0..count).map(|i| [i as f32, 10.0 - i as f32]).collect();
            let points = Points::new(all.iter().copied());
            assert_eq!(points.count, count);
            let last = (count - 1) as f32;
            assert_eq!(points.extent([1.0, 0.0]), [0.0, last]);
            assert_eq!(points.extent([0.0, 1.0]), [10.0 - last, 10.0]);
            assert_eq!(points.nearest([0.0, 12.0]), 4.0);
        }
        assert_eq!(Points::new([]).nearest([0.0; 2]), f32::INFINITY);
    }
}
