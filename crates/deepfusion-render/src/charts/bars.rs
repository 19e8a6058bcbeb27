use std::fmt::Write as _;

use super::axis::{
    AxisScale, BOTTOM, COLOURS, HEIGHT, LEFT, RIGHT, Svg, TOP, WIDTH, draw_key, draw_x_line,
    draw_y_axis, open_svg,
};
use crate::html::escape;

/// Groups of bars with their values above them, such as the error of each range.
#[derive(Debug, Clone, PartialEq)]
pub struct BarChart {
    title: String,
    x_label: String,
    groups: Vec<String>,
    series: Vec<(String, Vec<Option<f64>>)>,
}

impl BarChart {
    /// A chart with named groups, without bars yet.
    #[must_use]
    pub fn new(
        title: impl Into<String>,
        x_label: impl Into<String>,
        groups: impl IntoIterator<Item = String>,
    ) -> Self {
        Self {
            title: title.into(),
            x_label: x_label.into(),
            groups: groups.into_iter().collect(),
            series: Vec::new(),
        }
    }

    /// Adds a bar to each group, from 0 upwards; `None` and values that are negative or not finite leave a gap.
    #[must_use]
    pub fn bars(mut self, name: impl Into<String>, values: Vec<Option<f64>>) -> Self {
        self.series.push((name.into(), values));
        self
    }
}

impl Svg for BarChart {
    fn to_svg(&self) -> String {
        let mut svg = open_svg(&self.title);
        let usable = |value: &Option<f64>| value.filter(|v| v.is_finite() && *v >= 0.0);
        let values = self.series.iter().flat_map(|(_, v)| v).filter_map(usable);
        let tallest = values.fold(0.0, f64::max);
        if self.groups.is_empty() || tallest <= 0.0 {
            svg.push_str(r#"<text x="320" y="140" text-anchor="middle">no values</text></svg>"#);
            return svg;
        }
        // The numbers above the bars need space.
        let ends = [0.0, 1.08 * tallest].into_iter();
        let Some(y) = AxisScale::over(ends, HEIGHT - BOTTOM, TOP, false) else {
            return svg;
        };
        draw_y_axis(&mut svg, &y);
        let bottom = HEIGHT - BOTTOM;
        let group_width = (WIDTH - RIGHT - LEFT) / self.groups.len() as f64;
        let bar = (0.7 * group_width / self.series.len().max(1) as f64).min(70.0);
        for (g, name) in self.groups.iter().enumerate() {
            let centre = LEFT + (g as f64 + 0.5) * group_width;
            // Writing to a String cannot fail, here and below.
            let _ = write!(
                svg,
                r#"<text x="{centre:.1}" y="{}" text-anchor="middle">{}</text>"#,
                bottom + 16.0,
                escape(name)
            );
            let first = centre - bar * self.series.len() as f64 / 2.0;
            for (s, (_, values)) in self.series.iter().enumerate() {
                let Some(value) = values.get(g).and_then(usable) else {
                    continue;
                };
                let Some(top) = y.pixel(value) else { continue };
                let (left, colour) = (first + s as f64 * bar, COLOURS[s % COLOURS.len()]);
                let _ = write!(
                    svg,
                    r#"<rect x="{:.1}" y="{top:.1}" width="{:.1}" height="{:.1}" fill="{colour}" class="bar"/><text x="{:.1}" y="{:.1}" text-anchor="middle">{}</text>"#,
                    left + 1.0,
                    (bar - 2.0).max(1.0),
                    bottom - top,
                    left + bar / 2.0,
                    top - 4.0,
                    short(value)
                );
            }
        }
        draw_x_line(&mut svg, &self.x_label);
        let names: Vec<&str> = self.series.iter().map(|(name, _)| name.as_str()).collect();
        draw_key(&mut svg, &names);
        svg.push_str("</svg>");
        svg
    }
}

/// A value with about three digits.
fn short(value: f64) -> String {
    match value {
        v if v < 1.0 => format!("{v:.3}"),
        v if v < 10.0 => format!("{v:.2}"),
        v if v < 100.0 => format!("{v:.1}"),
        v => format!("{v:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_values_leave_gaps_between_bars() {
        let groups = ["0 to 10 m", "10 to 20 m", "<&>"].map(str::to_owned);
        let svg = BarChart::new("Abs Rel", "range", groups)
            .bars("a", vec![Some(0.1), None, Some(f64::NAN)])
            .bars("b", vec![Some(0.2), Some(12.34)])
            .to_svg();
        assert_eq!(svg.matches("<rect").count(), 3);
        assert!(svg.contains("&lt;&amp;&gt;") && svg.contains(">12.3<") && !svg.contains("NaN"));
        let none = BarChart::new("t", "x", Vec::new()).to_svg();
        assert!(none.contains("no values") && none.ends_with("</svg>"));
    }
}
