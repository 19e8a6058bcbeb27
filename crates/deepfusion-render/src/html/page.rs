use std::fmt::Write as _;
use std::io::Cursor;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;

use super::tables::Cell;
use super::{escape, tables};
use crate::{Result, Svg, Tile};

/// How a picture is stored in a report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PictureFormat {
    /// Small, for photographs and renderings.
    #[default]
    Jpeg,
    /// Exact, for pictures with text and sharp edges.
    Png,
}

/// Builds a report, part by part, in reading order.
///
/// ```
/// use deepfusion_render::HtmlReport;
/// let html = HtmlReport::new("Demo", "Metric depth from one camera")
///     .facts(&[("Abs Rel", "0.112"), ("scale", "1.01")])
///     .section("How it was made")
///     .paragraph("Trained on a simulated street.")
///     .command("deepfusion demo")
///     .to_html();
/// assert!(html.starts_with("<!doctype html>") && html.contains("0.112"));
/// ```
#[derive(Debug, Clone)]
pub struct HtmlReport {
    title: String,
    subtitle: String,
    body: String,
    sections: Vec<String>,
    wide: bool,
}

/// A page with more sections than this has a table of contents.
const SECTIONS_WITHOUT_CONTENTS: usize = 3;

impl HtmlReport {
    /// An empty report.
    #[must_use]
    pub fn new(title: impl Into<String>, subtitle: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            subtitle: subtitle.into(),
            body: String::new(),
            sections: Vec::new(),
            wide: false,
        }
    }

    /// Makes the page as wide as the window, up to 1,400 units, for wide tables.
    #[must_use]
    pub fn wide(mut self) -> Self {
        self.wide = true;
        self
    }

    /// Adds the key figures in large type: name and value.
    #[must_use]
    pub fn facts(mut self, facts: &[(&str, &str)]) -> Self {
        self.body.push_str(r#"<div class="facts">"#);
        for (name, value) in facts {
            // Writing to a String cannot fail, here and below.
            let _ = write!(
                self.body,
                r#"<div class="fact"><div class="value">{}</div><div class="name">{}</div></div>"#,
                escape(value),
                escape(name)
            );
        }
        self.body.push_str("</div>");
        self
    }

    /// Begins a section.
    #[must_use]
    pub fn section(mut self, title: &str) -> Self {
        self.sections.push(title.to_owned());
        let number = self.sections.len();
        let _ = write!(self.body, r#"<h2 id="s{number}">{}</h2>"#, escape(title));
        self
    }

    /// A heading inside a section.
    #[must_use]
    pub fn heading(mut self, title: &str) -> Self {
        let _ = write!(self.body, "<h3>{}</h3>", escape(title));
        self
    }

    /// Adds a note in small print.
    #[must_use]
    pub fn note(mut self, text: &str) -> Self {
        let _ = write!(self.body, r#"<p class="note">{}</p>"#, escape(text));
        self
    }

    /// Adds notes in small print, numbered from 1.
    #[must_use]
    pub fn list(mut self, items: &[String]) -> Self {
        self.body.push_str(r#"<ol class="note">"#);
        for item in items {
            let _ = write!(self.body, "<li>{}</li>", escape(item));
        }
        self.body.push_str("</ol>");
        self
    }

    /// Adds properties, one per line: name and value.
    #[must_use]
    pub fn properties(mut self, rows: &[(String, String)]) -> Self {
        self.body
            .push_str(r#"<div class="scroll"><table class="properties"><tbody>"#);
        for (name, value) in rows {
            let (name, value) = (escape(name), escape(value));
            let _ = write!(self.body, "<tr><td>{name}</td><td>{value}</td></tr>");
        }
        self.body.push_str("</tbody></table></div>");
        self
    }

    /// Adds a table with marked cells: the best bold, the second best underlined, implausible ones grey with a sign.
    #[must_use]
    pub fn marked_table(mut self, header: &[&str], rows: &[Vec<Cell>]) -> Self {
        self.body.push_str(&tables::marked(header, rows));
        self
    }

    /// A paragraph of plain text.
    #[must_use]
    pub fn paragraph(mut self, text: &str) -> Self {
        let _ = write!(self.body, "<p>{}</p>", escape(text));
        self
    }

    /// The tables of an evaluation: rows of metrics with the mean-depth baseline, scale, ranges.
    #[must_use]
    pub fn evaluation(mut self, report: &deepfusion_eval::Report) -> Self {
        self.body.push_str(&tables::evaluation(report));
        self
    }

    /// Any table: the first column is left-aligned text, the others are numbers.
    #[must_use]
    pub fn table(mut self, header: &[&str], rows: &[Vec<String>]) -> Self {
        self.body.push_str(&tables::table(header, rows));
        self
    }

    /// Adds a chart. Consecutive charts stand side by side if there is space.
    #[must_use]
    pub fn chart(mut self, chart: &impl Svg) -> Self {
        let _ = write!(
            self.body,
            r#"<figure class="half">{}</figure>"#,
            chart.to_svg()
        );
        self
    }

    /// A picture with a caption below it.
    ///
    /// # Errors
    /// [`crate::Error::Encode`] if it cannot be encoded (it has no pixels).
    pub fn picture(self, caption: &str, picture: &RgbImage, format: PictureFormat) -> Result<Self> {
        self.figure("", caption, picture, format)
    }

    /// Adds a picture of half the page's width: two consecutive ones stand side by side if there is space.
    ///
    /// # Errors
    /// As [`HtmlReport::picture`].
    pub fn half_picture(
        self,
        caption: &str,
        picture: &RgbImage,
        format: PictureFormat,
    ) -> Result<Self> {
        self.figure(r#" class="half""#, caption, picture, format)
    }

    fn figure(
        mut self,
        class: &str,
        caption: &str,
        picture: &RgbImage,
        format: PictureFormat,
    ) -> Result<Self> {
        let (tag, caption) = (img(caption, picture, format)?, escape(caption));
        let _ = write!(
            self.body,
            "<figure{class}>{tag}<figcaption>{caption}</figcaption></figure>"
        );
        Ok(self)
    }

    /// Adds pictures in rows with equal columns: each with its caption, stored as JPEG. Short rows leave gaps.
    ///
    /// # Errors
    /// As [`HtmlReport::picture`].
    pub fn picture_grid(mut self, rows: &[Vec<Tile>]) -> Result<Self> {
        let columns = rows.iter().map(Vec::len).max().unwrap_or(0).max(1);
        let _ = write!(
            self.body,
            r#"<div class="grid" style="grid-template-columns: repeat({columns}, 1fr)">"#
        );
        for row in rows {
            for tile in row {
                let tag = img(&tile.caption, &tile.picture, PictureFormat::Jpeg)?;
                let caption = escape(&tile.caption);
                let _ = write!(
                    self.body,
                    "<figure>{tag}<figcaption>{caption}</figcaption></figure>"
                );
            }
            self.body
                .push_str(&"<div></div>".repeat(columns - row.len()));
        }
        self.body.push_str("</div>");
        Ok(self)
    }

    /// A command to copy.
    #[must_use]
    pub fn command(mut self, command: &str) -> Self {
        let _ = write!(self.body, "<pre><code>{}</code></pre>", escape(command));
        self
    }

    /// The text of a settings file, collapsed.
    #[must_use]
    pub fn settings(mut self, title: &str, text: &str) -> Self {
        let _ = write!(
            self.body,
            "<details><summary>{}</summary><pre><code>{}</code></pre></details>",
            escape(title),
            escape(text)
        );
        self
    }

    /// The whole page.
    #[must_use]
    pub fn to_html(&self) -> String {
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>{style}</style>\n</head>\n<body>\n<main{wide}>\n\
             <header><h1>{title}</h1><p>{subtitle}</p></header>\n{contents}{body}\n</main>\n</body>\n</html>\n",
            title = escape(&self.title),
            subtitle = escape(&self.subtitle),
            style = include_str!("style.css"),
            wide = if self.wide { r#" class="wide""# } else { "" },
            contents = self.contents(),
            body = self.body,
        )
    }

    fn contents(&self) -> String {
        if self.sections.len() <= SECTIONS_WITHOUT_CONTENTS {
            return String::new();
        }
        let link = |(i, title): (usize, &String)| {
            format!(r##"<a href="#s{}">{}</a>"##, i + 1, escape(title))
        };
        let links: Vec<_> = self.sections.iter().enumerate().map(link).collect();
        format!("<nav>{}</nav>\n", links.join(""))
    }

    /// Writes the page atomically.
    ///
    /// # Errors
    /// [`crate::Error::File`] naming the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        let written = deepfusion_fs::write(path, self.to_html());
        Ok(written.map_err(|e| deepfusion_images::Error::file(path, e))?)
    }
}

/// A picture inside the page.
fn img(alt: &str, picture: &RgbImage, format: PictureFormat) -> Result<String> {
    let mut bytes = Cursor::new(Vec::new());
    let kind = match format {
        PictureFormat::Jpeg => {
            picture.write_with_encoder(JpegEncoder::new_with_quality(&mut bytes, 88))?;
            "jpeg"
        }
        PictureFormat::Png => {
            picture.write_to(&mut bytes, image::ImageFormat::Png)?;
            "png"
        }
    };
    Ok(format!(
        r#"<img alt="{}" width="{}" height="{}" src="data:image/{kind};base64,{}">"#,
        escape(alt),
        picture.width(),
        picture.height(),
        STANDARD.encode(bytes.get_ref())
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LineChart;

    #[test]
    fn the_page_has_no_external_resources() {
        let picture = RgbImage::new(20, 10);
        let html = HtmlReport::new("A <b>", "sub & title")
            .picture("street", &picture, PictureFormat::Jpeg)
            .unwrap()
            .picture("depth", &picture, PictureFormat::Png)
            .unwrap()
            .chart(&LineChart::new("loss", "step").line("a", vec![(0.0, 1.0), (1.0, 0.5)]))
            .settings("config.toml", "seed = 1")
            .to_html();
        assert!(html.contains("A &lt;b&gt;") && html.contains("sub &amp; title"));
        assert!(
            html.contains("data:image/jpeg;base64,/9j/")
                && html.contains("data:image/png;base64,iVBOR")
        );
        for outside in ["http://", "https://", "@import", "<script", "<link"] {
            assert!(!html.contains(outside), "{outside}");
        }
    }

    #[test]
    fn short_grid_rows_are_filled_with_empty_cells() {
        let tile = |caption: &str| Tile::new(caption, RgbImage::new(8, 4));
        let rows = [vec![tile("a"), tile("b"), tile("c")], vec![tile("<d>")]];
        let page = HtmlReport::new("t", "s").wide().picture_grid(&rows);
        let html = page.unwrap().to_html();
        assert_eq!(html.matches("<figure>").count(), 4);
        assert_eq!(html.matches("<div></div>").count(), 2);
        assert!(html.contains("repeat(3, 1fr)") && html.contains("&lt;d&gt;"));
        assert!(html.contains(r#"<main class="wide">"#));
    }

    #[test]
    fn the_page_is_written_to_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.html");
        HtmlReport::new("t", "s").write(&path).unwrap();
        assert!(
            std::fs::read_to_string(&path)
                .unwrap()
                .ends_with("</html>\n")
        );
        assert!(
            HtmlReport::new("t", "s")
                .write(&folder.path().join("no/such.html"))
                .is_err()
        );
    }

    #[test]
    fn an_empty_picture_is_an_error_not_a_panic() {
        for format in [PictureFormat::Jpeg, PictureFormat::Png] {
            let result = HtmlReport::new("t", "s").picture("none", &RgbImage::new(0, 0), format);
            assert!(result.is_err());
        }
    }
}
