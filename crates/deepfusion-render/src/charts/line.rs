use std::fmt::Write as _;

use super::axis::{
    AxisScale, BOTTOM, COLOURS, HEIGHT, LEFT, RIGHT, Svg, TOP, WIDTH, draw_axes, draw_key, open_svg,
};
use crate::html::escape;

/// A line of a [`LineChart`].
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// x and y of its points, by x. Points that are not finite leave a gap.
    pub points: Vec<(f64, f64)>,
}

impl Series {
    /// A named line.
    #[must_use]
    pub fn new(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self {
            name: name.into(),
            points,
        }
    }
}

/// Lines over a number, such as losses over steps, as a self-contained inline SVG.
#[derive(Debug, Clone, PartialEq)]
pub struct LineChart {
    /// Title of the chart.
    pub title: String,
    /// Label of the x axis.
    pub x_label: String,
    /// The lines.
    pub series: Vec<Series>,
    /// A dashed horizontal line with its name, such as the scale ratio 1.
    pub reference: Option<(f64, String)>,
    /// Whether y has a logarithmic scale; values that are not positive are then left out.
    pub log_y: bool,
}

/// More points than there are pixels would not be visible.
const MOST_POINTS: usize = 500;
impl LineChart {
    /// A chart without lines yet.
    #[must_use]
    pub fn new(title: impl Into<String>, x_label: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            x_label: x_label.into(),
            series: Vec::new(),
            reference: None,
            log_y: false,
        }
    }

    /// Adds a line.
    #[must_use]
    pub fn line(mut self, name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        self.series.push(Series::new(name, points));
        self
    }

    /// Adds a dashed horizontal line.
    #[must_use]
    pub fn reference(mut self, y: f64, name: impl Into<String>) -> Self {
        self.reference = Some((y, name.into()));
        self
    }

    /// Gives y a logarithmic scale.
    #[must_use]
    pub fn log_y(mut self) -> Self {
        self.log_y = true;
        self
    }

    /// The chart as an SVG element.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let mut svg = open_svg(&self.title);
        let (Some(x), Some(y)) = (self.x_axis(), self.y_axis()) else {
            svg.push_str(r#"<text x="320" y="140" text-anchor="middle">no values</text></svg>"#);
            return svg;
        };
        draw_axes(&mut svg, &x, &y, &self.x_label);
        if let Some((value, name)) = &self.reference
            && let Some(py) = y.pixel(*value)
        {
            let (end, above) = (WIDTH - RIGHT, py - 4.0);
            // Writing to a String cannot fail, here and below.
            let _ = write!(
                svg,
                r#"<line x1="{LEFT}" y1="{py:.1}" x2="{end}" y2="{py:.1}" class="reference"/><text x="{end}" y="{above:.1}" text-anchor="end">{}</text>"#,
                escape(name)
            );
        }
        for (series, colour) in self.series.iter().zip(COLOURS.iter().cycle()) {
            let _ = write!(
                svg,
                r#"<path d="{}" stroke="{colour}" class="line"/>"#,
                path(&series.points, &x, &y)
            );
        }
        let names: Vec<&str> = self.series.iter().map(|s| s.name.as_str()).collect();
        draw_key(&mut svg, &names);
        svg.push_str("</svg>");
        svg
    }

    fn x_axis(&self) -> Option<AxisScale> {
        let values = self.series.iter().flat_map(|s| &s.points).map(|p| p.0);
        AxisScale::over(values, LEFT, WIDTH - RIGHT, false)
    }

    fn y_axis(&self) -> Option<AxisScale> {
        let lines = self.series.iter().flat_map(|s| &s.points).map(|p| p.1);
        let values = lines.chain(self.reference.iter().map(|r| r.0));
        AxisScale::over(values, HEIGHT - BOTTOM, TOP, self.log_y).map(AxisScale::with_margin)
    }
}

impl Svg for LineChart {
    fn to_svg(&self) -> String {
        LineChart::to_svg(self)
    }
}

fn path(points: &[(f64, f64)], x: &AxisScale, y: &AxisScale) -> String {
    let step = points.len().div_ceil(MOST_POINTS).max(1);
    let mut out = String::new();
    let mut pen = 'M';
    for group in points.chunks(step) {
        let n = group.len() as f64;
        let (mean_x, mean_y) = group
            .iter()
            .fold((0.0, 0.0), |(a, b), p| (a + p.0 / n, b + p.1 / n));
        match (x.pixel(mean_x), y.pixel(mean_y)) {
            (Some(px), Some(py)) => {
                let _ = write!(out, "{pen}{px:.1} {py:.1}");
                pen = 'L';
            }
            _ => pen = 'M',
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_has_lines_axes_and_a_legend() {
        let loss = (0..2000)
            .map(|i| (f64::from(i), 1.0 / (1.0 + f64::from(i) / 100.0)))
            .collect();
        let svg = LineChart::new("loss <total>", "step")
            .line("train", loss)
            .line(
                "validation",
                vec![(0.0, 0.9), (1000.0, f64::NAN), (1999.0, 0.2)],
            )
            .reference(0.5, "half")
            .to_svg();
        assert_eq!(svg.matches("<path").count(), 2);
        assert!(
            svg.contains("loss &lt;total&gt;")
                && svg.contains(">1500<")
                && svg.contains("validation")
        );
        assert!(!svg.contains("NaN") && svg.len() < 20_000, "{}", svg.len());
    }

    #[test]
    fn empty_and_constant_series_are_drawn() {
        assert!(LineChart::new("t", "x").to_svg().contains("no values"));
        let nan = LineChart::new("t", "x")
            .line("a", vec![(0.0, f64::NAN)])
            .to_svg();
        assert!(!nan.contains("NaN"));
        for log in [false, true] {
            let mut chart = LineChart::new("t", "x").line("a", vec![(3.0, 2.0)]);
            chart.log_y = log;
            let svg = chart.to_svg();
            assert!(
                svg.contains("M") && !svg.contains("NaN") && !svg.contains("inf"),
                "{svg}"
            );
        }
    }
}
