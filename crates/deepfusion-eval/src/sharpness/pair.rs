use crate::resample::{Axis, sample};
use crate::{Grid, Prediction, Protocol, median};

/// With a smaller share of known pixels, the truth is not dense: scans cover some 5 % of an image, KITTI's annotated depth some 20 %, depth
/// cameras and renderers most of it.
const DENSE: f64 = 0.5;
/// Smallest side of an image, in pixels: in a smaller one, distances of up to 10 px mean nothing.
const LEAST_PX: usize = 21;

/// True and predicted depth in the compared window, pixel by pixel, in metres and within the protocol's range.
#[derive(Debug, Clone)]
pub(super) struct Pair {
    pub(super) width: usize,
    pub(super) height: usize,
    /// True depth. Everything beyond the cap, including the sky, is at the cap. Meaningless where not `known`.
    pub(super) truth: Vec<f64>,
    /// Predicted depth, median-scaled, then clamped. Meaningless where not `known`.
    pub(super) prediction: Vec<f64>,
    /// Whether both depths are known.
    pub(super) known: Vec<bool>,
}

impl Pair {
    /// `None` if the truth is small or not dense, or none of it is within the range.
    pub(super) fn new(truth: &Grid, prediction: &Prediction, protocol: &Protocol) -> Option<Self> {
        let (rows, columns) = protocol.crop.window(truth.width(), truth.height());
        let (width, height) = (columns.len(), rows.len());
        let values: Vec<f64> = rows
            .clone()
            .flat_map(|y| {
                let start = y * truth.width();
                &truth.values()[start + columns.start..start + columns.end]
            })
            .copied()
            .collect();
        // Infinity counts as known: it is the sky.
        let given = |depth: f64| depth > protocol.min_m;
        let count = values.iter().filter(|d| given(**d)).count();
        let large = width.min(height) >= LEAST_PX;
        if !large || (count as f64) < DENSE * values.len() as f64 {
            return None;
        }
        let grid = prediction.grid();
        let disparities = prediction.disparities();
        let across = Axis::new(grid.width(), truth.width());
        let down = Axis::new(grid.height(), truth.height());
        let predicted: Vec<Option<f64>> = (0..width * height)
            .map(|i| {
                let (x, y) = (columns.start + i % width, rows.start + i / width);
                sample(&disparities, grid.width(), &across, &down, x, y).map(|d| 1.0 / d)
            })
            .collect();
        let within: Vec<(f64, f64)> = values
            .iter()
            .zip(&predicted)
            .filter(|(d, _)| given(**d) && **d < protocol.cap_m)
            .filter_map(|(d, p)| Some((*d, (*p)?)))
            .collect();
        let middle =
            |of: fn(&(f64, f64)) -> f64| median(&within.iter().map(of).collect::<Vec<_>>());
        let ratio = middle(|p| p.0)? / middle(|p| p.1)?;
        let clamp = |depth: f64| depth.clamp(protocol.min_m, protocol.cap_m);
        Some(Self {
            width,
            height,
            known: values
                .iter()
                .zip(&predicted)
                .map(|(d, p)| given(*d) && p.is_some())
                .collect(),
            // `clamp` keeps NaN, which counts as unknown.
            truth: values.iter().map(|d| clamp(*d)).collect(),
            prediction: predicted
                .iter()
                .map(|p| p.map_or(protocol.cap_m, |p| clamp(p * ratio)))
                .collect(),
        })
    }
}
