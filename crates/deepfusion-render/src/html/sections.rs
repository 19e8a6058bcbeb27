//! Whole sections of a run's report.

use deepfusion_eval::{DrawnPoint, ImageScore, PointErrors, Points, Report};
use deepfusion_hint::count_of;

use super::HtmlReport;
use crate::learning::smoothed;
use crate::{BarChart, LearningLog, LineChart, ScatterChart, histogram};

/// Points of a training curve: more would show the noise of single batches.
const CURVE_POINTS: usize = 80;

/// The title of a curve for each column of `log.csv`; other columns use their own name.
const TITLES: [(&str, &str); 13] = [
    ("total", "Total loss"),
    ("reprojection", "Photometric reprojection"),
    ("smoothness", "Smoothness, unweighted"),
    ("speed", "Speed loss, m per pair, unweighted"),
    ("affine", "Affine invariant loss, unweighted"),
    ("flow", "Flow loss, unweighted"),
    ("agreement", "Rigid flow against flow, px, unweighted"),
    ("valid_share", "Share of pixels in view"),
    ("explained_share", "Share explained by the warp"),
    ("moving_share", "Share masked as moving"),
    ("learning_rate", "Learning rate"),
    ("scale_ratio", "Scale ratio, 1 where metric"),
    ("selection", "What `best` is chosen by"),
];

/// One bin of a reliability plot: expected and observed error of a confidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReliabilityBin {
    /// The bin's middle confidence, 0 to 1.
    pub confidence: f64,
    /// Mean relative error that the confidence predicts.
    pub expected: f64,
    /// Mean relative error against ground truth.
    pub observed: f64,
    /// Number of pixels.
    pub n: usize,
}

impl HtmlReport {
    /// Adds curves of every column of the log, training and validation. Terms that are zero throughout are only listed.
    /// `images_a_step` converts images per second into seconds per step.
    #[must_use]
    pub fn learning(mut self, log: &LearningLog, images_a_step: Option<f64>) -> Self {
        let mut off = Vec::new();
        for column in log.columns() {
            if log.is_zero(column) {
                off.push(column.as_str());
                continue;
            }
            self = self.chart(&learning_chart(log, column, images_a_step));
        }
        if !off.is_empty() {
            self = self.note(&format!("Zero or absent throughout: {}.", off.join(", ")));
        }
        self
    }

    /// Adds bars of the unscaled errors by range.
    #[must_use]
    pub fn range_charts(self, report: &Report) -> Self {
        let chart = |title: &str, value: fn(&deepfusion_eval::RangeBin) -> Option<f64>| {
            let groups = report
                .ranges
                .iter()
                .map(|r| format!("{} to {} m", r.from_m, r.to_m));
            BarChart::new(title, "true depth", groups)
                .bars("unscaled", report.ranges.iter().map(value).collect())
        };
        self.chart(&chart("Abs Rel by range, unscaled", |r| r.abs_rel))
            .chart(&chart("RMSE by range, m, unscaled", |r| r.rmse))
    }

    /// Adds scale ratio and error of every evaluated frame, in order.
    #[must_use]
    pub fn frame_charts(self, images: &[ImageScore]) -> Self {
        let curve = |value: &dyn Fn(&ImageScore) -> f64| -> Vec<(f64, f64)> {
            let at = |(i, image)| (i as f64, value(image));
            images.iter().enumerate().map(at).collect()
        };
        self.chart(
            &LineChart::new(
                "Scale ratio: median(gt) / median(prediction)",
                "evaluated frame",
            )
            .line("ratio", curve(&|i| i.ratio))
            .reference(1.0, "metric"),
        )
        .chart(
            &LineChart::new("Abs Rel of each frame", "evaluated frame")
                .line("unscaled", curve(&|i| i.unscaled.abs_rel))
                .line("median-scaled", curve(&|i| i.median_scaled.abs_rel)),
        )
    }

    /// Adds a comparison of predicted points with their true positions: the table by range, coordinates, distances.
    #[must_use]
    pub fn points(mut self, points: &Points, drawn: &[DrawnPoint]) -> Self {
        let metres = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.3}"));
        let row = |label: String, plain: &PointErrors, scaled: &PointErrors| {
            vec![
                label,
                plain.n.to_string(),
                metres(plain.mean_m),
                metres(plain.std_m),
                metres(plain.sem_m),
                metres(plain.sem_images_m),
                metres(scaled.mean_m),
                metres(scaled.std_m),
                metres(scaled.sem_m),
            ]
        };
        let mut rows = vec![row("all".into(), &points.unscaled, &points.median_scaled)];
        rows.extend(points.ranges.iter().map(|r| {
            let label = format!("{} to {} m", r.from_m, r.to_m);
            row(label, &r.unscaled, &r.median_scaled)
        }));
        let header = [
            "true depth",
            "points",
            "mean, m",
            "std, m",
            "std error, m",
            "by image, m",
            "scaled: mean, m",
            "std, m",
            "std error, m",
        ];
        let distance = if points.in_space {
            "Euclidean distance in the camera's axes between the predicted point and the LiDAR's"
        } else {
            "distance along z, for the camera is not known,"
        };
        self = self.table(&header, &rows).note(&format!(
            "{} drawn uniformly over all compared pixels (seed {}): {distance}. The LiDAR's point is taken at its \
             depth on the ray through the centre of the pixel it fell on, so both lie on one ray. Standard error: std / √n, \
             as if points were independent; by image: with images as the independent units, since the points of an image err \
             together.",
            count_of(points.unscaled.n, "point"),
            points.seed
        ));
        if points.in_space {
            for (axis, name) in ["X, right", "Y, down", "Z, forward"].iter().enumerate() {
                let pairs = drawn.iter().map(|p| (p.truth[axis], p.predicted[axis]));
                self = self.chart(&ScatterChart::new(
                    format!("{name}: predicted over true, m"),
                    "true, m",
                    pairs.collect(),
                ));
            }
        }
        let unscaled: Vec<f64> = drawn.iter().map(DrawnPoint::distance_m).collect();
        let scaled: Vec<f64> = drawn
            .iter()
            .map(DrawnPoint::median_scaled_distance_m)
            .collect();
        let end = percentile(&unscaled, 0.95).max(percentile(&scaled, 0.95));
        self.chart(
            &LineChart::new("Share of points by distance", "distance, m")
                .line("unscaled", histogram(&unscaled, end, 40))
                .line("median-scaled", histogram(&scaled, end, 40)),
        )
        .note(&format!(
            "The histogram ends at {end:.2} m, the larger 95th percentile."
        ))
    }

    /// Adds a reliability plot: observed over expected relative error, bin by bin.
    #[must_use]
    pub fn reliability(self, bins: &[ReliabilityBin]) -> Self {
        let rows: Vec<Vec<String>> = bins
            .iter()
            .map(|b| {
                vec![
                    format!("{:.2}", b.confidence),
                    b.n.to_string(),
                    format!("{:.3}", b.expected),
                    format!("{:.3}", b.observed),
                ]
            })
            .collect();
        let pairs = bins.iter().map(|b| (b.expected, b.observed)).collect();
        self.chart(
            &ScatterChart::new("Observed relative error over expected", "expected", pairs).large(),
        )
        .table(
            &["confidence", "pixels", "expected error", "observed error"],
            &rows,
        )
    }
}

fn learning_chart(log: &LearningLog, column: &str, images_a_step: Option<f64>) -> LineChart {
    let (train, validation) = (log.series(column, false), log.series(column, true));
    if column == "images_per_second" {
        let seconds = |(step, pace): &(f64, f64)| match images_a_step {
            Some(images) => (*step, images / pace),
            None => (*step, *pace),
        };
        let paces: Vec<_> = train.iter().filter(|p| p.1 > 0.0).map(seconds).collect();
        let title = match images_a_step {
            Some(_) => "Seconds a step",
            None => "Images a second",
        };
        return LineChart::new(title, "step").line("training", smoothed(&paces, CURVE_POINTS));
    }
    let title = TITLES.iter().find(|(name, _)| *name == column);
    let mut chart = LineChart::new(title.map_or(column, |(_, title)| *title), "step");
    if column == "learning_rate" {
        return chart.line("training", train);
    }
    let finite = |points: &[(f64, f64)]| points.iter().any(|p| p.1.is_finite());
    if finite(&train) {
        chart = chart.line("training", smoothed(&train, CURVE_POINTS));
    }
    if finite(&validation) {
        chart = chart.line("held out", validation);
    }
    match column {
        "scale_ratio" => chart.reference(1.0, "metric"),
        _ => chart,
    }
}

fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1) as f64;
    sorted
        .get((last * share).round() as usize)
        .copied()
        .unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reliability_plot_has_a_dot_for_each_bin() {
        let bins = [0.2, 0.5, 0.9].map(|confidence: f64| ReliabilityBin {
            confidence,
            expected: -confidence.ln(),
            observed: 0.1,
            n: 10,
        });
        let html = HtmlReport::new("t", "s").reliability(&bins).to_html();
        assert_eq!(html.matches("h0").count(), 3);
        assert!(html.contains("0.693"), "−ln 0.5 is what 0.5 stands for");
    }

    #[test]
    fn percentiles_of_nothing_are_zero() {
        assert_eq!(percentile(&[], 0.95), 0.0);
        assert_eq!(percentile(&[3.0, 1.0, 2.0], 0.5), 2.0);
    }
}
