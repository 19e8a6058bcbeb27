use deepfusion_render::{Cell, HtmlReport, Mark};

use crate::table::{Rank, Table, Tables};

impl Tables {
    /// Adds the tables to a page, a section each.
    #[must_use]
    pub fn add_to(&self, mut page: HtmlReport) -> HtmlReport {
        for note in &self.notes {
            page = page.paragraph(note);
        }
        for table in &self.tables {
            page = add_table(page, table);
        }
        page
    }
}

fn add_table(page: HtmlReport, table: &Table) -> HtmlReport {
    let ranks = table.ranks();
    let (footnotes, numbers) = table.footnotes();
    let mut header: Vec<&str> = table.columns.iter().map(|c| c.title.as_str()).collect();
    if !footnotes.is_empty() {
        header.push("");
    }
    let mut rows = Vec::new();
    for ((row, ranks), numbers) in table.rows.iter().zip(&ranks).zip(&numbers) {
        let doubtful = Table::doubtful(row);
        let cells = row.cells.iter().zip(&table.columns).zip(ranks);
        let mut cells: Vec<Cell> = cells
            .map(|((value, column), rank)| Cell {
                text: value.print(column.decimals),
                words: column.decimals == 0,
                mark: match rank {
                    Rank::Best => Mark::Best,
                    Rank::Second => Mark::Second,
                    Rank::None if doubtful => Mark::Doubtful,
                    Rank::None => Mark::None,
                },
            })
            .collect();
        if !footnotes.is_empty() {
            let numbers: Vec<_> = numbers.iter().map(ToString::to_string).collect();
            let sign = if doubtful { "⚠ " } else { "" };
            cells.push(Cell {
                words: true,
                ..Cell::plain(format!("{sign}{}", numbers.join(", ")))
            });
        }
        rows.push(cells);
    }
    let mut page = page.section(&table.title).marked_table(&header, &rows);
    if !table.notes.is_empty() {
        page = page.note(&table.notes.join(" "));
    }
    if footnotes.is_empty() {
        page
    } else {
        page.list(&footnotes)
    }
}
