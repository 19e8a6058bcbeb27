//! A report as a single HTML file that works offline: styles, pictures and charts are inside.

mod comparison;
mod frames;
mod page;
mod sections;
mod tables;
mod verdict;

pub use frames::ShownFrame;
pub use page::{HtmlReport, PictureFormat};
pub use sections::ReliabilityBin;
pub use tables::{Cell, Mark};

/// Text as HTML text or attribute value.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}
