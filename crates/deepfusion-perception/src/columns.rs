//! Groups a cluster's pixels by column.

use crate::clusters::Cluster;

/// The pixels of a cluster, column by column from left to right, and from the top down in each: (depth, row).
pub(crate) struct Columns {
    /// Leftmost column in the image.
    left: u32,
    /// For each column, the index after its last pixel.
    ends: Vec<usize>,
    pixels: Vec<(f32, u32)>,
}

impl Columns {
    /// The columns of a cluster in a depth image of this width.
    pub(crate) fn of(cluster: &Cluster, depth: &[f32], width: usize) -> Self {
        let [left, _, right, _] = cluster.bounds();
        let mut ends = vec![0; (right - left + 1) as usize];
        for run in &cluster.runs {
            for end in &mut ends[(run.from - left) as usize..(run.to - left) as usize] {
                *end += 1;
            }
        }
        // At first the start of each column; filling a column moves it to the column's end.
        let mut pixels_before = 0;
        for end in &mut ends {
            pixels_before += std::mem::replace(end, pixels_before);
        }
        let mut pixels = vec![(0.0, 0); pixels_before];
        for run in &cluster.runs {
            let row = &depth[run.v as usize * width..];
            let ends = &mut ends[(run.from - left) as usize..(run.to - left) as usize];
            for (z, end) in row[run.from as usize..run.to as usize].iter().zip(ends) {
                pixels[*end] = (*z, run.v);
                *end += 1;
            }
        }
        Self { left, ends, pixels }
    }

    /// Calls `each` with every column that has pixels, and its pixels.
    pub(crate) fn for_each(&mut self, mut each: impl FnMut(usize, &mut [(f32, u32)])) {
        let mut start = 0;
        for (column, end) in self.ends.iter().enumerate() {
            if *end > start {
                each(self.left as usize + column, &mut self.pixels[start..*end]);
            }
            start = *end;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clusters::Run;

    #[test]
    fn pixels_are_grouped_by_column_from_the_top_down() {
        let depth: Vec<f32> = (0..12).map(|i| i as f32).collect();
        let run = |v, from, to| Run { v, from, to };
        let cluster = Cluster {
            runs: vec![run(0, 1, 3), run(1, 2, 3), run(2, 0, 1), run(2, 2, 3)],
            pixels: 5,
        };
        let mut seen = Vec::new();
        Columns::of(&cluster, &depth, 4).for_each(|u, pixels| seen.push((u, pixels.to_vec())));
        assert_eq!(
            seen,
            [
                (0, vec![(8.0, 2)]),
                (1, vec![(1.0, 0)]),
                (2, vec![(2.0, 0), (6.0, 1), (10.0, 2)]),
            ]
        );
    }
}
