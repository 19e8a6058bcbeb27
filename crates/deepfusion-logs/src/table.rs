//! Tables of text as apps write them: any delimiter, quotes, a byte order mark, an extra delimiter at each line's end, the header
//! again where the app was restarted.

use crate::columns::Column;
use crate::error::{BadLine, ColumnProblem, Error, Result};
use crate::numbers::{Cell, cell};
use crate::problem::{LineField, TableProblem};
use std::path::{Path, PathBuf};

/// A table's header and rows.
pub(crate) struct Table {
    pub(crate) path: PathBuf,
    pub(crate) columns: Vec<Column>,
    rows: Vec<Row>,
    decimal_comma: bool,
    /// Number of headers among the rows.
    pub(crate) repeated_headers: usize,
}

struct Row {
    line: u64,
    words: csv::StringRecord,
}

impl Table {
    /// Splits a text; `path` is for errors, `first_line` is the number of its first line in the file.
    ///
    /// # Errors
    /// [`Error::Line`] if a row has another number of values than the header.
    pub(crate) fn parse(path: &Path, text: &str, first_line: u64) -> Result<Self> {
        let text = text.trim_start_matches('\u{feff}');
        let header = text.lines().next().unwrap_or("");
        let delimiter = [b';', b'\t', b',']
            .into_iter()
            .max_by_key(|d| header.bytes().filter(|b| b == d).count())
            .unwrap_or(b',');
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .trim(csv::Trim::All)
            .flexible(true)
            .from_reader(text.as_bytes());
        let refused = |error: csv::Error| {
            let line = error.position().map_or(1, csv::Position::line) + first_line - 1;
            BadLine::new(line, LineField::Line, TableProblem::from(error)).of(path)
        };
        let header = reader.headers().map_err(refused)?.clone();
        let named = (0..header.len())
            .rfind(|i| !header[*i].is_empty())
            .map_or(0, |i| i + 1);
        let columns = header.iter().take(named).enumerate();
        let mut table = Self {
            path: path.to_owned(),
            columns: columns.map(|(i, h)| Column::parse(i, h)).collect(),
            rows: Vec::new(),
            decimal_comma: delimiter != b',',
            repeated_headers: 0,
        };
        let mut words = csv::StringRecord::new();
        while reader.read_record(&mut words).map_err(refused)? {
            // A record's position is before the empty lines above it.
            let place = words
                .position()
                .map_or((0, 1), |at| (at.byte() as usize, at.line()));
            let from = text.as_bytes().get(place.0..).unwrap_or(&[]);
            let empty = from.iter().take_while(|b| b"\r\n".contains(b));
            let line = place.1 + empty.filter(|b| **b == b'\n').count() as u64 + first_line - 1;
            if words.iter().eq(header.iter()) {
                table.repeated_headers += 1;
                continue;
            }
            let surplus = words.iter().skip(named).any(|w| !w.is_empty());
            if words.len() < named || surplus {
                let values = words.len();
                let problem = TableProblem::Values { values, named };
                return Err(BadLine::new(line, LineField::Line, problem).of(path));
            }
            table.rows.push(Row {
                line,
                words: words.clone(),
            });
        }
        Ok(table)
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// The text of a cell.
    pub(crate) fn word(&self, row: usize, column: &Column) -> &str {
        self.rows
            .get(row)
            .and_then(|r| r.words.get(column.index))
            .unwrap_or("")
    }

    /// The number in a cell; `None` if nothing was measured.
    ///
    /// # Errors
    /// [`Error::Line`] for anything else.
    pub(crate) fn number(&self, row: usize, column: &Column) -> Result<Option<f64>> {
        let word = self.word(row, column);
        match cell(word, self.decimal_comma) {
            Cell::Absent => Ok(None),
            Cell::Number(value) => Ok(Some(value)),
            Cell::Other => {
                let text = short(word);
                Err(self.bad(row, column, TableProblem::NotANumber { text }))
            }
        }
    }

    /// A cell's text with a decimal point instead of a decimal comma.
    pub(crate) fn plain_word(&self, row: usize, column: &Column) -> String {
        let word = self.word(row, column).trim_matches('"').trim();
        let is_number = |b: u8| b.is_ascii_digit() || b"+-.,".contains(&b);
        if self.decimal_comma && word.contains(',') && word.bytes().all(is_number) {
            word.replace('.', "").replacen(',', ".", 1)
        } else {
            word.to_owned()
        }
    }

    /// An error about a cell.
    pub(crate) fn bad(&self, row: usize, column: &Column, problem: TableProblem) -> Error {
        let field = LineField::Column(column.header.clone());
        BadLine::new(self.line(row), field, problem).of(&self.path)
    }

    /// An error about the choice of columns.
    pub(crate) fn lacks(&self, problem: ColumnProblem) -> Error {
        Error::Column {
            path: self.path.clone(),
            problem,
            columns: self.columns.iter().map(|c| c.header.clone()).collect(),
        }
    }

    /// The line of a row, counted from 1.
    pub(crate) fn line(&self, row: usize) -> u64 {
        self.rows.get(row).map_or(0, |r| r.line)
    }

    /// The first column with one of these names, tried in this order.
    pub(crate) fn named(&self, names: &[&str]) -> Option<&Column> {
        let find = |name: &&str| self.columns.iter().find(|c| c.name == **name);
        names.iter().find_map(find)
    }

    /// A column by the name that a user gives: the whole header, or the name without its unit.
    ///
    /// # Errors
    /// [`ColumnProblem::Missing`].
    pub(crate) fn asked_for(&self, name: &str) -> Result<&Column> {
        let wanted = name.trim().to_lowercase();
        let found = self
            .columns
            .iter()
            .find(|c| c.header.trim().to_lowercase() == wanted)
            .or_else(|| self.columns.iter().find(|c| c.name == wanted));
        found.ok_or_else(|| self.lacks(ColumnProblem::Missing(name.to_owned())))
    }
}

/// The text, shortened to fit on a line.
pub(crate) fn short(word: &str) -> String {
    word.chars().take(40).collect()
}
