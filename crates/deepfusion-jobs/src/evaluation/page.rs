//! The page of an evaluation: the results, the best and the worst frames, and how they were measured.

use std::path::Path;

use deepfusion_eval::compare::SavedEvaluation;
use deepfusion_eval::verdict::Verdict;
use deepfusion_eval::{Crop, GroundTruth, Protocol};
use deepfusion_perception::Reliability;
use deepfusion_render::{HtmlReport, ReliabilityBin, ShownFrame};
use deepfusion_runtime::ModelSource;

use super::{ChosenImage, Evaluated, EvaluationRequest, MeasurementRequest, Standing};
use crate::{ModelFacts, Result, RunHistory, name_of};

/// The contents of the page of an evaluation.
pub struct EvaluationPage<'a> {
    /// The depth that was evaluated.
    pub source: MeasuredDepth<'a>,
    /// The results.
    pub evaluated: &'a Evaluated,
    /// The images to show, from [`super::shown_of_datasets`] or [`super::shown_of_arrays`].
    pub shown: &'a [(ChosenImage, ShownFrame)],
    /// How reliable the confidence is that was learned from these images.
    pub reliability: Option<&'a [Reliability]>,
    /// The verdict on the depth without ground truth.
    pub verdict: Option<&'a Verdict>,
}

/// The depth that was evaluated.
#[derive(Clone, Copy)]
pub enum MeasuredDepth<'a> {
    /// Depth from a file of arrays.
    Arrays {
        /// Path of the predictions.
        predictions: &'a Path,
        /// Path of the ground truth.
        truth: &'a Path,
        /// The protocol of the comparison.
        protocol: &'a Protocol,
        /// The command that makes the page again.
        command: &'a str,
    },
    /// Depth by a network.
    Network {
        /// The network.
        model: &'a ModelSource,
        /// The request for the evaluation.
        request: &'a EvaluationRequest<'a>,
        /// The evaluation as saved.
        saved: &'a SavedEvaluation,
    },
}

impl EvaluationPage<'_> {
    /// Makes the page.
    ///
    /// # Errors
    /// A picture that cannot be encoded; a log in the run's folder that another program wrote.
    pub fn compose(&self) -> Result<HtmlReport> {
        let mut page = self.facts().section("Accuracy");
        page = self.evaluated.add_to(page);
        page = add_frames(page, self.shown)?;
        page = page
            .section("How it was measured")
            .properties(&self.how())
            .command(self.command());
        if let Some(bins) = self.reliability {
            page = add_reliability(page, bins);
        }
        if let Some(verdict) = self.verdict {
            page = page.verdict(verdict);
        }
        if let MeasuredDepth::Network { model, .. } = self.source
            && let Some(run) = model.folder()
        {
            page = RunHistory::read(run)?.add_to(page);
        }
        Ok(page)
    }

    /// Title and key figures.
    fn facts(&self) -> HtmlReport {
        let report = &self.evaluated.report;
        let (name, on) = match self.source {
            MeasuredDepth::Arrays { predictions, .. } => (name_of(predictions), String::new()),
            MeasuredDepth::Network { model, request, .. } => {
                let names: Vec<_> = request.data.iter().map(|p| name_of(p)).collect();
                let on = if names.is_empty() {
                    String::new()
                } else {
                    format!(" on {}", names.join(", "))
                };
                (model.name(), on)
            }
        };
        let images = match report.expected {
            Some(expected) => format!("{} of the split's {expected}", report.n),
            None => report.n.to_string(),
        };
        let page = HtmlReport::new(name, format!("Depth measured{on}"));
        self.evaluated.add_key_figures(page, ("images", &images))
    }

    /// The command that makes the page again.
    fn command(&self) -> &str {
        match self.source {
            MeasuredDepth::Arrays { command, .. } => command,
            MeasuredDepth::Network { request, .. } => &request.command,
        }
    }

    /// How it was measured, as rows of a table.
    fn how(&self) -> Vec<(String, String)> {
        let (mut rows, protocol, digest) = match self.source {
            MeasuredDepth::Arrays {
                predictions,
                truth,
                protocol,
                ..
            } => (
                vec![
                    ("predictions", predictions.display().to_string()),
                    ("ground truth", truth.display().to_string()),
                ],
                protocol,
                None,
            ),
            MeasuredDepth::Network { request, saved, .. } => (
                network_rows(request, saved),
                &request.measurement.protocol,
                saved.report.truth_sha256.clone(),
            ),
        };
        rows.extend(protocol_rows(protocol));
        rows.extend(digest.map(|digest| ("SHA-256 of the ground truth", digest)));
        let named = |(name, value): (&str, String)| (name.to_owned(), value);
        rows.into_iter().map(named).collect()
    }
}

impl Evaluated {
    /// Adds the key figures to a page, and another one with its name.
    pub(crate) fn add_key_figures(&self, page: HtmlReport, more: (&str, &str)) -> HtmlReport {
        let report = &self.report;
        let number = |v: f64| format!("{v:.3}");
        let (own, scale) = (number(report.unscaled.abs_rel), number(report.scale.median));
        let within = format!("{:.1} %", 100.0 * report.unscaled.a1);
        let baseline = report.mean_depth_baseline.as_ref();
        let baseline = baseline.map(|b| number(b.unscaled.abs_rel));
        let mut facts = vec![("Abs Rel, unscaled", own.as_str())];
        // There is none if the training scans are missing.
        if let Some(baseline) = &baseline {
            facts.push(("Abs Rel, mean-depth baseline", baseline.as_str()));
        }
        facts.extend([
            ("scale (1 is metric)", scale.as_str()),
            ("within 25 %", within.as_str()),
            more,
        ]);
        page.facts(&facts)
    }

    /// Adds the tables and charts to a page.
    #[must_use]
    pub fn add_to(&self, page: HtmlReport) -> HtmlReport {
        let report = &self.report;
        let mut page = page.evaluation(report).range_charts(report);
        if self.images.len() > 1 {
            page = page.section("Frame by frame").frame_charts(&self.images);
        }
        if let Some(points) = &report.points {
            page = page.section("Points in space").points(points, &self.points);
        }
        page
    }
}

/// Adds the best frames, a typical one with its clouds, and the worst.
fn add_frames(page: HtmlReport, shown: &[(ChosenImage, ShownFrame)]) -> Result<HtmlReport> {
    let mut page = page.section("Best and worst frames").note(
        "By unscaled Abs Rel. Depth is coloured by the logarithm of metres, warm near and cold far; errors are blue where the \
         prediction is too near, red where it is too far.",
    );
    for (chosen, frame) in shown {
        page = page.frame(frame)?;
        if chosen.standing == Standing::Median {
            page = page.clouds(frame)?;
        }
    }
    Ok(page)
}

/// Adds how reliable the confidence is on frames that it was not learned from.
fn add_reliability(page: HtmlReport, bins: &[Reliability]) -> HtmlReport {
    let bins: Vec<ReliabilityBin> = bins
        .iter()
        .map(|bin| ReliabilityBin {
            confidence: bin.confidence,
            expected: bin.expected,
            observed: bin.observed,
            n: bin.n,
        })
        .collect();
    page.section("How far to trust a pixel").reliability(&bins)
}

/// How a network was evaluated.
fn network_rows(
    request: &EvaluationRequest<'_>,
    saved: &SavedEvaluation,
) -> Vec<(&'static str, String)> {
    let m = &saved.measured;
    let data = request.data.iter().map(|p| p.display().to_string());
    let MeasurementRequest {
        truth, protocol, ..
    } = &request.measurement;
    let truth = match truth {
        Some(path) => path.display().to_string(),
        None if protocol.gt == GroundTruth::Annotated => "KITTI's annotated depth".into(),
        None => "the recordings' scans".into(),
    };
    let mut rows = vec![("recordings", data.collect::<Vec<_>>().join(", "))];
    if let Some(split) = request.split {
        rows.push(("split", split.display().to_string()));
    }
    rows.extend([
        ("ground truth", truth),
        ("camera", m.camera.clone()),
        ("checkpoint", saved.model.checkpoint.clone()),
        ("its SHA-256", saved.model.sha256.clone()),
        ("engine", m.engine.clone()),
        (
            "seen in training",
            match m.held_out {
                Some(true) => "no",
                Some(false) => "yes",
                None => "unknown",
            }
            .into(),
        ),
        (
            "correction for the focal length",
            if m.focal_correction { "on" } else { "off" }.into(),
        ),
        ("program", m.program.clone()),
        ("time (UTC)", m.time.clone()),
    ]);
    if let Some(how) = m.post_process {
        rows.push(("post-processing", how.explained().to_owned()));
    }
    rows
}

/// The pixels and depths that the protocol compares.
fn protocol_rows(protocol: &Protocol) -> [(&'static str, String); 2] {
    let crop = match protocol.crop {
        Crop::None => "the whole image",
        Crop::Garg => "Garg's crop",
    };
    [
        ("compared", crop.to_owned()),
        (
            "range",
            format!("{} to {} m", protocol.min_m, protocol.cap_m),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_eval::{Evaluator, Grid, Prediction};

    #[test]
    fn the_page_of_arrays_names_the_compared_files() {
        let protocol = Protocol::default();
        let mut evaluator = Evaluator::new(protocol.clone()).unwrap();
        let depth = || Grid::new(2, 1, vec![10.0, 20.0]).unwrap();
        let prediction = Prediction::Depth(depth());
        evaluator.add("a", &prediction, &depth()).unwrap();
        let evaluated = Evaluated {
            report: evaluator.report().unwrap(),
            images: evaluator.images().to_vec(),
            points: Vec::new(),
            places: Vec::new(),
        };
        let page = EvaluationPage {
            source: MeasuredDepth::Arrays {
                predictions: Path::new("depth.npz"),
                truth: Path::new("gt.npz"),
                protocol: &protocol,
                command: "deepfusion eval",
            },
            evaluated: &evaluated,
            shown: &[],
            reliability: None,
            verdict: None,
        };
        let html = page.compose().unwrap().to_html();
        for text in [
            "<h1>depth.npz</h1><p>Depth measured</p>",
            "gt.npz",
            "the whole image",
            "<code>deepfusion eval</code>",
        ] {
            assert!(html.contains(text), "no `{text}` in {html}");
        }
    }
}
