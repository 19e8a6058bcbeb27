use super::plausibility::{Flag, Severity};

/// Which values of a column are better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Better {
    /// Lower is better: errors.
    Lower,
    /// Higher is better: accuracies.
    Higher,
    /// Nearer to 1 by ratio is better: scales.
    NearOne,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its name in CSV, such as `abs_rel`.
    pub key: String,
    /// Its heading, such as "Abs Rel".
    pub title: String,
    /// Which values are better; `None` for columns that are not ranked.
    pub better: Option<Better>,
    /// Digits after the decimal point.
    pub decimals: usize,
}

impl Column {
    /// A column of text.
    #[must_use]
    pub fn words(key: &str, title: &str) -> Self {
        Self {
            key: key.to_owned(),
            title: title.to_owned(),
            better: None,
            decimals: 0,
        }
    }

    /// A column of numbers with three digits after the decimal point.
    #[must_use]
    pub fn numbers(key: &str, title: &str, better: Option<Better>) -> Self {
        Self {
            better,
            decimals: 3,
            ..Self::words(key, title)
        }
    }

    /// The columns of the seven metrics.
    #[must_use]
    pub fn metrics() -> Vec<Self> {
        const TITLES: [&str; 7] = [
            "Abs Rel",
            "Sq Rel",
            "RMSE",
            "RMSE log",
            "δ<1.25",
            "δ<1.25²",
            "δ<1.25³",
        ];
        let names = crate::Metrics::NAMES.iter().zip(TITLES);
        names
            .enumerate()
            .map(|(i, (key, title))| {
                let better = if i < 4 { Better::Lower } else { Better::Higher };
                Self::numbers(key, title, Some(better))
            })
            .collect()
    }
}

/// The content of a cell.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Value {
    /// Empty: not measured or not published.
    #[default]
    Missing,
    /// Text.
    Text(String),
    /// A number.
    Number(f64),
}

impl Value {
    /// The number, if the cell contains one.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(value) if value.is_finite() => Some(*value),
            _ => None,
        }
    }

    /// The cell's text with this many digits after the decimal point.
    #[must_use]
    pub fn print(&self, decimals: usize) -> String {
        match self {
            Self::Missing => "–".to_owned(),
            Self::Text(text) => text.clone(),
            Self::Number(value) if value.is_finite() => format!("{value:.decimals$}"),
            Self::Number(value) => value.to_string(),
        }
    }
}

impl From<Option<f64>> for Value {
    fn from(value: Option<f64>) -> Self {
        value.map_or(Self::Missing, Self::Number)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

/// A row of a table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Row {
    /// One cell per column.
    pub cells: Vec<Value>,
    /// What is wrong with the row, and notes on it.
    pub flags: Vec<Flag>,
    /// Whether the row is ranked; the mean-depth baseline is not.
    pub ranked: bool,
    /// The source of the figures.
    pub source: Option<String>,
}

impl Row {
    /// Whether a reader must be warned about the row.
    #[must_use]
    pub fn is_doubtful(&self) -> bool {
        self.flags.iter().any(|f| f.severity != Severity::Note)
    }

    /// Whether the row takes part in the ranking: rows that cannot be right do not.
    fn competes(&self) -> bool {
        self.ranked
            && self
                .flags
                .iter()
                .all(|f| f.severity != Severity::Impossible)
    }
}

/// Rank of a cell among the ranked cells of its column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Rank {
    /// Neither best nor second best.
    #[default]
    None,
    /// The best, or equal to the best by the printed digits.
    Best,
    /// The best of the remaining cells.
    Second,
}

/// A table of rows that may be compared with each other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Its title.
    pub title: String,
    /// What was measured and how: sentences printed below the title.
    pub notes: Vec<String>,
    /// Its columns.
    pub columns: Vec<Column>,
    /// Its rows.
    pub rows: Vec<Row>,
}

impl Table {
    /// The rank of every cell, by the printed digits. Nothing is ranked if fewer than two rows compete, or if all are equal.
    #[must_use]
    pub fn ranks(&self) -> Vec<Vec<Rank>> {
        let mut ranks = vec![vec![Rank::None; self.columns.len()]; self.rows.len()];
        for (c, column) in self.columns.iter().enumerate() {
            let Some(better) = column.better else {
                continue;
            };
            let cost = |row: &Row| {
                let printed = row.cells.get(c)?.number().filter(|_| row.competes())?;
                let scale = 10f64.powi(column.decimals as i32);
                let value = (printed * scale).round() / scale;
                Some(match better {
                    Better::Lower => value,
                    Better::Higher => -value,
                    Better::NearOne => value.ln().abs(),
                })
            };
            let costs: Vec<Option<f64>> = self.rows.iter().map(cost).collect();
            let mut levels: Vec<f64> = costs.iter().flatten().copied().collect();
            levels.sort_unstable_by(f64::total_cmp);
            levels.dedup();
            if levels.len() < 2 {
                continue;
            }
            for (rank, cost) in ranks.iter_mut().zip(costs) {
                rank[c] = match cost {
                    Some(cost) if cost == levels[0] => Rank::Best,
                    Some(cost) if cost == levels[1] => Rank::Second,
                    _ => Rank::None,
                };
            }
        }
        ranks
    }

    /// The distinct flags and sources of the rows, numbered from 1 in order of appearance; and for each row the numbers of its notes.
    #[must_use]
    pub fn footnotes(&self) -> (Vec<String>, Vec<Vec<usize>>) {
        let mut notes: Vec<String> = Vec::new();
        let mut number = |text: String| match notes.iter().position(|n| *n == text) {
            Some(place) => place + 1,
            None => {
                notes.push(text);
                notes.len()
            }
        };
        let of_row = |row: &Row| {
            let flags = row.flags.iter();
            let texts = flags.map(|f| format!("{}: {}", f.severity.word(), f.why));
            let source = row.source.iter().map(|s| format!("from {s}"));
            texts.chain(source).map(&mut number).collect()
        };
        let numbers = self.rows.iter().map(of_row).collect();
        (notes, numbers)
    }
}

/// Tables that are kept apart on purpose.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tables {
    /// Notes on all tables.
    pub notes: Vec<String>,
    /// The tables.
    pub tables: Vec<Table>,
}

impl Tables {
    /// These tables, followed by the others.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.notes.extend(other.notes);
        self.tables.extend(other.tables);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::super::plausibility::FlagReason;
    use super::*;

    fn table(values: &[(f64, bool)]) -> Table {
        Table {
            columns: vec![Column::numbers("abs_rel", "Abs Rel", Some(Better::Lower))],
            rows: values
                .iter()
                .map(|(value, ranked)| Row {
                    cells: vec![Value::Number(*value)],
                    ranked: *ranked,
                    ..Row::default()
                })
                .collect(),
            ..Table::default()
        }
    }

    fn column(table: &Table) -> Vec<Rank> {
        table.ranks().iter().map(|r| r[0]).collect()
    }

    #[test]
    fn ranks_follow_the_printed_digits() {
        use Rank::{Best, None, Second};
        let ranks = column(&table(&[
            (0.1004, true),
            (0.0996, true),
            (0.2, true),
            (0.3, true),
        ]));
        assert_eq!(ranks, [Best, Best, Second, None]);
        // The mean-depth baseline is not ranked, and a single row has no competitor.
        assert_eq!(column(&table(&[(0.3, true), (0.1, false)])), [None, None]);
        assert_eq!(column(&table(&[(0.1, true), (0.1, true)])), [None, None]);
        assert_eq!(
            column(&table(&[(f64::NAN, true), (0.1, true)])),
            [None, None]
        );
    }

    #[test]
    fn impossible_rows_are_not_ranked() {
        let mut doubtful = table(&[(0.05, true), (0.1, true), (0.2, true)]);
        doubtful.rows[0].flags.push(Flag {
            severity: Severity::Impossible,
            why: FlagReason::AlongZ,
        });
        assert_eq!(column(&doubtful), [Rank::None, Rank::Best, Rank::Second]);
        doubtful.rows[0].flags[0].severity = Severity::Implausible;
        assert_eq!(column(&doubtful)[0], Rank::Best);
    }

    #[test]
    fn scales_are_better_the_nearer_to_one() {
        let mut scales = table(&[(0.9, true), (1.05, true), (2.0, true)]);
        scales.columns[0].better = Some(Better::NearOne);
        assert_eq!(column(&scales), [Rank::Second, Rank::Best, Rank::None]);
    }

    #[test]
    fn equal_footnotes_share_a_number() {
        let mut table = table(&[(0.1, true), (0.2, true)]);
        for row in &mut table.rows {
            row.source = Some("a paper".into());
        }
        table.rows[1]
            .flags
            .push(Flag::note(FlagReason::Published("x".into())));
        let (notes, numbers) = table.footnotes();
        assert_eq!(notes, ["from a paper", "note: x"]);
        assert_eq!(numbers, [vec![1], vec![2, 1]]);
    }
}
