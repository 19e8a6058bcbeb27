use std::fmt::Write as _;

use crate::compare::table::{Rank, Table, Tables, Value};

impl Tables {
    /// For a paper: one `table` each in the style of booktabs (`\usepackage{booktabs}`), the best in bold, the second best underlined,
    /// footnotes numbered by letters.
    #[must_use]
    pub fn to_latex(&self) -> String {
        let mut out = String::from("% needs \\usepackage{booktabs}\n");
        for note in &self.notes {
            // Writing to a String cannot fail, here and below.
            let _ = writeln!(out, "% {}", note.replace('\n', " "));
        }
        for table in &self.tables {
            table_latex(&mut out, table);
        }
        out
    }
}

fn table_latex(out: &mut String, table: &Table) {
    let ranks = table.ranks();
    let (footnotes, numbers) = table.footnotes();
    let layout: String = table
        .columns
        .iter()
        .map(|c| if c.better.is_some() { 'r' } else { 'l' })
        .collect();
    let _ = write!(
        out,
        "\n\\begin{{table}}\n\\centering\n\\small\n\\caption{{{}}}\n\\begin{{tabular}}{{{layout}}}\n\\toprule\n",
        escaped(&table.title)
    );
    let header: Vec<String> = table.columns.iter().map(|c| escaped(&c.title)).collect();
    let _ = writeln!(out, "{} \\\\\n\\midrule", header.join(" & "));
    for ((row, ranks), numbers) in table.rows.iter().zip(&ranks).zip(&numbers) {
        let cells = row.cells.iter().zip(&table.columns).zip(ranks);
        let mut cells: Vec<String> = cells
            .map(|((value, column), rank)| {
                let text = match value {
                    Value::Missing => "--".to_owned(),
                    value => escaped(&value.print(column.decimals)),
                };
                match rank {
                    Rank::Best => format!("\\textbf{{{text}}}"),
                    Rank::Second => format!("\\underline{{{text}}}"),
                    Rank::None => text,
                }
            })
            .collect();
        let letters: Vec<String> = numbers.iter().map(|n| letter(*n)).collect();
        if let Some(first) = cells.first_mut()
            && !letters.is_empty()
        {
            let _ = write!(first, "$^{{\\mathrm{{{}}}}}$", letters.join(","));
        }
        let _ = writeln!(out, "{} \\\\", cells.join(" & "));
    }
    out.push_str("\\bottomrule\n\\end{tabular}\n");
    let notes = table.notes.iter().map(|n| escaped(n));
    let marked = footnotes.iter().enumerate();
    let marked =
        marked.map(|(i, n)| format!("$^{{\\mathrm{{{}}}}}$ {}", letter(i + 1), escaped(n)));
    let below: Vec<String> = notes.chain(marked).collect();
    if !below.is_empty() {
        let _ = writeln!(
            out,
            "\n\\smallskip\n\\footnotesize\n{}",
            below.join(" \\\\\n")
        );
    }
    out.push_str("\\end{table}\n");
}

/// 1 is a, 26 is z, 27 is aa, and so on.
fn letter(mut number: usize) -> String {
    let mut letters = Vec::new();
    while number > 0 {
        letters.push(char::from(b'a' + ((number - 1) % 26) as u8));
        number = (number - 1) / 26;
    }
    letters.iter().rev().collect()
}

/// Escapes text so that LaTeX prints it literally, in text mode.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                out.push('\\');
                out.push(c);
            }
            '~' => out.push_str("\\textasciitilde{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            '\\' => out.push_str("\\textbackslash{}"),
            '<' => out.push_str("$<$"),
            '>' => out.push_str("$>$"),
            'δ' => out.push_str("$\\delta$"),
            '×' => out.push_str("$\\times$"),
            '²' => out.push_str("$^2$"),
            '³' => out.push_str("$^3$"),
            '₁' => out.push_str("$_1$"),
            '₂' => out.push_str("$_2$"),
            '₃' => out.push_str("$_3$"),
            '√' => out.push_str("$\\surd$"),
            '–' => out.push_str("--"),
            '…' => out.push_str("\\dots{}"),
            '±' => out.push_str("$\\pm$"),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_continue_after_z() {
        assert_eq!([1, 26, 27, 53].map(letter), ["a", "z", "aa", "ba"]);
    }

    #[test]
    fn latex_special_characters_are_escaped() {
        assert_eq!(
            escaped("a_b & 50 % δ<1.25²"),
            "a\\_b \\& 50 \\% $\\delta$$<$1.25$^2$"
        );
        assert_eq!(escaped("\\input{x}"), "\\textbackslash{}input\\{x\\}");
    }
}
