//! The batch norm statistics of several networks, and what their mean leaves out.

use deepfusion_model::BATCH_NORM_EPSILON;
use deepfusion_model::weights::Weights;
use serde::Serialize;

/// Last part of the names of a batch norm's running statistics.
const MEAN: &str = "running_mean";
const VARIANCE: &str = "running_var";

/// How far apart the statistics of the networks' batch norms are.
///
/// The inputs of several networks together have the variance Σ sᵢ·σᵢ² + Σ sᵢ·(μᵢ − μ)²; the mean of the variances is only the first part.
/// The averaged network's own inputs have different statistics again, which can only be measured by passing data through it, as stochastic
/// weight averaging does (Izmailov et al., arXiv 1803.05407).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct StatisticsSpread {
    /// Number of batch norms whose statistics differ between networks.
    pub layers: usize,
    /// Number of all batch norms.
    pub of: usize,
    /// What the mean of the variances leaves out, relative to it: Σ sᵢ·(μᵢ − μ)² / Σ sᵢ·σᵢ², for the channel of all batch norms where that
    /// is largest.
    pub left_out: f64,
}

/// How far apart the statistics of these networks are, for shares that add up to 1; `None` if all are the same, since their mean is then
/// exact.
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

/// A tensor in each network; `None` if one of them lacks it.
fn values_of<'a>(networks: &[(&'a Weights, f64)], name: &str) -> Option<Vec<&'a [f32]>> {
    let values = |(weights, _): &(&'a Weights, f64)| {
        let tensor = weights.tensors.get(name)?;
        Some(tensor.values.as_slice())
    };
    networks.iter().map(values).collect()
}

/// [`StatisticsSpread::left_out`] for the channels of one batch norm.
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
