use std::fmt::Write as _;

use crate::html::escape;

/// Paths seen from above, as a separate SVG file: one scale for both axes, and a scale bar.
#[derive(Debug, Clone, PartialEq)]
pub struct TopView {
    /// Title of the view.
    pub title: String,
    /// Names and points: metres to the right and ahead.
    pub paths: Vec<(String, Vec<[f64; 2]>)>,
}

const SIZE: f64 = 640.0;
const MARGIN: f64 = 40.0;
const TOP: f64 = 64.0;
/// The first colour is that of the truth: muted, and drawn wide below the others.
const COLOURS: [&str; 4] = ["#94a3b8", "#ea580c", "#2563eb", "#16a34a"];

impl TopView {
    /// A view without paths yet.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            paths: Vec::new(),
        }
    }

    /// Adds a path; the first is the truth.
    #[must_use]
    pub fn path(mut self, name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        self.paths.push((name.into(), points));
        self
    }

    /// The picture as an SVG file. Points that are not finite are left out.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let points = || {
            let all = self.paths.iter().flat_map(|(_, points)| points);
            all.filter(|p| p.iter().all(|v| v.is_finite()))
        };
        let span = |axis: usize| {
            points().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
                (low.min(p[axis]), high.max(p[axis]))
            })
        };
        let (x, y) = (span(0), span(1));
        // A path without motion has no extent of its own.
        let extent = (x.1 - x.0).max(y.1 - y.0).max(1.0);
        let extent = if extent.is_finite() { extent } else { 1.0 };
        let scale = (SIZE - 2.0 * MARGIN) / extent;
        // At 15 pixels a letter is 8 to 9 wide: a title of usual length fits.
        let title = 32.0 + 8.8 * self.title.chars().count() as f64;
        let width = ((x.1 - x.0).max(0.0) * scale + 2.0 * MARGIN).max(title.clamp(320.0, SIZE));
        let height = (y.1 - y.0).max(0.0) * scale + 2.0 * MARGIN + TOP;
        let shift = (width - (x.1 - x.0).max(0.0) * scale) / 2.0;
        let pixel = |p: &[f64; 2]| {
            (
                shift + (p[0] - x.0) * scale,
                TOP + MARGIN + (y.1 - p[1]) * scale,
            )
        };
        // Writing to a String cannot fail, here and below.
        let mut svg = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0}" height="{height:.0}" viewBox="0 0 {width:.1} {height:.1}" font-family="sans-serif" font-size="13"><rect width="100%" height="100%" fill="#ffffff"/><text x="16" y="24" font-size="15" fill="#0f172a">{}</text>"##,
            escape(&self.title)
        );
        let mut key_x = 16.0;
        for (i, (name, points)) in self.paths.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let stroke = if i == 0 { 6.0 } else { 2.0 };
            let line: Vec<String> = points
                .iter()
                .filter(is_somewhere)
                .map(|p| {
                    let (px, py) = pixel(p);
                    format!("{px:.1},{py:.1}")
                })
                .collect();
            let _ = write!(
                svg,
                r#"<polyline points="{}" fill="none" stroke="{colour}" stroke-width="{stroke}" stroke-linecap="round" stroke-linejoin="round"/><line x1="{key_x}" y1="44" x2="{}" y2="44" stroke="{colour}" stroke-width="{stroke}"/><text x="{}" y="48" fill="{INK}">{}</text>"#,
                line.join(" "),
                key_x + 18.0,
                key_x + 26.0,
                escape(name)
            );
            key_x += 44.0 + 7.5 * name.chars().count() as f64;
        }
        let first = self.paths.first();
        if let Some(start) = first.and_then(|(_, points)| points.iter().find(is_somewhere)) {
            let (px, py) = pixel(start);
            let _ = write!(
                svg,
                r#"<circle cx="{px:.1}" cy="{py:.1}" r="5" fill="{INK}"/><text x="{:.1}" y="{:.1}" fill="{INK}">start</text>"#,
                px + 9.0,
                py + 4.0
            );
        }
        let bar = round_length(extent / 4.0);
        let (left, bottom) = (16.0, height - 16.0);
        let _ = write!(
            svg,
            r#"<line x1="{left}" y1="{bottom:.1}" x2="{:.1}" y2="{bottom:.1}" stroke="{INK}" stroke-width="2"/><text x="{left}" y="{:.1}" fill="{INK}">{bar} m</text></svg>"#,
            left + bar * scale,
            bottom - 6.0
        );
        svg
    }
}

const INK: &str = "#0f172a";

/// Whether a point can be drawn.
fn is_somewhere(point: &&[f64; 2]) -> bool {
    point.iter().all(|v| v.is_finite())
}

/// The largest of 1, 2, 5 times a power of ten that is no more than `length`.
fn round_length(length: f64) -> f64 {
    let power = 10_f64.powf(length.log10().floor());
    let steps = [5.0, 2.0, 1.0].into_iter();
    steps
        .map(|s| s * power)
        .find(|bar| *bar <= length * (1.0 + 1e-9))
        .unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_axes_have_the_same_scale() {
        let corner = vec![[0.0, 0.0], [0.0, 56.0], [28.0, 56.0]];
        let svg = TopView::new("a < b").path("truth", corner).to_svg();
        assert!(svg.contains("a &lt; b") && svg.contains(">10 m<"), "{svg}");
        // 10 pixels a metre, ahead is up: the corner is 560 above the start, the end 280 to its right.
        let line = svg.split("points=\"").nth(1).unwrap();
        let points: Vec<f64> = line
            .split('"')
            .next()
            .unwrap()
            .split([' ', ','])
            .map(|v| v.parse().unwrap())
            .collect();
        assert!((points[1] - points[3] - 560.0).abs() < 0.2, "{points:?}");
        assert!((points[4] - points[2] - 280.0).abs() < 0.2, "{points:?}");
    }

    #[test]
    fn a_view_without_points_is_still_a_picture() {
        for points in [vec![], vec![[1.0, 2.0]], vec![[f64::NAN, 0.0]]] {
            let svg = TopView::new("t").path("truth", points).to_svg();
            assert!(svg.ends_with("</svg>"), "{svg}");
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
    }

    #[test]
    fn scale_bars_have_round_lengths() {
        for (length, bar) in [
            (0.3, 0.2),
            (1.0, 1.0),
            (14.0, 10.0),
            (49.0, 20.0),
            (70.0, 50.0),
        ] {
            assert!((round_length(length) - bar).abs() < 1e-9 * bar, "{length}");
        }
    }
}
