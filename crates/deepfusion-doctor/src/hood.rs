//! Parts of the picture that belong to the ego vehicle: its hood, a black frame, a dashboard's reflection.
//!
//! While the vehicle moves, such a part hardly changes, and its rim stays in place. The rows (or columns) are followed
//! inward from each side of the picture while they hardly change over time. The part belongs to the vehicle if it ends
//! at a static edge. A plain sky hardly changes either, but does not end at a static edge.

use super::finding::{Figure, Limit, Outcome, Severity, median};
use super::reason::{ImageSide, PicturesReason};
use super::skip::PicturesSkip;
use super::survey::Survey;

/// The vehicle certainly moves above this, m/s.
const MOVING_MPS: f64 = 1.0;
const LEAST_FRAMES: usize = 12;
/// A pixel hardly changes if its standard deviation over time is below this share of the picture's median one.
const STILL: f64 = 0.35;
/// An edge is a mean slope of this many grey levels a pixel; it is static if the slope's mean over time is this share of
/// its mean length.
const EDGE: f64 = 4.0;
const STANDS: f64 = 0.85;
/// A part as thin as this is vignetting or an encoder's border, pixels of the small picture.
const LEAST_DEPTH: usize = 3;
/// Share of a side that the part may cover, percent: of the bottom, where hoods are, and of the others. A black frame covers
/// a whole other side, and a plain sky over houses ahead a sixth; in four seconds of drive up to a half.
const MOST_BOTTOM: f64 = 15.0;
const MOST_ELSEWHERE: f64 = 75.0;

pub(super) fn check(survey: &Survey<'_>) -> Outcome {
    let Some(still) = StillParts::of(survey) else {
        let needed = LEAST_FRAMES;
        return Outcome::skipped("bonnet", PicturesSkip::FewInMotion { needed });
    };
    let k = survey.dataset.intrinsics(0);
    let (width, height) = (still.width, still.height);
    let down = f64::from(k.height) / height as f64;
    let across = f64::from(k.width) / width as f64;
    let sides = [
        (
            ImageSide::Bottom,
            "static rim at the bottom",
            down,
            still.rim(width, height, |along, deep| (along, height - 1 - deep)),
        ),
        (
            ImageSide::Top,
            "static rim at the top",
            down,
            still.rim(width, height, |along, deep| (along, deep)),
        ),
        (
            ImageSide::Left,
            "static rim at the left",
            across,
            still.rim(height, width, |along, deep| (deep, along)),
        ),
        (
            ImageSide::Right,
            "static rim at the right",
            across,
            still.rim(height, width, |along, deep| (width - 1 - deep, along)),
        ),
    ];
    let mut outcome = Outcome::new("bonnet");
    for (side, quantity, scale, rim) in sides {
        let most = match side {
            ImageSide::Bottom => MOST_BOTTOM,
            _ => MOST_ELSEWHERE,
        };
        let figure = Figure::new(
            quantity,
            100.0 * rim.share,
            "% of the side",
            Limit::AtMost(most),
        );
        outcome.judge(Severity::Warning, figure, || PicturesReason::StillRim {
            side,
            pixels: (rim.depth as f64 * scale).ceil() as u32,
            share: rim.share,
            across: match side {
                ImageSide::Bottom | ImageSide::Top => k.height,
                ImageSide::Left | ImageSide::Right => k.width,
            },
        });
    }
    outcome
}

/// What hardly changes over a drive.
struct StillParts {
    width: usize,
    height: usize,
    still: Vec<bool>,
    edge: Vec<bool>,
}

/// The static part at a side.
struct Rim {
    /// Share of the side that has one.
    share: f64,
    /// How deep it is there (without the deepest fiftieth), pixels of the small picture.
    depth: usize,
}

impl StillParts {
    /// `None` if there are too few frames in motion.
    fn of(survey: &Survey<'_>) -> Option<Self> {
        let moving: Vec<_> = survey
            .neighbours()
            .filter(|(a, b)| {
                survey
                    .speed_mps(a.index, b.index)
                    .is_none_or(|v| v > MOVING_MPS)
            })
            .map(|(a, _)| a)
            .collect();
        if moving.len() < LEAST_FRAMES {
            return None;
        }
        let (width, height) = (moving[0].small.width, moving[0].small.height);
        let n = moving.len() as f64;
        let mut sums = vec![[0.0_f64; 5]; width * height];
        for frame in &moving {
            let data = &frame.small.data;
            for (i, sum) in sums.iter_mut().enumerate() {
                let v = f64::from(data[i]);
                let (x, y) = (i % width, i / width);
                let (mut dx, mut dy) = (0.0, 0.0);
                if x > 0 && x + 1 < width {
                    dx = 0.5 * f64::from(data[i + 1] - data[i - 1]);
                }
                if y > 0 && y + 1 < height {
                    dy = 0.5 * f64::from(data[i + width] - data[i - width]);
                }
                for (sum, term) in sum.iter_mut().zip([v, v * v, dx, dy, dx.hypot(dy)]) {
                    *sum += term / n;
                }
            }
        }
        let deviation = |s: &[f64; 5]| (s[1] - s[0] * s[0]).max(0.0).sqrt();
        let usual = median(sums.iter().map(deviation).collect());
        let stands = |s: &[f64; 5]| {
            let mean = s[2].hypot(s[3]);
            mean > EDGE && mean > STANDS * s[4]
        };
        Some(Self {
            width,
            height,
            still: sums.iter().map(|s| deviation(s) < STILL * usual).collect(),
            edge: sums.iter().map(stands).collect(),
        })
    }

    /// The rim along a side of `length` positions, up to a third of `depth` deep; `at` gives the x and y of a position.
    fn rim(&self, length: usize, depth: usize, at: impl Fn(usize, usize) -> (usize, usize)) -> Rim {
        let index = |along: usize, deep: usize| {
            let (x, y) = at(along, deep);
            y * self.width + x
        };
        let mut depths = Vec::new();
        for along in 0..length {
            let mut ended = None;
            for deep in 0..depth / 3 {
                let i = index(along, deep);
                // Pixels of the rim itself may change: light from beyond it shines in.
                if self.edge[i] {
                    ended = Some(deep);
                } else if !self.still[i] {
                    break;
                }
            }
            depths.extend(
                ended
                    .filter(|deep| *deep >= LEAST_DEPTH)
                    .map(|deep| deep + 1),
            );
        }
        depths.sort_unstable();
        Rim {
            share: depths.len() as f64 / length.max(1) as f64,
            depth: depths.get(depths.len() * 98 / 100).copied().unwrap_or(0),
        }
    }
}
