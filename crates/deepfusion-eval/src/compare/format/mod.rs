//! The forms in which tables are printed. HTML is `deepfusion-render`'s: `HtmlReport::comparison`.

mod csv;
mod latex;
mod text;
