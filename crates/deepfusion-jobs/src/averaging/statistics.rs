//! What the batch norms of several networks measured of their inputs, and what a mean of it leaves out.

use deepfusion_model::BATCH_NORM_EPSILON;
use deepfusion_model::weights::Weights;
use serde::Serialize;

/// The ends of the names of a batch norm's running statistics, after its own.
const MEAN: &str = "running_mean";
const VARIANCE: &str = "running_var";

/// How far apart networks' batch norms measured their inputs.
///
/// Inputs of several networks together have the variance Σ sᵢ·σᵢ² + Σ sᵢ·(μᵢ − μ)²; the mean of the variances has the first part alone. The mean
/// network's own inputs are neither's: only data that goes through it tells their statistics, as stochastic weight averaging measures them anew
/// (Izmailov et al., arXiv 1803.05407).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct StatisticsSpread {
    /// Batch norms that have other statistics in one network than in another.
    pub layers: usize,
    /// All batch norms.
    pub of: usize,
    /// What the mean of the variances leaves out, as a share of it: Σ sᵢ·(μᵢ − μ)² / Σ sᵢ·σᵢ², of the channel of all batch norms where that is
    /// largest.
    pub left_out: f64,
}

/// How far apart the statistics of these networks are, for shares that add up to 1; `None` where all have the same, whose mean is exact.
pub(super) fn spread(networks: &[(&Weights, f64)]) -> Option<StatisticsSpread> {
    let shares: Vec<f64> = networks.iter().map(|(_, share)| *share).collect();
    let (first, _) = networks.first()?;
    let mut spread = StatisticsSpread {
        layers: 0,
        of: 0,
        left_out: 0.0,
    };
    for norm in first.tensors.keys().filter_map(|k| k.strip_suffix(MEAN)) {
        let values = |end: &str| values_of(networks, &format!("{norm}{end}"));
        let (Some(means), Some(variances)) = (values(MEAN), values(VARIANCE)) else {
            continue;
        };
        spread.of += 1;
        let alike = |all: &[&[f32]]| all.windows(2).all(|pair| pair[0] == pair[1]);
        if !(alike(&means) && alike(&variances)) {
            spread.layers += 1;
            let most = left_out(&means, &variances, &shares);
            spread.left_out = spread.left_out.max(most);
        }
    }
    (spread.layers > 0).then_some(spread)
}

/// A tensor of each network; `None` where one of them lacks it.
fn values_of<'a>(networks: &[(&'a Weights, f64)], name: &str) -> Option<Vec<&'a [f32]>> {
    let values = |(weights, _): &(&'a Weights, f64)| {
        let tensor = weights.tensors.get(name)?;
        Some(tensor.values.as_slice())
    };
    networks.iter().map(values).collect()
}

/// [`StatisticsSpread::left_out`] of the channels of one batch norm.
fn left_out(means: &[&[f32]], variances: &[&[f32]], shares: &[f64]) -> f64 {
    let lengths = means.iter().chain(variances).map(|values| values.len());
    let channels = lengths.min().unwrap_or_default();
    let of_channel = |channel: usize| {
        let mean_of = |of: &dyn Fn(usize) -> f64| -> f64 {
            shares.iter().enumerate().map(|(i, s)| s * of(i)).sum()
        };
        let mean = mean_of(&|i| f64::from(means[i][channel]));
        let apart = mean_of(&|i| (f64::from(means[i][channel]) - mean).powi(2));
        // A channel that is always 0 has no variance.
        apart / (mean_of(&|i| f64::from(variances[i][channel])) + BATCH_NORM_EPSILON)
    };
    (0..channels).map(of_channel).fold(0.0, f64::max)
}
