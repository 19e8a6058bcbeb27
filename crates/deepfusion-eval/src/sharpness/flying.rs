use super::pair::Pair;

/// Two neighbouring pixels with a depth ratio above this lie on different objects: a jump. The road has no jumps: the next pixel up is z /
/// (f h) deeper, 7 % at 80 m for KITTI's camera.
const JUMP: f64 = 1.25;
/// A predicted depth within this share of a true one lies on that surface.
const TOLERANCE: f64 = 0.1;
/// Pixels to each side: the neighbourhood is 5×5.
const REACH: usize = 2;

/// The share of flying pixels. Counted are the pixels in whose 5×5 neighbourhood the true depth jumps between two adjacent pixels. A flying
/// pixel has a predicted depth between the neighbourhood's smallest and largest true depth and more than 10 % from each of them. `None` if
/// the true depth has no jumps.
pub(super) fn share(pair: &Pair) -> Option<f64> {
    let (mut near, mut flying) = (0usize, 0usize);
    for y in 0..pair.height {
        for x in 0..pair.width {
            let here = y * pair.width + x;
            if !pair.known[here] {
                continue;
            }
            let around = Neighbourhood::of(pair, x, y);
            if around.most > JUMP * around.least && around.jumps(pair) {
                near += 1;
                flying += usize::from(around.is_between(pair, pair.prediction[here]));
            }
        }
    }
    (near > 0).then(|| flying as f64 / near as f64)
}

/// A pixel's neighbourhood, cut at the image's border.
struct Neighbourhood {
    columns: std::ops::Range<usize>,
    rows: std::ops::Range<usize>,
    least: f64,
    most: f64,
}

impl Neighbourhood {
    fn of(pair: &Pair, x: usize, y: usize) -> Self {
        let reach = |at: usize, size: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(size);
        let mut around = Self {
            columns: reach(x, pair.width),
            rows: reach(y, pair.height),
            least: f64::INFINITY,
            most: 0.0,
        };
        let depths = around.depths(pair);
        (around.least, around.most) = depths.fold((f64::INFINITY, 0.0), |(least, most), d| {
            (f64::min(least, d), f64::max(most, d))
        });
        around
    }

    fn pixels(&self, width: usize) -> impl Iterator<Item = (usize, usize, usize)> + use<> {
        let columns = self.columns.clone();
        (self.rows.clone()).flat_map(move |y| columns.clone().map(move |x| (x, y, y * width + x)))
    }

    /// The known true depths.
    fn depths<'a>(&self, pair: &'a Pair) -> impl Iterator<Item = f64> + use<'a> {
        self.pixels(pair.width)
            .filter(|(_, _, i)| pair.known[*i])
            .map(|(_, _, i)| pair.truth[i])
    }

    fn jumps(&self, pair: &Pair) -> bool {
        let jump = |a: usize, b: usize| {
            let (p, q) = (pair.truth[a], pair.truth[b]);
            pair.known[a] && pair.known[b] && p.max(q) > JUMP * p.min(q)
        };
        self.pixels(pair.width).any(|(x, y, i)| {
            (x + 1 < self.columns.end && jump(i, i + 1))
                || (y + 1 < self.rows.end && jump(i, i + pair.width))
        })
    }

    fn is_between(&self, pair: &Pair, predicted: f64) -> bool {
        let off = |d: f64| (predicted - d).abs() > TOLERANCE * d;
        predicted > self.least && predicted < self.most && self.depths(pair).all(off)
    }
}
