//! The results for depth without ground truth, on a page.

use deepfusion_eval::verdict::{Evidence, ScaleCertificate, SpeedRow, Verdict};
use deepfusion_hint::count_of;

use super::HtmlReport;

impl HtmlReport {
    /// Adds a section with the results for depth without ground truth: the scale and its uncertainty, how well depth, images and motion
    /// agree, the scale by predicted depth, and speeds compared with the measured ones.
    #[must_use]
    pub fn verdict(self, verdict: &Verdict) -> Self {
        let found = &verdict.without_truth;
        let mut rows = match (&verdict.scale_certificate, &verdict.no_certificate) {
            (Some(certificate), _) => certificate_rows(certificate),
            (None, why) => vec![row(
                "scale",
                why.map_or("no certificate".to_owned(), |why| {
                    format!("no certificate: {why}")
                }),
            )],
        };
        rows.extend(evidence_rows(found));
        let page = self.section("Without ground truth").properties(&rows).note(
            "The scale follows from how far scene points move between frames while the vehicle drives a measured distance. Training did not use these frames.",
        );
        add_speeds(add_ranges(page, found), found)
    }
}

fn row(name: &str, value: String) -> (String, String) {
    (name.to_owned(), value)
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn certificate_rows(certificate: &ScaleCertificate) -> Vec<(String, String)> {
    let interval = |of: Option<[f64; 2]>| {
        let ratio = |[low, high]: [f64; 2]| format!("{:.3} to {:.3}", (-high).exp(), (-low).exp());
        of.map_or("too few blocks".to_owned(), ratio)
    };
    let (blocks, points) = (certificate.blocks, certificate.points);
    let mut rows = vec![
        row("scale (1 is metric)", format!("{:.3}", certificate.scale)),
        row("95 % interval", interval(certificate.ci95)),
        row(
            "95 % interval, if the speed is exact",
            interval(certificate.ci95_given_speed),
        ),
        row("verdict", certificate.verdict.to_string()),
        row(
            "from",
            format!(
                "{} of road, {}",
                count_of(blocks, "block"),
                count_of(points, "scene point")
            ),
        ),
    ];
    for source in &certificate.sources {
        let name = source.name.to_string();
        rows.push((name, format!("{} (1 σ)", percent(source.sd))));
    }
    rows
}

fn evidence_rows(found: &Evidence) -> Vec<(String, String)> {
    let mut rows = Vec::new();
    if let Some(r) = &found.reprojection {
        let pairs = count_of(r.pairs, "pair");
        rows.push(row(
            "reprojection error",
            format!("{:.4} of {pairs}", r.warped),
        ));
        rows.push(row("unwarped", format!("{:.4}", r.unwarped)));
    }
    if let Some(consistency) = found.consistency {
        let differs = percent(consistency);
        rows.push(row("depth against the frame before", differs));
    }
    if let Some(flip) = found.flip {
        rows.push(row("depth against the mirrored image", percent(flip)));
    }
    rows
}

/// A table of the scale by predicted depth.
fn add_ranges(page: HtmlReport, found: &Evidence) -> HtmlReport {
    if found.ranges.is_empty() {
        return page;
    }
    let rows = found.ranges.iter().map(|r| {
        let range = format!("{} to {} m", r.from_m, r.to_m);
        vec![range, r.n.to_string(), format!("{:.3}", r.scale)]
    });
    page.table(
        &["predicted depth", "points", "scale"],
        &rows.collect::<Vec<_>>(),
    )
}

/// A table of speeds compared with the measured ones, with a column for each way of estimating them.
fn add_speeds(page: HtmlReport, found: &Evidence) -> HtmlReport {
    let ranges = found.speed_ranges();
    if ranges.is_empty() {
        return page;
    }
    let columns = [
        ("speed from depth / measured", &found.speeds),
        ("from the road's motion / measured", &found.road_speeds),
        ("from PoseNet / measured", &found.pose_speeds),
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
    page.table(&header, &rows.collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_eval::verdict::{NoCertificate, speed_rows};

    #[test]
    fn a_missing_certificate_is_explained() {
        let verdict = Verdict {
            no_certificate: Some(NoCertificate::AllSeen),
            ..Verdict::default()
        };
        let html = HtmlReport::new("t", "s").verdict(&verdict).to_html();
        let why = format!("no certificate: {}", NoCertificate::AllSeen);
        assert!(html.contains(&why), "{html}");
        assert!(!html.contains("predicted depth</th>") && !html.contains("pairs</th>"));
    }

    /// A way of estimating speed that has no results has no column.
    #[test]
    fn estimates_without_results_have_no_column() {
        let mut verdict = Verdict::default();
        verdict.without_truth.speeds = speed_rows(&[(2.0, 0.0), (30.0, 0.0)]);
        verdict.without_truth.pose_speeds = speed_rows(&[(30.0, 0.0)]);
        let html = HtmlReport::new("t", "s").verdict(&verdict).to_html();
        for text in ["0 to 3 m/s", "25 m/s and more", "from PoseNet / measured"] {
            assert!(html.contains(text), "no `{text}` in {html}");
        }
        assert!(!html.contains("from the road"), "{html}");
        assert!(html.contains("no certificate<"), "{html}");
    }
}
