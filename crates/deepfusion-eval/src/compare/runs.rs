use std::collections::BTreeMap;
use std::path::Path;

use crate::{Crop, Metrics, PointErrors, RangeBin, Report};

use super::eigen::beside_published;
use super::evaluation::{Evaluation, Origin};
use super::plausibility::{Flag, FlagReason, Severity, check, identical};
use super::table::{Better, Column, Row, Table, Tables, Value};

/// Tables of evaluations: unscaled, median-scaled, by range and of drawn points, for each combination of protocol and ground truth.
#[must_use]
pub fn run_tables(evaluations: &[Evaluation]) -> Tables {
    let mut grounds: Vec<(String, Vec<&Evaluation>)> = Vec::new();
    for evaluation in evaluations {
        let ground = evaluation.ground();
        match grounds.iter_mut().find(|(key, _)| *key == ground) {
            Some((_, members)) => members.push(evaluation),
            None => grounds.push((ground, vec![evaluation])),
        }
    }
    let mut notes = Vec::new();
    if grounds.len() > 1 {
        notes.push(format!(
            "These evaluations form {} groups that differ in protocol or ground truth. Each has its own tables; rows of \
             different tables cannot be compared.",
            grounds.len()
        ));
    }
    let mut tables = Vec::new();
    for (number, (_, members)) in grounds.iter().enumerate() {
        let ground = match (grounds.len(), recordings(members).join("; ")) {
            (1, _) => String::new(),
            (_, names) if names.is_empty() => format!("Group {}: ", number + 1),
            (_, names) => format!("Group {} ({names}): ", number + 1),
        };
        tables.extend(ground_tables(&ground, members));
    }
    Tables { notes, tables }
}

fn ground_tables(ground: &str, members: &[&Evaluation]) -> Vec<Table> {
    let mean_depth_baseline = baseline_rows(members);
    let mut unscaled = metric_table(members, &mean_depth_baseline, false);
    unscaled.title = format!("{ground}Unscaled");
    unscaled.notes.splice(0..0, about(members));
    let mut scaled = metric_table(members, &mean_depth_baseline, true);
    scaled.title = format!("{ground}Median-scaled");
    scaled
        .notes
        .push("Each image multiplied by median(gt) / median(prediction).".into());
    let mut tables = vec![unscaled, scaled];
    tables.extend(range_tables(ground, members));
    tables.extend(point_table(ground, members));
    tables
}

/// What was measured and how, in sentences.
fn about(members: &[&Evaluation]) -> Vec<String> {
    let report = &members[0].report;
    let p = &report.protocol;
    let crop = match p.crop {
        Crop::None => "whole image",
        Crop::Garg => "Garg's crop",
    };
    let gt = p.gt.meaning();
    let plural = if report.n == 1 { "" } else { "s" };
    let mut notes = vec![format!(
        "Metres as predicted. {} image{plural}, {crop}, {} to {} m, ground truth: {gt}.",
        report.n, p.min_m, p.cap_m
    )];
    let data = recordings(members);
    if !data.is_empty() {
        notes.push(format!("Recordings: {}.", data.join("; ")));
    }
    notes.push(match &report.truth_sha256 {
        Some(digest) => format!(
            "All rows have exactly the same ground truth (SHA-256 {}…).",
            &digest.get(..12).unwrap_or(digest)
        ),
        None => "These files do not record their ground truth: only the protocol and the number of images are known to \
                 agree."
            .into(),
    });
    notes.push(beside_published(report));
    notes
}

/// Names of the recordings that the evaluations record; each once.
fn recordings(members: &[&Evaluation]) -> Vec<String> {
    let mut data: Vec<String> = Vec::new();
    for member in members {
        if let Origin::Saved { measured, .. } = &member.origin {
            let names = measured.data.iter().map(|p| file_name(p));
            let text = names.collect::<Vec<_>>().join(", ");
            if !text.is_empty() && !data.contains(&text) {
                data.push(text);
            }
        }
    }
    data
}

fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Mean-depth baselines, each with the names of the evaluations that contain it.
fn baseline_rows(members: &[&Evaluation]) -> Vec<(String, Metrics, Metrics)> {
    let mut rows: Vec<(Vec<&str>, Metrics, Metrics)> = Vec::new();
    for member in members {
        if let Some(mean_depth_baseline) = &member.report.mean_depth_baseline {
            match rows
                .iter_mut()
                .find(|r| r.1 == mean_depth_baseline.unscaled)
            {
                Some(row) => row.0.push(&member.name),
                None => rows.push((
                    vec![&member.name],
                    mean_depth_baseline.unscaled,
                    mean_depth_baseline.median_scaled,
                )),
            }
        }
    }
    let one = rows.len() == 1;
    let named = |(names, unscaled, scaled): (Vec<&str>, Metrics, Metrics)| {
        if one {
            ("mean-depth baseline".to_owned(), unscaled, scaled)
        } else {
            (
                format!("mean-depth baseline of {}", names.join(", ")),
                unscaled,
                scaled,
            )
        }
    };
    rows.into_iter().map(named).collect()
}

fn metric_table(
    members: &[&Evaluation],
    mean_depth_baseline: &[(String, Metrics, Metrics)],
    median_scaled: bool,
) -> Table {
    let metrics = |r: &Report| {
        if median_scaled {
            r.median_scaled
        } else {
            r.unscaled
        }
    };
    let figures: Vec<(&str, _)> = members
        .iter()
        .map(|m| (m.name.as_str(), metrics(&m.report).to_array().map(Some)))
        .collect();
    let mut columns = vec![Column::words("run", "Run")];
    columns.extend(Column::metrics());
    columns.push(Column::numbers("scale", "scale", Some(Better::NearOne)));
    columns.push(Column::numbers(
        "scale_spread",
        "spread",
        Some(Better::Lower),
    ));
    if median_scaled {
        columns.truncate(8);
    }
    let mut rows = Vec::new();
    for (member, twin) in members.iter().zip(identical(&figures)) {
        let figures = metrics(&member.report).to_array();
        let mut flags = check(&figures.map(Some), 0.0, member.report.protocol.cap_m);
        flags.extend(twin.map(|t| Flag {
            severity: Severity::Note,
            ..t
        }));
        flags.extend(notes(member));
        let mut cells = vec![Value::from(member.name.as_str())];
        cells.extend(figures.map(Value::Number));
        cells.push(Value::Number(member.report.scale.median));
        cells.push(Value::Number(member.report.scale.std_rel));
        cells.truncate(columns.len());
        rows.push(Row {
            cells,
            flags,
            ranked: true,
            source: None,
        });
    }
    for (name, unscaled, scaled) in mean_depth_baseline {
        let figures = if median_scaled { scaled } else { unscaled };
        let mut cells = vec![Value::from(name.as_str())];
        cells.extend(figures.to_array().map(Value::Number));
        cells.resize(columns.len(), Value::Missing);
        rows.push(Row {
            cells,
            ..Row::default()
        });
    }
    let notes = if mean_depth_baseline.is_empty() || median_scaled {
        Vec::new()
    } else {
        vec![
            "Mean-depth baseline: the mean depth of each pixel over the training scans; it is not ranked."
                .to_owned(),
        ]
    };
    Table {
        title: String::new(),
        notes,
        columns,
        rows,
    }
}

/// What a reader must know about an evaluation.
fn notes(member: &Evaluation) -> Vec<Flag> {
    let mut flags = Vec::new();
    if let Origin::Saved {
        outdated: true,
        model,
        ..
    } = &member.origin
    {
        let checkpoint = model.checkpoint.clone();
        flags.push(Flag::note(FlagReason::Outdated { checkpoint }));
    }
    if let Some(how) = member.post_process() {
        flags.push(Flag::note(FlagReason::PostProcessed { how }));
    }
    if let Some(share) = member.report.missing_rate.filter(|r| *r > 0.0) {
        flags.push(Flag::note(FlagReason::NoPrediction { share }));
    }
    flags
}

/// Reads one metric from a range.
type OfRange = fn(&RangeBin) -> Option<f64>;

fn range_tables(ground: &str, members: &[&Evaluation]) -> [Table; 2] {
    let mut bins = BTreeMap::new();
    for range in members.iter().flat_map(|m| &m.report.ranges) {
        bins.insert((range.from_m, range.to_m), range.n);
    }
    let table = |key: &str, title: &str, metric: OfRange| {
        let mut columns = vec![Column::words("run", "Run")];
        columns.extend(bins.keys().map(|(from, to)| {
            let key = format!("{key}_{from}_{to}m");
            Column::numbers(&key, &format!("{from}–{to} m"), Some(Better::Lower))
        }));
        let row = |member: &&Evaluation| {
            let bin = |(from, to): &(u32, u32)| {
                let mut ranges = member.report.ranges.iter();
                ranges.find(|r| (r.from_m, r.to_m) == (*from, *to))
            };
            let mut cells = vec![Value::from(member.name.as_str())];
            cells.extend(bins.keys().map(|e| Value::from(bin(e).and_then(metric))));
            Row {
                cells,
                ranked: true,
                ..Row::default()
            }
        };
        Table {
            title: format!("{ground}{title} by range, unscaled"),
            notes: Vec::new(),
            columns,
            rows: members.iter().map(row).collect(),
        }
    };
    let mut tables = [
        table("abs_rel", "Abs Rel", |r| r.abs_rel),
        table("rmse", "RMSE", |r| r.rmse),
    ];
    let pixels = bins
        .iter()
        .map(|((from, to), n)| format!("{from}–{to} m: {n}"));
    let pixels: Vec<_> = pixels.collect();
    let note = format!("Pooled over pixels ({}).", pixels.join(", "));
    tables[0].notes.push(note);
    tables
}

fn point_table(ground: &str, members: &[&Evaluation]) -> Option<Table> {
    let mut columns = vec![
        Column::words("run", "Run"),
        Column::words("points_n", "Points"),
        Column::words("points_seed", "Seed"),
    ];
    for (key, title) in [("points", "unscaled"), ("points_scaled", "median-scaled")] {
        columns.push(Column::numbers(
            &format!("{key}_mean_m"),
            &format!("{title}: mean, m"),
            Some(Better::Lower),
        ));
        columns.push(Column::numbers(
            &format!("{key}_std_m"),
            "std, m",
            Some(Better::Lower),
        ));
        columns.push(Column::numbers(
            &format!("{key}_sem_m"),
            "std error, m",
            None,
        ));
    }
    let row = |member: &&Evaluation| {
        let points = member.report.points.as_ref()?;
        let mut cells = vec![
            Value::from(member.name.as_str()),
            Value::Text(points.unscaled.n.to_string()),
            Value::Text(points.seed.to_string()),
        ];
        let three = |e: &PointErrors| [e.mean_m, e.std_m, e.sem_m].map(Value::from);
        cells.extend(three(&points.unscaled));
        cells.extend(three(&points.median_scaled));
        Some(Row {
            cells,
            ranked: points.in_space,
            flags: if points.in_space {
                Vec::new()
            } else {
                vec![Flag::note(FlagReason::AlongZ)]
            },
            source: None,
        })
    };
    let rows: Vec<Row> = members.iter().filter_map(row).collect();
    (!rows.is_empty()).then(|| Table {
        title: format!("{ground}Distances of drawn points"),
        notes: vec!["Rows with the same number and seed have the same points.".into()],
        columns,
        rows,
    })
}
