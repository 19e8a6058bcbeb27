/// Euclidean distance of each pixel to the nearest pixel in `marked`, in pixels; infinite if none is marked.
///
/// Exact and in linear time: squared distances along each column, then along each row as the lower envelope of parabolas (Felzenszwalb and
/// Huttenlocher, "Distance Transforms of Sampled Functions").
pub(super) fn to_nearest(marked: &[bool], (width, height): (usize, usize)) -> Vec<f64> {
    let mut squared: Vec<f64> = marked
        .iter()
        .map(|m| if *m { 0.0 } else { f64::INFINITY })
        .collect();
    let mut envelope = Envelope::default();
    let mut line = vec![0.0; width.max(height)];
    for x in 0..width {
        for y in 0..height {
            line[y] = squared[y * width + x];
        }
        envelope.build(&line[..height]);
        for y in 0..height {
            squared[y * width + x] = envelope.at(y);
        }
    }
    for row in squared.chunks_exact_mut(width.max(1)) {
        line[..width].copy_from_slice(row);
        envelope.build(&line[..width]);
        for (x, out) in row.iter_mut().enumerate() {
            *out = envelope.at(x);
        }
    }
    squared.into_iter().map(f64::sqrt).collect()
}

/// The lower envelope min over p of (x − p)² + f(p): the parabolas that are lowest somewhere, from left to right.
#[derive(Default)]
struct Envelope {
    /// For each parabola p, f(p), and the x from which it is the lowest.
    parts: Vec<(f64, f64, f64)>,
    /// Index of the lowest parabola at the last x asked for.
    current: usize,
}

impl Envelope {
    fn build(&mut self, heights: &[f64]) {
        self.parts.clear();
        self.current = 0;
        for (p, &height) in heights.iter().enumerate().filter(|(_, h)| h.is_finite()) {
            let p = p as f64;
            let mut from = f64::NEG_INFINITY;
            while let Some(&(q, other, start)) = self.parts.last() {
                // Where the two intersect; to the right of that, the new one is lower.
                from = ((height + p * p) - (other + q * q)) / (2.0 * (p - q));
                if from > start {
                    break;
                }
                self.parts.pop();
                from = f64::NEG_INFINITY;
            }
            self.parts.push((p, height, from));
        }
    }

    /// The value at x. Between two calls of `build`, x must not decrease.
    fn at(&mut self, x: usize) -> f64 {
        let x = x as f64;
        while self.parts.get(self.current + 1).is_some_and(|p| p.2 < x) {
            self.current += 1;
        }
        (self.parts.get(self.current))
            .map_or(f64::INFINITY, |(p, height, _)| (x - p).powi(2) + height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn distances_equal_a_brute_force_search(
            width in 1..12usize, height in 1..12usize, bits in prop::collection::vec(0..9u8, 144),
        ) {
            let marked: Vec<bool> = bits[..width * height].iter().map(|b| *b == 0).collect();
            let ours = to_nearest(&marked, (width, height));
            for (i, distance) in ours.iter().enumerate() {
                let to = |j: usize| {
                    let d = |a: usize, b: usize| (a as f64 - b as f64).powi(2);
                    (d(i % width, j % width) + d(i / width, j / width)).sqrt()
                };
                let nearest = (0..marked.len()).filter(|j| marked[*j]).map(to).fold(f64::INFINITY, f64::min);
                prop_assert_eq!(*distance, nearest);
            }
        }
    }
}
