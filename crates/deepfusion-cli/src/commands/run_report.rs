//! The page of a run: what it reached, on which frames best and worst, how it learned, how it was measured.

use std::path::Path;

use deepfusion_eval::verdict::{SpeedRow, Verdict};
use deepfusion_hint::count_of;
use deepfusion_jobs::RunHistory;
use deepfusion_jobs::evaluation::{ChosenImage, Evaluated, Standing};
use deepfusion_perception::Reliability;
use deepfusion_render::{HtmlReport, ReliabilityBin, ShownFrame};

use crate::failure::Result;

/// Whether the depth's confidence keeps its promise, on frames that it was not learned from.
pub(super) fn reliability(page: HtmlReport, bins: &[Reliability]) -> HtmlReport {
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

/// What is said of the depth without ground truth.
pub(super) fn verdict(page: HtmlReport, verdict: &Verdict) -> HtmlReport {
    let mut page = page.section("Without ground truth");
    let percent = |v: f64| format!("{:.1} %", 100.0 * v);
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut row = |name: &str, value: String| rows.push((name.to_owned(), value));
    match (&verdict.scale_certificate, &verdict.no_certificate) {
        (Some(certificate), _) => {
            let interval = |of: Option<[f64; 2]>| {
                let ratio =
                    |[low, high]: [f64; 2]| format!("{:.3} to {:.3}", (-high).exp(), (-low).exp());
                of.map_or("too few blocks".to_owned(), ratio)
            };
            row("scale (1 is metric)", format!("{:.3}", certificate.scale));
            row("95 % interval", interval(certificate.ci95));
            let exact = interval(certificate.ci95_given_speed);
            row("95 % interval, if the speed is exact", exact);
            row("verdict", certificate.verdict.to_string());
            let (blocks, points) = (certificate.blocks, certificate.points);
            row(
                "from",
                format!(
                    "{} of road, {}",
                    count_of(blocks, "block"),
                    count_of(points, "scene point")
                ),
            );
            for source in &certificate.sources {
                row(
                    &source.name.to_string(),
                    format!("{} (1 σ)", percent(source.sd)),
                );
            }
        }
        (None, why) => row(
            "scale",
            why.map_or("no certificate".to_owned(), |why| {
                format!("no certificate: {why}")
            }),
        ),
    }
    let found = &verdict.without_truth;
    if let Some(r) = &found.reprojection {
        row(
            "reprojection error",
            format!("{:.4} of {}", r.warped, count_of(r.pairs, "pair")),
        );
        row("unwarped", format!("{:.4}", r.unwarped));
    }
    if let Some(consistency) = found.consistency {
        row("depth against the frame before", percent(consistency));
    }
    if let Some(flip) = found.flip {
        row("depth against the mirrored image", percent(flip));
    }
    page = page.properties(&rows).note(
        "The scale follows from how far scene points move between frames while the vehicle drives a measured way. The frames are \
         none that training saw.",
    );
    if !found.ranges.is_empty() {
        let rows = found.ranges.iter().map(|r| {
            let range = format!("{} to {} m", r.from_m, r.to_m);
            vec![range, r.n.to_string(), format!("{:.3}", r.scale)]
        });
        page = page.table(
            &["predicted depth", "points", "scale"],
            &rows.collect::<Vec<_>>(),
        );
    }
    let ranges = found.speed_ranges();
    if !ranges.is_empty() {
        let columns = [
            ("speed seen through the depth / measured", &found.speeds),
            ("by the road's motion / measured", &found.road_speeds),
            ("by PoseNet / measured", &found.pose_speeds),
        ];
        let columns: Vec<_> = columns
            .into_iter()
            .filter(|(_, rows)| !rows.is_empty())
            .collect();
        let rows = ranges.iter().map(|(from, to)| {
            let range = match to {
                Some(to) => format!("{from} to {to} m/s"),
                None => format!("{from} m/s and more"),
            };
            let of = |rows: &[SpeedRow], text: &dyn Fn(&SpeedRow) -> String| {
                let row = rows.iter().find(|row| row.from_mps == *from);
                row.map_or("–".to_owned(), text)
            };
            let mut cells = vec![range, of(&found.speeds, &|row| row.n.to_string())];
            cells.extend(
                columns
                    .iter()
                    .map(|(_, rows)| of(rows, &|row| format!("{:.3}", row.ratio))),
            );
            cells
        });
        let names = columns.iter().map(|(name, _)| *name);
        let header: Vec<&str> = ["vehicle's speed", "pairs"]
            .into_iter()
            .chain(names)
            .collect();
        page = page.table(&header, &rows.collect::<Vec<_>>());
    }
    page
}

/// Tables and charts of an evaluation.
pub(super) fn accuracy(page: HtmlReport, evaluated: &Evaluated) -> HtmlReport {
    let report = &evaluated.report;
    let mut page = page.evaluation(report).range_charts(report);
    if evaluated.images.len() > 1 {
        page = page
            .section("Frame by frame")
            .frame_charts(&evaluated.images);
    }
    if let Some(points) = &report.points {
        page = page
            .section("Points in space")
            .points(points, &evaluated.points);
    }
    page
}

/// The best frames, a typical one, with its clouds, and the worst.
pub(super) fn frames(page: HtmlReport, shown: &[(ChosenImage, ShownFrame)]) -> Result<HtmlReport> {
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

/// How a run learned, and its settings; nothing of a run that has no log.
pub(super) fn training(mut page: HtmlReport, run: &Path) -> Result<HtmlReport> {
    let history = RunHistory::read(run)?;
    if let Some(log) = &history.log {
        page = page
            .section("How it learned")
            .note(&format!(
                "{}; training curves are means over stretches of steps, held out: the samples never trained on.",
                count_of(log.steps(), "step")
            ))
            .learning(log, history.images_a_step);
    }
    if let Some(settings) = &history.settings {
        page = page
            .section("Settings")
            .settings("config.toml of the run", settings);
    }
    Ok(page)
}

/// The command that is running, as it could be typed again.
pub(super) fn command() -> String {
    let quoted = |word: String| {
        let plain = |c: char| c.is_alphanumeric() || "-_./=,:+@".contains(c);
        if !word.is_empty() && word.chars().all(plain) {
            word
        } else {
            format!("'{}'", word.replace('\'', r"'\''"))
        }
    };
    let words = crate::arguments().map(quoted);
    ["deepfusion".to_owned()]
        .into_iter()
        .chain(words)
        .collect::<Vec<_>>()
        .join(" ")
}
