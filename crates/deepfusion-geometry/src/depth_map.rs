/// Depth of every pixel: camera z in metres, row by row; 0 means none.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMap {
    /// Width, in pixels.
    pub width: usize,
    /// Height, in pixels.
    pub height: usize,
    /// `width * height` depths in metres, row by row; 0 = none.
    pub data: Vec<f32>,
}

impl DepthMap {
    /// A map without any depth.
    #[must_use]
    pub fn empty(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            data: vec![0.0; width * height],
        }
    }

    /// Depth at column `x`, row `y`, in metres; `None` outside the map or where there is none.
    #[must_use]
    pub fn get(&self, x: usize, y: usize) -> Option<f32> {
        if x >= self.width || y >= self.height {
            return None;
        }
        let depth = self.data[y * self.width + x];
        (depth > 0.0).then_some(depth)
    }

    /// Sets the depth at (`x`, `y`) if it is nearer than the existing depth, or there is none.
    ///
    /// # Panics
    /// If the pixel is outside the map.
    pub fn set_nearest(&mut self, x: usize, y: usize, depth_m: f32) {
        assert!(x < self.width, "column {x} of {}", self.width);
        let cell = &mut self.data[y * self.width + x];
        if *cell == 0.0 || depth_m < *cell {
            *cell = depth_m;
        }
    }

    /// The map resized by nearest neighbour. Depths are not averaged, which would create depths between near and far surfaces.
    #[must_use]
    pub fn nearest(&self, width: usize, height: usize) -> Self {
        let mut map = Self::empty(width, height);
        if self.width == 0 || self.height == 0 {
            return map;
        }
        let pick = |i: usize, to: usize, from: usize| ((2 * i + 1) * from / (2 * to)).min(from - 1);
        let columns: Vec<usize> = (0..width).map(|x| pick(x, width, self.width)).collect();
        for (y, row) in map.data.chunks_exact_mut(width.max(1)).enumerate() {
            let from = pick(y, height, self.height) * self.width;
            for (depth, x) in row.iter_mut().zip(&columns) {
                *depth = self.data[from + x];
            }
        }
        map
    }

    /// Number of pixels with a depth.
    #[must_use]
    pub fn count(&self) -> usize {
        self.data.iter().filter(|d| **d > 0.0).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resizing_takes_the_depth_at_each_pixels_centre() {
        let map = DepthMap {
            width: 4,
            height: 2,
            data: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0],
        };
        assert_eq!(map.nearest(4, 2), map);
        assert_eq!(map.nearest(2, 1).data, [6.0, 8.0]);
        assert_eq!(
            map.nearest(8, 2).data[..8],
            [1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0]
        );
        assert_eq!(DepthMap::empty(0, 0).nearest(2, 2).count(), 0);
        assert!(map.nearest(0, 0).data.is_empty());
    }

    #[test]
    fn the_nearest_depth_wins_in_any_order() {
        let mut map = DepthMap::empty(3, 2);
        for depth in [5.0, 3.0, 4.0] {
            map.set_nearest(1, 1, depth);
        }
        assert_eq!(map.get(1, 1), Some(3.0));
        assert_eq!(map.get(0, 0), None);
        assert_eq!(map.get(7, 0), None);
        assert_eq!(map.count(), 1);
    }
}
