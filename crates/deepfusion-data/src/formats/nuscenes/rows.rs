//! Reads JSON tables (arrays of objects) one row at a time, since a table may be larger than memory.

use crate::{Error, JsonProblem, MissingPart, Result};
use memchr::memchr_iter;
use serde::Deserialize;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Number of bytes read at once.
const CHUNK: usize = 1 << 20;

/// One row (object) of a table, not parsed yet.
pub(super) struct Row<'a> {
    table: &'a Path,
    /// Line at which it begins, counted from 1.
    line: usize,
    text: &'a [u8],
}

impl<'a> Row<'a> {
    /// Parses its fields; unknown ones are ignored.
    ///
    /// # Errors
    /// [`Error::Json`] with line and field.
    pub(super) fn read<T: Deserialize<'a>>(&self) -> Result<T> {
        serde_json::from_slice(self.text).map_err(|error| {
            let lines = self.text.split(|b| *b == b'\n');
            let before = lines.take(error.line().saturating_sub(1));
            let start: usize = before.map(|line| line.len() + 1).sum();
            let end = (start + error.column()).min(self.text.len());
            Error::Json {
                path: self.table.to_owned(),
                line: self.line + error.line().saturating_sub(1),
                field: last_key(&self.text[..end]),
                problem: JsonProblem::Unread(error),
            }
        })
    }

    /// An error about one of its fields.
    pub(super) fn bad(&self, field: &str, problem: JsonProblem) -> Error {
        Error::Json {
            path: self.table.to_owned(),
            line: self.line_of(field),
            field: field.to_owned(),
            problem,
        }
    }

    /// The line of a field; the row's first line if it does not have the field.
    pub(super) fn line_of(&self, field: &str) -> usize {
        let key = format!("\"{field}\"");
        let at = memchr::memmem::find(self.text, key.as_bytes()).unwrap_or(0);
        self.line + newlines(&self.text[..at])
    }
}

/// Calls `each` with every row of the table at `path`.
///
/// # Errors
/// [`Error::Missing`], [`Error::File`]; [`Error::Json`] with the line if the file is not an array of objects, or is truncated.
pub(super) fn each_row(path: &Path, mut each: impl FnMut(&Row<'_>) -> Result<()>) -> Result<()> {
    let file = File::open(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => Error::Missing {
            path: path.to_owned(),
            part: MissingPart::NuScenesTable,
        },
        _ => Error::file(path, e),
    })?;
    let mut input = BufReader::with_capacity(CHUNK, file);
    let (mut scanner, mut text) = (RowScanner::default(), Vec::new());
    let (mut line, mut row_line) = (1, 1);
    loop {
        let chunk = input.fill_buf().map_err(|e| Error::file(path, e))?;
        if chunk.is_empty() {
            break;
        }
        let length = chunk.len();
        // Start of the current row in this chunk, and the position up to which lines are counted.
        let (mut from, mut counted) = (0, 0);
        for (i, byte) in chunk.iter().enumerate() {
            match scanner.step(*byte) {
                Step::Within => {}
                Step::Begin => {
                    line += newlines(&chunk[counted..i]);
                    (from, counted, row_line) = (i, i, line);
                }
                Step::End => {
                    text.extend_from_slice(&chunk[from..=i]);
                    each(&Row {
                        table: path,
                        line: row_line,
                        text: &text,
                    })?;
                    text.clear();
                }
                Step::Wrong => {
                    let line = line + newlines(&chunk[counted..i]);
                    let found = char::from(*byte);
                    return Err(damaged(path, line, JsonProblem::Unexpected { found }));
                }
            }
        }
        if scanner.in_row() {
            text.extend_from_slice(&chunk[from..]);
        }
        line += newlines(&chunk[counted..]);
        input.consume(length);
    }
    if scanner.state == ScanState::After {
        Ok(())
    } else {
        let line = if scanner.in_row() { row_line } else { line };
        Err(damaged(path, line, JsonProblem::Ends))
    }
}

fn damaged(path: &Path, line: usize, problem: JsonProblem) -> Error {
    Error::Json {
        path: path.to_owned(),
        line,
        field: "the array of rows".into(),
        problem,
    }
}

fn newlines(text: &[u8]) -> usize {
    memchr_iter(b'\n', text).count()
}

/// The last key in a piece of JSON.
fn last_key(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    let key = text.rsplit("\":").nth(1).and_then(|t| t.rsplit('"').next());
    key.unwrap_or("row").to_owned()
}

/// Finds where the rows of an array begin and end.
#[derive(Default)]
struct RowScanner {
    state: ScanState,
    /// Number of open braces and brackets in the row.
    depth: usize,
    in_text: bool,
    escaped: bool,
}

#[derive(Default, PartialEq)]
enum ScanState {
    #[default]
    Before,
    Between,
    Row,
    After,
}

enum Step {
    Within,
    Begin,
    End,
    Wrong,
}

impl RowScanner {
    fn in_row(&self) -> bool {
        self.state == ScanState::Row
    }

    fn step(&mut self, byte: u8) -> Step {
        if self.state == ScanState::Row {
            return self.step_in_row(byte);
        }
        match (&self.state, byte) {
            (_, b' ' | b'\t' | b'\r' | b'\n') | (ScanState::Between, b',') => Step::Within,
            (ScanState::Before, b'[') => {
                self.state = ScanState::Between;
                Step::Within
            }
            (ScanState::Between, b']') => {
                self.state = ScanState::After;
                Step::Within
            }
            (ScanState::Between, b'{') => {
                (self.state, self.depth) = (ScanState::Row, 1);
                Step::Begin
            }
            _ => Step::Wrong,
        }
    }

    fn step_in_row(&mut self, byte: u8) -> Step {
        if self.in_text {
            match byte {
                _ if self.escaped => self.escaped = false,
                b'\\' => self.escaped = true,
                b'"' => self.in_text = false,
                _ => {}
            }
            return Step::Within;
        }
        match byte {
            b'"' => self.in_text = true,
            b'{' | b'[' => self.depth += 1,
            b'}' | b']' => {
                self.depth -= 1;
                if self.depth == 0 {
                    self.state = ScanState::Between;
                    return Step::End;
                }
            }
            _ => {}
        }
        Step::Within
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[derive(Debug, Deserialize)]
    struct Named {
        name: String,
        n: f64,
    }

    fn read(text: &[u8]) -> Result<Vec<(usize, String, f64)>> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        let mut rows = Vec::new();
        each_row(file.path(), |row| {
            let read: Named = row.read()?;
            rows.push((row.line_of("n"), read.name, read.n));
            Ok(())
        })?;
        Ok(rows)
    }

    #[test]
    fn rows_are_split_at_their_ends_but_not_inside_strings() {
        let text = b"[\n{\n\"name\": \"a}]\\\"{\",\n\"more\": [{\"x\": []}],\n\"n\": 1\n},\n{\"name\": \"b\", \"n\": 2.5}\n]\n";
        let expected = [(5, "a}]\"{".to_owned(), 1.0), (7, "b".to_owned(), 2.5)];
        assert_eq!(read(text).unwrap(), expected);
        assert_eq!(read(b" [ ]").unwrap(), []);
    }

    #[test]
    fn errors_name_line_and_field() {
        let cases: [(&[u8], usize, &str, &str); 7] = [
            (
                b"[\n{\"name\": \"a\",\n\"n\": \"one\"}]",
                3,
                "n",
                "invalid type: string",
            ),
            (
                b"[\n{\"name\": \"a\",\n\"n\": 1,,\n}]",
                3,
                "n",
                "key must be a string",
            ),
            (b"[\n{\"n\": 1\n}]", 3, "n", "missing field `name`"),
            (
                b"[\n{\"name\": \"a\", \"n\": 1},\n{\"name\": \"b\",\n",
                3,
                "the array",
                "ends within",
            ),
            (
                b"[\n{\"name\": \"a\", \"n\": 1}\n",
                3,
                "the array",
                "ends within",
            ),
            (
                b"{\"name\": \"a\", \"n\": 1}",
                1,
                "the array",
                "unexpected '{'",
            ),
            (b"", 1, "the array", "ends within"),
        ];
        for (text, at, of, why) in cases {
            match read(text).unwrap_err() {
                Error::Json {
                    line,
                    field,
                    problem,
                    ..
                } => {
                    let problem = problem.to_string();
                    assert_eq!(line, at, "{field}: {problem}");
                    assert!(
                        field.starts_with(of) && problem.contains(why),
                        "{field}: {problem}"
                    );
                }
                other => panic!("{other}"),
            }
        }
    }

    /// A row that crosses the boundary between two chunks.
    #[test]
    fn rows_may_be_longer_than_a_chunk() {
        let long = "x".repeat(CHUNK + 5);
        let text = format!("[{{\"name\": \"{long}\", \"n\": 1}},\n{{\"name\": \"b\", \"n\": 2}}]");
        let rows = read(text.as_bytes()).unwrap();
        assert_eq!((rows[0].1.len(), rows[1].0, rows.len()), (long.len(), 2, 2));
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in "[\\[\\]{}\",:\\\\a1\n ]{0,60}") {
            let _ = read(text.as_bytes());
        }
    }
}
