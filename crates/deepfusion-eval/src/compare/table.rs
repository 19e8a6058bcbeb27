use super::plausibility::{Flag, Severity};

/// Which end of a column is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Better {
    /// Errors.
    Lower,
    /// Accuracies.
    Higher,
    /// Nearer to 1 by ratio: scales.
    NearOne,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its name in CSV: `abs_rel`.
    pub key: String,
    /// Its heading: "Abs Rel".
    pub title: String,
    /// Which end is better; `None` for columns that are not ranked.
    pub better: Option<Better>,
    /// Digits after the point.
    pub decimals: usize,
}

impl Column {
    /// A column of words.
    #[must_use]
    pub fn words(key: &str, title: &str) -> Self {
        Self {
            key: key.to_owned(),
            title: title.to_owned(),
            better: None,
            decimals: 0,
        }
    }

    /// A column of numbers with three digits after the point.
    #[must_use]
    pub fn numbers(key: &str, title: &str, better: Option<Better>) -> Self {
        Self {
            better,
            decimals: 3,
            ..Self::words(key, title)
        }
    }

    /// The seven metrics.
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

/// What a cell holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Value {
    /// Nothing: not measured, not published.
    #[default]
    Missing,
    /// Words.
    Text(String),
    /// A number.
    Number(f64),
}

impl Value {
    /// The number, if it is one.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(value) if value.is_finite() => Some(*value),
            _ => None,
        }
    }

    /// As it is printed.
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
    /// A cell for each column.
    pub cells: Vec<Value>,
    /// What is wrong with it.
    pub flags: Vec<Flag>,
    /// Whether it may be the best: not so the mean-depth baseline.
    pub ranked: bool,
    /// Where the figures are from.
    pub source: Option<String>,
}

impl Row {
    /// Whether a reader must be warned of it.
    #[must_use]
    pub fn is_doubtful(&self) -> bool {
        self.flags.iter().any(|f| f.severity != Severity::Note)
    }

    /// Whether it takes part in the ranking: rows that cannot be right do not.
    fn competes(&self) -> bool {
        self.ranked
            && self
                .flags
                .iter()
                .all(|f| f.severity != Severity::Impossible)
    }
}

/// Rank of a cell among the cells of its column that compete.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Rank {
    /// Neither.
    #[default]
    None,
    /// The best, or as good as the best to the printed digits.
    Best,
    /// The best of the others.
    Second,
}

/// Rows that may be compared with each other.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// What it shows.
    pub title: String,
    /// What was measured, and how: sentences below it.
    pub notes: Vec<String>,
    /// Its columns.
    pub columns: Vec<Column>,
    /// Its rows.
    pub rows: Vec<Row>,
}

impl Table {
    /// The rank of every cell, by the digits that are printed. Nothing is ranked below two competing rows, nor where all are
    /// equal.
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

    /// The different flags of its rows and where the figures are from, numbered from 1 in the order in which they come; and
    /// for each row the numbers of its flags.
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

/// Tables that are told apart on purpose.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tables {
    /// What holds for all.
    pub notes: Vec<String>,
    /// The tables.
    pub tables: Vec<Table>,
}

impl Tables {
    /// These tables, then those.
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
    fn the_best_is_what_is_printed_as_the_best() {
        use Rank::{Best, None, Second};
        let ranks = column(&table(&[
            (0.1004, true),
            (0.0996, true),
            (0.2, true),
            (0.3, true),
        ]));
        assert_eq!(ranks, [Best, Best, Second, None]);
        // The mean-depth baseline does not compete, a single row has nothing to beat.
        assert_eq!(column(&table(&[(0.3, true), (0.1, false)])), [None, None]);
        assert_eq!(column(&table(&[(0.1, true), (0.1, true)])), [None, None]);
        assert_eq!(
            column(&table(&[(f64::NAN, true), (0.1, true)])),
            [None, None]
        );
    }

    #[test]
    fn what_cannot_be_right_cannot_be_best() {
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
    fn equal_footnotes_have_one_number() {
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
