//! Evaluations side by side on a page.

use deepfusion_eval::compare::{Rank, Table, Tables};

use super::{Cell, HtmlReport, Mark};

impl HtmlReport {
    /// Adds tables of evaluations, a section each. The best and second best of each column are marked; implausible rows carry a sign and
    /// footnotes with the reasons.
    #[must_use]
    pub fn comparison(mut self, tables: &Tables) -> Self {
        for note in &tables.notes {
            self = self.paragraph(note);
        }
        for table in &tables.tables {
            self = add_table(self, table);
        }
        self
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
        let doubtful = row.is_doubtful();
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

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_eval::compare::{Better, Column, Row, published_tables};

    /// No external resources, and every element that is opened is closed.
    fn check_page(html: &str) {
        for outside in [
            "http://", "https://", "src=\"/", "@import", "<script", "<link",
        ] {
            assert!(!html.contains(outside), "{outside}");
        }
        for element in [
            "table", "tr", "td", "th", "ol", "li", "h2", "p", "main", "body", "html",
        ] {
            let opened = html.matches(&format!("<{element}>")).count()
                + html.matches(&format!("<{element} ")).count();
            assert_eq!(
                opened,
                html.matches(&format!("</{element}>")).count(),
                "{element}"
            );
        }
    }

    #[test]
    fn the_best_two_of_a_column_are_marked() {
        let row = |abs_rel: f64| Row {
            cells: vec![Some(abs_rel).into()],
            ranked: true,
            ..Row::default()
        };
        let table = Table {
            title: "Unscaled".into(),
            columns: vec![Column::numbers("abs_rel", "Abs Rel", Some(Better::Lower))],
            rows: vec![row(0.1), row(0.02)],
            ..Table::default()
        };
        let tables = Tables {
            tables: vec![table],
            ..Tables::default()
        };
        let html = HtmlReport::new("t", "s").comparison(&tables).to_html();
        check_page(&html);
        assert!(html.contains(r#"<td class="best">0.020"#), "{html}");
        assert!(html.contains(r#"<td class="second">0.100"#), "{html}");
    }

    #[test]
    fn implausible_rows_are_marked() {
        let tables = published_tables().unwrap();
        let html = HtmlReport::new("t", "s").comparison(&tables).to_html();
        check_page(&html);
        assert!(html.contains("⚠"));
    }
}
