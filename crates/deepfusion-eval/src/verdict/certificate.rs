//! The scale certificate: the scale bias and its uncertainty.

use serde::{Deserialize, Serialize};

use crate::statistics::{SplitMix64, median};

/// The scale is trusted if its whole interval is within this share of 1, in both directions.
pub const TOLERANCE: f64 = 0.1;
/// Fewest blocks from which their spread can be estimated.
const LEAST_BLOCKS: usize = 5;
/// Number of bootstrap resamples, and the seed.
const RESAMPLES: usize = 4000;
const SEED: u64 = 7;

/// The scale according to one block of a drive, some tens of metres of road.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockScale {
    /// Median over its scene points of ln(depth from the scene's motion / predicted depth).
    pub log_scale: f64,
    /// The same median for the nearer half of the points minus that for the farther half.
    pub near_less_far: f64,
    /// Number of scene points.
    pub points: usize,
}

/// One source of the interval's width.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ErrorSource {
    /// `blocks`: how much parts of the drives differ, by bootstrap. `ranges`: near and far depths need different factors. `speed`: the
    /// error of the vehicle's speed itself, as given.
    pub name: SourceName,
    /// Standard error of the bias from this source.
    pub sd: f64,
}

/// The source's name, see [`ErrorSource::name`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SourceName {
    /// Differences between blocks.
    Blocks,
    /// Differences between depth ranges.
    Ranges,
    /// The error of the speed itself.
    Speed,
}

/// Whether the scale can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScaleVerdict {
    /// The whole interval is within [`TOLERANCE`] of 1.
    Trusted,
    /// The interval crosses the tolerance, or there is no interval.
    Open,
    /// The whole interval is outside the tolerance.
    Wrong,
}

/// The scale bias, measured without ground truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScaleCertificate {
    /// The factor that depth should be multiplied by: comparable with `scale.median` of an evaluation with ground truth.
    pub scale: f64,
    /// The factor's 95 % interval.
    pub scale_ci95: Option<[f64; 2]>,
    /// ln(predicted depth / depth from the scene's motion), the median over blocks: positive if predictions are too far, like `scale.bias`.
    pub bias: f64,
    /// The bias's 95 % interval, from all `sources`; `None` for fewer than five blocks.
    pub ci95: Option<[f64; 2]>,
    /// The bias's 95 % interval if the speed were exact.
    pub ci95_given_speed: Option<[f64; 2]>,
    /// Number of blocks.
    pub blocks: usize,
    /// Number of scene points in all blocks.
    pub points: usize,
    /// What contributes to the interval's width.
    pub sources: Vec<ErrorSource>,
    /// Whether the scale can be trusted.
    pub verdict: ScaleVerdict,
}

impl ScaleCertificate {
    /// From blocks that training did not see; `speed_sd` is the relative standard error of the vehicle's speed. `None` without blocks.
    #[must_use]
    pub fn of(blocks: &[BlockScale], speed_sd: f64) -> Option<Self> {
        let scales: Vec<f64> = blocks.iter().map(|b| b.log_scale).collect();
        let log_scale = median(&scales)?;
        let n = blocks.len();
        let enough = n >= LEAST_BLOCKS;
        let of_blocks = enough.then(|| bootstrap_median_sd(&scales));
        let differences: Vec<f64> = blocks.iter().map(|b| b.near_less_far).collect();
        // The overall scale may lie anywhere between those of the near and the far half, uniformly distributed.
        let of_ranges = median(&differences).unwrap_or(0.0).abs() / 12.0_f64.sqrt();
        let mut sources = Vec::new();
        let named = |name, sd| ErrorSource { name, sd };
        sources.extend(of_blocks.map(|sd| named(SourceName::Blocks, sd)));
        sources.push(named(SourceName::Ranges, of_ranges));
        sources.push(named(SourceName::Speed, speed_sd));
        let bias = -log_scale;
        let interval = |others: f64| {
            // The spread estimated from few blocks is uncertain, so that part uses Student's t.
            let wide = (t_975(n - 1) * of_blocks?).hypot(1.96 * others);
            Some([bias - wide, bias + wide])
        };
        let ci95 = interval(of_ranges.hypot(speed_sd));
        Some(Self {
            scale: log_scale.exp(),
            scale_ci95: ci95.map(|[low, high]| [(-high).exp(), (-low).exp()]),
            bias,
            ci95,
            ci95_given_speed: interval(of_ranges),
            blocks: n,
            points: blocks.iter().map(|b| b.points).sum(),
            sources,
            verdict: judge(ci95),
        })
    }
}

fn judge(ci95: Option<[f64; 2]>) -> ScaleVerdict {
    let tolerance = TOLERANCE.ln_1p();
    match ci95 {
        Some([low, high]) if low >= -tolerance && high <= tolerance => ScaleVerdict::Trusted,
        Some([low, high]) if low > tolerance || high < -tolerance => ScaleVerdict::Wrong,
        _ => ScaleVerdict::Open,
    }
}

/// The standard deviation of the median over resamples with replacement.
fn bootstrap_median_sd(values: &[f64]) -> f64 {
    let mut random = SplitMix64(SEED);
    let mut sample = vec![0.0; values.len()];
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..RESAMPLES {
        for value in &mut sample {
            *value = values[random.below(values.len())];
        }
        let middle = median(&sample).unwrap_or(f64::NAN);
        sum += middle;
        squares += middle * middle;
    }
    let mean = sum / RESAMPLES as f64;
    (squares / RESAMPLES as f64 - mean * mean).max(0.0).sqrt()
}

/// The 97.5 % quantile of Student's t (Fisher and Cornish's expansion about the normal quantile, accurate to 1 % from 3 degrees of
/// freedom).
fn t_975(freedom: usize) -> f64 {
    let f = freedom.max(1) as f64;
    1.959_964 + 2.372_3 / f + 2.822_5 / f.powi(2) + 2.555_9 / f.powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks(scales: &[f64]) -> Vec<BlockScale> {
        let block = |log_scale: &f64| BlockScale {
            log_scale: *log_scale,
            near_less_far: 0.0,
            points: 100,
        };
        scales.iter().map(block).collect()
    }

    #[test]
    fn students_t_equals_published_tables() {
        for (freedom, table) in [(3, 3.182), (5, 2.571), (9, 2.262), (30, 2.042)] {
            assert!((t_975(freedom) / table - 1.0).abs() < 0.01, "{freedom}");
        }
    }

    #[test]
    fn the_interval_has_its_nominal_coverage() {
        // Blocks with a known bias; the interval from the statistics alone.
        let mut random = SplitMix64(5);
        let mut uniform = || random.below(1 << 30) as f64 / f64::from(1 << 30);
        let mut normal = || -> f64 { (0..12).map(|_| uniform()).sum::<f64>() - 6.0 };
        for n in [6, 12, 30] {
            let (mut held, tries) = (0, 150);
            for _ in 0..tries {
                let scales: Vec<f64> = (0..n).map(|_| 0.2 + 0.05 * normal()).collect();
                let certificate = ScaleCertificate::of(&blocks(&scales), 0.0).unwrap();
                let [low, high] = certificate.ci95_given_speed.unwrap();
                held += usize::from(low <= -0.2 && -0.2 <= high);
            }
            // 95 % are expected; a binomial share of 150 is nearly always between 90 % and 100 %.
            let share = held as f64 / f64::from(tries);
            assert!((0.90..=1.0).contains(&share), "{n} blocks: {share}");
        }
    }

    #[test]
    fn an_uncertain_speed_widens_the_interval_and_few_blocks_give_none() {
        let scales = [0.01, -0.01, 0.02, 0.0, -0.02, 0.01];
        let exact = ScaleCertificate::of(&blocks(&scales), 0.0).unwrap();
        let given = ScaleCertificate::of(&blocks(&scales), 0.03).unwrap();
        assert_eq!(exact.ci95, exact.ci95_given_speed);
        assert_eq!(exact.ci95, given.ci95_given_speed);
        let wide = |c: &ScaleCertificate| c.ci95.map(|[low, high]| high - low).unwrap();
        assert!(wide(&given) > 2.0 * 1.96 * 0.03);
        assert_eq!(given.verdict, ScaleVerdict::Trusted);
        let few = ScaleCertificate::of(&blocks(&scales[..4]), 0.03).unwrap();
        assert_eq!((few.ci95, few.verdict), (None, ScaleVerdict::Open));
        assert_eq!(ScaleCertificate::of(&[], 0.03), None);
    }

    #[test]
    fn verdicts_follow_from_the_interval() {
        let of = |shift: f64| {
            let scales: Vec<f64> = (0..9).map(|i| shift + 0.002 * f64::from(i % 3)).collect();
            ScaleCertificate::of(&blocks(&scales), 0.02).unwrap()
        };
        assert_eq!(of(0.0).verdict, ScaleVerdict::Trusted);
        assert_eq!(of(0.08).verdict, ScaleVerdict::Open);
        let far = of(0.3);
        assert_eq!(far.verdict, ScaleVerdict::Wrong);
        // True depth is larger than predicted: predictions are too near.
        assert!(far.bias < 0.0 && far.scale > 1.3);
        let [low, high] = far.scale_ci95.unwrap();
        assert!(low < far.scale && far.scale < high);
    }
}
