use std::fmt::Write as _;

use crate::compare::table::{Rank, Table, Tables};

/// Notes are wrapped at about this many characters.
const LINE: usize = 116;

impl Tables {
    /// For a terminal: aligned columns, `*` after the best and `+` after the second best, numbered footnotes.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut out = String::new();
        for note in &self.notes {
            wrapped(&mut out, "", note);
        }
        for table in &self.tables {
            if !out.is_empty() {
                out.push('\n');
            }
            table_text(&mut out, table);
        }
        let ranked = self.tables.iter().flat_map(Table::ranks).flatten();
        if ranked.into_iter().any(|r| r != Rank::None) {
            out.push_str("\n* best, + second best in its column, by the printed digits; impossible rows (!) are not ranked\n");
        }
        out
    }
}

fn table_text(out: &mut String, table: &Table) {
    out.push_str(&table.title);
    out.push('\n');
    for note in &table.notes {
        wrapped(out, "  ", note);
    }
    let ranks = table.ranks();
    let (footnotes, numbers) = table.footnotes();
    let header: Vec<String> = table.columns.iter().map(|c| c.title.clone()).collect();
    let mut lines = vec![header];
    let mut tails = vec![String::new()];
    for ((row, ranks), numbers) in table.rows.iter().zip(&ranks).zip(&numbers) {
        let cells = row.cells.iter().zip(&table.columns).zip(ranks);
        let line = cells.map(|((value, column), rank)| {
            let mark = match rank {
                Rank::Best => "*",
                Rank::Second => "+",
                Rank::None if column.better.is_some() => " ",
                Rank::None => "",
            };
            format!("{}{mark}", value.print(column.decimals))
        });
        lines.push(line.collect());
        let numbers: String = numbers.iter().map(|n| format!("[{n}]")).collect();
        let sign = if row.is_doubtful() { "! " } else { "" };
        tails.push(format!("{sign}{numbers}"));
    }
    let width = |c: usize| {
        let cells = lines.iter().filter_map(|l| l.get(c));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..table.columns.len()).map(width).collect();
    for (i, (line, tail)) in lines.iter().zip(&tails).enumerate() {
        let mut text = String::from(" ");
        for ((cell, width), column) in line.iter().zip(&widths).zip(&table.columns) {
            // A heading ends above the last digit, not above the mark.
            let cell = if i == 0 && column.better.is_some() {
                format!("{cell} ")
            } else {
                cell.clone()
            };
            let width = width + usize::from(column.better.is_some());
            let gap = width.saturating_sub(cell.chars().count());
            if column.better.is_some() {
                // Writing to a String cannot fail, here and below.
                let _ = write!(text, " {}{cell}", " ".repeat(gap));
            } else {
                let _ = write!(text, " {cell}{} ", " ".repeat(gap));
            }
        }
        let _ = write!(text, " {tail}");
        out.push_str(text.trim_end());
        out.push('\n');
    }
    for (i, footnote) in footnotes.iter().enumerate() {
        wrapped(out, "  ", &format!("[{}] {footnote}", i + 1));
    }
}

/// Appends text, wrapped at [`LINE`] characters.
fn wrapped(out: &mut String, indent: &str, text: &str) {
    let mut line = String::from(indent);
    for word in text.split_whitespace() {
        if line.chars().count() + word.chars().count() > LINE && line.trim() != "" {
            out.push_str(line.trim_end());
            out.push('\n');
            line = format!("{indent}  ");
        }
        line.push_str(word);
        line.push(' ');
    }
    out.push_str(line.trim_end());
    out.push('\n');
}
