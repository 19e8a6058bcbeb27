//! The output formats of tables. HTML is in `deepfusion-render`: `HtmlReport::comparison`.

mod csv;
mod latex;
mod text;
