use std::fmt::Write as _;

use crate::html::escape;

/// A line of a [`LineChart`].
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name in the key.
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

/// Lines over a number, such as losses over steps, as an inline SVG that needs nothing from outside.
#[derive(Debug, Clone, PartialEq)]
pub struct LineChart {
    /// What it shows.
    pub title: String,
    /// What x is.
    pub x_label: String,
    /// The lines.
    pub series: Vec<Series>,
    /// A dashed horizontal line and its name, such as the scale ratio 1.
    pub reference: Option<(f64, String)>,
    /// Whether y is shown by its logarithm; values that are not above 0 are then left out.
    pub log_y: bool,
}

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 260.0;
const LEFT: f64 = 58.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 36.0;
const BOTTOM: f64 = 40.0;
/// More points than pixels say nothing more.
const MOST_POINTS: usize = 500;
const COLOURS: [&str; 6] = [
    "#2563eb", "#ea580c", "#16a34a", "#9333ea", "#dc2626", "#0891b2",
];

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

    /// Shows y by its logarithm.
    #[must_use]
    pub fn log_y(mut self) -> Self {
        self.log_y = true;
        self
    }

    /// The chart as an SVG element.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let mut svg = format!(
            r#"<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{0}"><text x="{LEFT}" y="15" class="title">{0}</text>"#,
            escape(&self.title)
        );
        let (Some(x), Some(y)) = (self.x_axis(), self.y_axis()) else {
            svg.push_str(r#"<text x="320" y="140" text-anchor="middle">no values</text></svg>"#);
            return svg;
        };
        self.draw_axes(&mut svg, &x, &y);
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
        self.draw_key(&mut svg);
        svg.push_str("</svg>");
        svg
    }

    fn draw_axes(&self, svg: &mut String, x: &AxisScale, y: &AxisScale) {
        let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
        for (value, label) in y.ticks() {
            if let Some(py) = y.pixel(value) {
                let _ = write!(
                    svg,
                    r#"<line x1="{LEFT}" y1="{py:.1}" x2="{right}" y2="{py:.1}" class="grid"/><text x="{}" y="{:.1}" text-anchor="end">{label}</text>"#,
                    LEFT - 6.0,
                    py + 4.0
                );
            }
        }
        for (value, label) in x.ticks() {
            if let Some(px) = x.pixel(value) {
                let _ = write!(
                    svg,
                    r#"<text x="{px:.1}" y="{}" text-anchor="middle">{label}</text>"#,
                    bottom + 16.0
                );
            }
        }
        let _ = write!(
            svg,
            r#"<line x1="{LEFT}" y1="{bottom}" x2="{right}" y2="{bottom}" class="axis"/><text x="{}" y="{}" text-anchor="middle">{}</text>"#,
            (LEFT + right) / 2.0,
            HEIGHT - 6.0,
            escape(&self.x_label)
        );
    }

    /// One line needs no key: the title says what it is.
    fn draw_key(&self, svg: &mut String) {
        if self.series.len() < 2 {
            return;
        }
        let mut x = WIDTH - RIGHT;
        for (i, series) in self.series.iter().enumerate().rev() {
            let colour = COLOURS[i % COLOURS.len()];
            x -= 6.6 * series.name.chars().count() as f64;
            let _ = write!(
                svg,
                r#"<text x="{x:.1}" y="15">{}</text>"#,
                escape(&series.name)
            );
            x -= 20.0;
            let _ = write!(
                svg,
                r#"<line x1="{x:.1}" y1="11" x2="{:.1}" y2="11" stroke="{colour}" class="line"/>"#,
                x + 15.0
            );
            x -= 12.0;
        }
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

/// Values to pixels, along one axis.
struct AxisScale {
    /// Ends in values, or in their decimal logarithms.
    low: f64,
    high: f64,
    pixels: (f64, f64),
    log: bool,
}

impl AxisScale {
    /// Over all usable values; `None` without any.
    fn over(values: impl Iterator<Item = f64>, from: f64, to: f64, log: bool) -> Option<Self> {
        let usable = values
            .filter(|v| v.is_finite() && (!log || *v > 0.0))
            .map(|v| if log { v.log10() } else { v });
        let (low, high) = usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
        (low <= high).then(|| {
            // A constant has no extent of its own.
            let pad = if high - low > 1e-12 * high.abs().max(1e-300) {
                0.0
            } else {
                (0.1 * high.abs()).max(0.1)
            };
            Self {
                low: low - pad,
                high: high + pad,
                pixels: (from, to),
                log,
            }
        })
    }

    fn with_margin(mut self) -> Self {
        let margin = 0.06 * (self.high - self.low);
        // Loss curves stay above zero: don't show an axis that goes below it.
        let keeps_sign = !self.log && self.low >= 0.0;
        self.low = if keeps_sign {
            (self.low - margin).max(0.0)
        } else {
            self.low - margin
        };
        self.high += margin;
        self
    }

    fn pixel(&self, value: f64) -> Option<f64> {
        let value = if self.log { value.log10() } else { value };
        let place = (value - self.low) / (self.high - self.low);
        // A hair beyond the ends is rounding.
        (place.is_finite() && (-1e-6..=1.0 + 1e-6).contains(&place))
            .then_some(self.pixels.0 + place * (self.pixels.1 - self.pixels.0))
    }

    /// Round values and their labels.
    fn ticks(&self) -> Vec<(f64, String)> {
        if self.log && self.high - self.low > 0.9 {
            let powers = self.low.floor() as i32..=self.high.ceil() as i32;
            let digits: &[f64] = if self.high - self.low > 3.0 {
                &[1.0]
            } else {
                &[1.0, 2.0, 5.0]
            };
            let values = powers.flat_map(|p| digits.iter().map(move |d| d * 10f64.powi(p)));
            let inside = values.filter(|v| self.pixel(*v).is_some());
            return inside.map(|v| (v, label(v, v / 10.0))).collect();
        }
        let (low, high) = if self.log {
            (10f64.powf(self.low), 10f64.powf(self.high))
        } else {
            (self.low, self.high)
        };
        let rough = (high - low) / 5.0;
        let power = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 2.5, 5.0, 10.0]
            .into_iter()
            .map(|m| m * power)
            .find(|s| *s >= rough * 0.999);
        let step = step.unwrap_or(rough);
        let first = (low / step).ceil() as i64;
        let last = (high / step).floor() as i64;
        (first..=last)
            .map(|i| i as f64 * step)
            .map(|v| (v, label(v, step)))
            .collect()
    }
}

/// A number with as many decimals as ticks `step` apart need.
fn label(value: f64, step: f64) -> String {
    let decimals = (-(step.log10() + 1e-9).floor()).max(0.0) as usize;
    // 2.5-steps need one more.
    let more = usize::from((step / 10f64.powf(step.log10().floor()) - 2.5).abs() < 0.01);
    let text = format!("{value:.*}", decimals + more);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_axes_and_key_are_there() {
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
    fn nothing_and_constants_are_drawn_too() {
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

    #[test]
    fn ticks_are_round() {
        let axis = AxisScale {
            low: 0.0,
            high: 1.13,
            pixels: (0.0, 1.0),
            log: false,
        };
        let labels: Vec<String> = axis.ticks().into_iter().map(|t| t.1).collect();
        assert_eq!(labels, ["0", "0.25", "0.5", "0.75", "1"]);
        let axis = AxisScale {
            low: -2.0,
            high: 0.5,
            pixels: (0.0, 1.0),
            log: true,
        };
        let labels: Vec<String> = axis.ticks().into_iter().map(|t| t.1).collect();
        assert_eq!(
            labels,
            ["0.01", "0.02", "0.05", "0.1", "0.2", "0.5", "1", "2"]
        );
    }
}
