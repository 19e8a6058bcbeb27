use std::sync::LazyLock;

use serde::Deserialize;

use super::plausibility::{Flag, FlagReason, Seven, THREE_DECIMALS, check, identical};
use super::table::{Column, Row, Table, Tables, Value};
use super::{Error, PublishedProblem, Result};

/// Largest depth in KITTI's protocols, in metres.
const CAP_M: f64 = 80.0;

/// The published figures as read from `data/published.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    source: Vec<Source>,
    group: Vec<Group>,
    left_out: Vec<LeftOut>,
    row: Vec<PublishedRow>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Source {
    id: String,
    text: String,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Group {
    id: String,
    title: String,
    note: String,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct LeftOut {
    method: String,
    why: String,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct PublishedRow {
    group: String,
    method: String,
    source: String,
    place: Option<String>,
    supervision: String,
    size: Option<String>,
    scaling: String,
    abs_rel: Option<f64>,
    sq_rel: Option<f64>,
    rmse: Option<f64>,
    rmse_log: Option<f64>,
    a1: Option<f64>,
    a2: Option<f64>,
    a3: Option<f64>,
    also: Option<String>,
    note: Option<String>,
}

impl PublishedRow {
    fn seven(&self) -> Seven {
        [
            self.abs_rel,
            self.sq_rel,
            self.rmse,
            self.rmse_log,
            self.a1,
            self.a2,
            self.a3,
        ]
    }
}

impl Published {
    /// Reads a table of published figures.
    ///
    /// # Errors
    /// [`Error::Published`], naming the line, or the row whose source or group does not exist.
    pub fn parse(text: &str) -> Result<Self> {
        Self::read(text).map_err(Error::Published)
    }

    fn read(text: &str) -> std::result::Result<Self, PublishedProblem> {
        let read = toml::from_str(text);
        let published: Self = read.map_err(|e| PublishedProblem::NotOne(Box::new(e)))?;
        for row in &published.row {
            let known = published.source.iter().any(|s| s.id == row.source)
                && published.group.iter().any(|g| g.id == row.group);
            if !known {
                return Err(PublishedProblem::Reference {
                    method: row.method.clone(),
                });
            }
        }
        Ok(published)
    }

    /// One table per group, with its rows checked.
    #[must_use]
    pub fn tables(&self) -> Tables {
        let left_out = self
            .left_out
            .iter()
            .map(|l| format!("{} ({})", l.method, l.why));
        let left_out: Vec<_> = left_out.collect();
        Tables {
            notes: vec![
                "Published rows are quoted, not measured here. M: monocular video, S: stereo, MS: both, M+v: video and the \
                 vehicle's velocity, D: depth labels."
                    .into(),
                format!("Left out: {}.", left_out.join("; ")),
            ],
            tables: self.group.iter().map(|g| self.table(g)).collect(),
        }
    }

    fn table(&self, group: &Group) -> Table {
        let rows: Vec<&PublishedRow> = self.row.iter().filter(|r| r.group == group.id).collect();
        let figures: Vec<(&str, Seven)> = rows
            .iter()
            .map(|r| (r.method.as_str(), r.seven()))
            .collect();
        let mut columns = vec![
            Column::words("method", "Method"),
            Column::words("supervision", "Train"),
            Column::words("size", "Size"),
            Column::words("scaling", "Scaling"),
        ];
        columns.extend(Column::metrics());
        let twins = identical(&figures);
        let kind = commonest(&rows);
        let mut notes = vec![group.note.clone()];
        if let Some((supervision, scaling)) = kind {
            notes.push(format!(
                "Best and second best are marked only among rows of one kind: trained with {supervision}, scaling {scaling}."
            ));
        }
        let ranked = |r: &PublishedRow| kind == Some((r.supervision.as_str(), r.scaling.as_str()));
        Table {
            title: format!("Published: {}", group.title),
            notes,
            columns,
            rows: rows
                .iter()
                .zip(twins)
                .map(|(r, twin)| Row {
                    ranked: ranked(r),
                    ..self.row(r, twin)
                })
                .collect(),
        }
    }

    fn row(&self, row: &PublishedRow, twin: Option<Flag>) -> Row {
        let figures = row.seven();
        let mut flags = check(&figures, THREE_DECIMALS, CAP_M);
        flags.extend(twin);
        let note = row.note.clone().map(FlagReason::Published);
        flags.extend(note.map(Flag::note));
        let source = self.source.iter().find(|s| s.id == row.source);
        let place = row
            .place
            .as_deref()
            .map(|p| format!("; {p}"))
            .unwrap_or_default();
        let also = row
            .also
            .as_deref()
            .map(|a| format!("; agrees with {a}"))
            .unwrap_or_default();
        let mut cells = vec![
            Value::from(row.method.as_str()),
            Value::from(row.supervision.as_str()),
            row.size.as_deref().map_or(Value::Missing, Value::from),
            Value::from(row.scaling.as_str()),
        ];
        cells.extend(figures.map(Value::from));
        Row {
            cells,
            flags,
            ranked: false,
            source: source.map(|s| format!("{}{place}{also}", s.text)),
        }
    }
}

/// The training data and scaling that most rows share, if at least two do: only those rows can be ranked. Rows whose scaling is not stated
/// cannot be compared.
fn commonest<'a>(rows: &[&'a PublishedRow]) -> Option<(&'a str, &'a str)> {
    let kind = |r: &&'a PublishedRow| (r.supervision.as_str(), r.scaling.as_str());
    let count = |wanted: (&str, &str)| rows.iter().filter(|r| kind(r) == wanted).count();
    let stated = rows.iter().filter(|r| r.scaling != "not stated").map(kind);
    let kinds = stated.map(|kind| (count(kind), kind));
    // Among equals, the first in the table's order.
    let most = kinds.fold(None, |most: Option<(usize, _)>, next| match most {
        Some(most) if most.0 >= next.0 => Some(most),
        _ => Some(next),
    });
    most.filter(|(count, _)| *count > 1).map(|(_, kind)| kind)
}

/// The published tables that are embedded in the program.
///
/// # Errors
/// [`Error::Published`]; a test checks that it does not occur.
pub fn published_tables() -> Result<Tables> {
    static PUBLISHED: LazyLock<std::result::Result<Published, PublishedProblem>> =
        LazyLock::new(|| Published::read(include_str!("../../data/published.toml")));
    match &*PUBLISHED {
        Ok(published) => Ok(published.tables()),
        Err(problem) => Err(Error::Published(problem.clone())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::plausibility::Severity;

    fn flagged(severity: Severity) -> Vec<String> {
        let tables = published_tables().unwrap().tables;
        let rows = tables
            .iter()
            .flat_map(|t| t.rows.iter().map(move |r| (t, r)));
        rows.filter(|(_, r)| r.flags.iter().any(|f| f.severity == severity))
            .map(|(t, r)| format!("{} | {}", t.title, r.cells[0].print(0)))
            .collect()
    }

    #[test]
    fn only_rows_of_the_deepfusion_paper_are_flagged() {
        assert_eq!(
            flagged(Severity::Impossible),
            ["Published: KITTI Eigen, ground truth as recorded, 1024×320 and larger | DeepFusion"]
        );
        let no_imagenet = "Published: KITTI Eigen, ground truth as recorded, 640×192, without ImageNet pre-training";
        let ablation = "Published: The DeepFusion paper's ablation (its Table 3)";
        assert_eq!(
            flagged(Severity::Implausible),
            [
                format!("{no_imagenet} | DeepFusion"),
                format!("{ablation} | DeepFusion, row 1"),
                format!("{ablation} | DeepFusion, row 4"),
            ]
        );
    }

    #[test]
    fn every_row_has_a_source() {
        let tables = published_tables().unwrap();
        for table in &tables.tables {
            assert!(!table.rows.is_empty(), "{}", table.title);
            for row in &table.rows {
                assert!(row.source.is_some() && row.cells.len() == table.columns.len());
                assert!(row.cells[4..].iter().any(|c| c.number().is_some()));
            }
        }
    }

    #[test]
    fn invalid_tables_are_errors() {
        let error = Published::parse("[[source]]\nid = 1\n")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("published.toml") && error.contains("id"),
            "{error}"
        );
        let text = include_str!("../../data/published.toml")
            .replace("source = \"monovit\"", "source = \"no\"");
        let error = Published::parse(&text).unwrap_err().to_string();
        assert!(error.contains("`MonoViT` names a source"), "{error}");
    }
}
