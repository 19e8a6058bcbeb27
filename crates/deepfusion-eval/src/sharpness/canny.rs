//! Edges of a depth map.
//!
//! Our own code, because `canny` of `imageproc` 0.27 takes 8-bit images. A depth map would be reduced to 256 steps (0.3 m each up to 80 m,
//! which turns every slope into stairs). It also has a fixed σ and no mask for pixels without depth.

use super::smooth::gaussian;

/// Standard deviation of the smoothing, in pixels, and the thresholds on Sobel's gradient of values in [0, 1], as in iBims-1's evaluation
/// script. After this smoothing, a step of height h between two pixels has the gradient 1.98 h at both. So edges start at steps of 15 % of
/// the map's range of depth and continue down to 8 %.
const SIGMA: f64 = std::f64::consts::SQRT_2;
const LOW: f64 = 0.15;
const HIGH: f64 = 0.3;

/// Gradients that differ by less than this share are equal: the two pixels at a step have the same gradient except for rounding.
const EQUAL: f64 = 1e-9;

/// Canny's edges of an H×W map of any unit. Values are first normalised to [0, 1] by the smallest and largest known value. Then follow
/// smoothing, Sobel's gradient, the pixels whose gradient is the largest across the edge (interpolated between the neighbours, as in
/// scikit-image), and of these the connected lines that reach the high threshold.
///
/// Pixels beside an unknown one, and those on the image's border, are never edges, because their gradient is not known. Of two equally good
/// pixels the first (left, upper) is the edge, so that lines are one pixel wide; scikit-image keeps both.
pub(super) fn edges(map: &[f64], known: &[bool], (width, height): (usize, usize)) -> Vec<bool> {
    let none = vec![false; map.len()];
    let Some(normalised) = normalised(map, known) else {
        return none;
    };
    if width < 3 || height < 3 {
        return none;
    }
    let smooth = gaussian(&normalised, known, (width, height), SIGMA);
    let gradient = Gradient::of(&smooth, (width, height));
    let mut candidate = none;
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let inside = (y - 1..=y + 1).all(|v| (x - 1..=x + 1).all(|u| known[v * width + u]));
            candidate[y * width + x] =
                inside && gradient.size[y * width + x] >= LOW && gradient.is_largest_across(x, y);
        }
    }
    connected_to_strong(&candidate, &gradient.size, width)
}

/// Normalises to [0, 1] by the known values' range; `None` if they are all equal.
fn normalised(map: &[f64], known: &[bool]) -> Option<Vec<f64>> {
    let of_known = || map.iter().zip(known).filter(|(_, k)| **k).map(|(v, _)| *v);
    let least = of_known().fold(f64::INFINITY, f64::min);
    let most = of_known().fold(f64::NEG_INFINITY, f64::max);
    let range = most - least;
    (range > 0.0).then(|| map.iter().map(|v| (v - least) / range).collect())
}

/// Sobel's gradient, not divided by the sum 8 of its weights. Border values are repeated beyond the border.
struct Gradient {
    x: Vec<f64>,
    y: Vec<f64>,
    size: Vec<f64>,
    width: usize,
}

impl Gradient {
    fn of(map: &[f64], (width, height): (usize, usize)) -> Self {
        let (mut gx, mut gy) = (vec![0.0; map.len()], vec![0.0; map.len()]);
        for y in 0..height {
            let rows = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
            for x in 0..width {
                let columns = [x.saturating_sub(1), x, (x + 1).min(width - 1)];
                let at = |row: usize, column: usize| map[rows[row] * width + columns[column]];
                let right = at(0, 2) + 2.0 * at(1, 2) + at(2, 2);
                let left = at(0, 0) + 2.0 * at(1, 0) + at(2, 0);
                let below = at(2, 0) + 2.0 * at(2, 1) + at(2, 2);
                let above = at(0, 0) + 2.0 * at(0, 1) + at(0, 2);
                gx[y * width + x] = right - left;
                gy[y * width + x] = below - above;
            }
        }
        let size = gx.iter().zip(&gy).map(|(x, y)| x.hypot(*y)).collect();
        Self {
            x: gx,
            y: gy,
            size,
            width,
        }
    }

    /// Whether the gradient is not larger one step along its direction, forward or back. The step ends between a neighbour along an axis
    /// and a diagonal one, where the gradient is interpolated. Only for pixels that are not on the border.
    fn is_largest_across(&self, x: usize, y: usize) -> bool {
        let here = y * self.width + x;
        let (gx, gy, size) = (self.x[here], self.y[here], self.size[here]);
        let steep = gy.abs() > gx.abs();
        // Right or down counts as forward, whichever way the depth grows, so that ties are resolved alike on both sides of an object.
        let same_sign = (gx > 0.0) == (gy > 0.0);
        let (straight, sideways) = if steep {
            (self.width as isize, 1)
        } else {
            (1, self.width as isize)
        };
        let diagonal = straight + if same_sign { sideways } else { -sideways };
        let weight = if steep { gx / gy } else { gy / gx }.abs();
        let one_step = |direction: isize| {
            let at = |offset: isize| self.size[here.wrapping_add_signed(direction * offset)];
            at(diagonal) * weight + at(straight) * (1.0 - weight)
        };
        let (before, after) = (one_step(-1), one_step(1));
        before < size * (1.0 - EQUAL) && after <= size * (1.0 + EQUAL)
    }
}

/// The candidates in connected groups (eight neighbours) that contain one at the high threshold.
fn connected_to_strong(candidate: &[bool], size: &[f64], width: usize) -> Vec<bool> {
    let mut edges = vec![false; candidate.len()];
    let mut reached: Vec<usize> = (0..candidate.len())
        .filter(|i| candidate[*i] && size[*i] >= HIGH)
        .collect();
    reached.iter().for_each(|i| edges[*i] = true);
    while let Some(i) = reached.pop() {
        // Candidates are never on the border: all neighbours exist.
        for row in [i - width, i, i + width] {
            for neighbour in row - 1..=row + 1 {
                if candidate[neighbour] && !edges[neighbour] {
                    edges[neighbour] = true;
                    reached.push(neighbour);
                }
            }
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (24, 12);

    fn columns_of(map: impl Fn(usize) -> f64, unknown: impl Fn(usize) -> bool) -> Vec<usize> {
        let n = SIZE.0 * SIZE.1;
        let values: Vec<f64> = (0..n).map(|i| map(i % SIZE.0)).collect();
        let known: Vec<bool> = (0..n).map(|i| !unknown(i % SIZE.0)).collect();
        let edges = edges(&values, &known, SIZE);
        let row = |y: usize| (0..SIZE.0).filter(move |x| edges[y * SIZE.0 + x]);
        row(SIZE.1 / 2).collect()
    }

    #[test]
    fn a_step_is_one_line_on_its_first_side() {
        let step = |x: usize| if x < 12 { 5.0 } else { 20.0 };
        assert_eq!(columns_of(step, |_| false), [11]);
        assert_eq!(columns_of(|x| 25.0 - step(x), |_| false), [11]);
        // With a pixel at half the height, that pixel is the edge.
        let soft = |x: usize| if x == 12 { 12.5 } else { step(x) };
        assert_eq!(columns_of(soft, |_| false), [12]);
    }

    #[test]
    fn small_steps_slopes_and_flat_maps_have_no_edges() {
        // With a range of 1, a step of 0.1 is below the 0.15 of the high threshold.
        let small = |x: usize| match x {
            0 => 0.0,
            1..12 => 0.45,
            12..23 => 0.55,
            _ => 1.0,
        };
        assert!(!columns_of(small, |_| false).contains(&11));
        // A slope over the whole map: its gradient, 8/23, is above the threshold, but has no maximum except at its start.
        assert!(columns_of(|x| x as f64, |_| false).len() <= 1);
        assert!(columns_of(|_| 9.0, |_| false).is_empty());
        assert!(columns_of(|x| x as f64, |_| true).is_empty());
    }

    #[test]
    fn the_border_of_a_hole_is_not_an_edge() {
        // The 1e9 in the hole must be ignored, and the step inside the hole must stay invisible.
        let step = |x: usize| match x {
            10..14 => 1e9,
            _ if x < 12 => 5.0,
            _ => 5.1,
        };
        let hole = |x: usize| (10..14).contains(&x);
        assert!(columns_of(|_| 5.0, hole).is_empty());
        assert!(!columns_of(step, hole).iter().any(|x| (9..15).contains(x)));
    }
}
