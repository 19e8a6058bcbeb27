use std::fmt::Write as _;

use super::axis::{
    AxisScale, BOTTOM, COLOURS, HEIGHT, LEFT, RIGHT, Svg, TOP, WIDTH, draw_axes, open_svg,
};
use crate::html::escape;

/// Most dots that are drawn, evenly selected: more would not be visible.
const MOST_DOTS: usize = 1500;

/// A dot for each pair of numbers, on equal axes with the diagonal: predicted over true, observed over expected.
#[derive(Debug, Clone, PartialEq)]
pub struct ScatterChart {
    title: String,
    x_label: String,
    points: Vec<(f64, f64)>,
    large: bool,
}

impl ScatterChart {
    /// A chart of points (x, y); those that are not finite are left out.
    #[must_use]
    pub fn new(
        title: impl Into<String>,
        x_label: impl Into<String>,
        points: Vec<(f64, f64)>,
    ) -> Self {
        Self {
            title: title.into(),
            x_label: x_label.into(),
            points,
            large: false,
        }
    }

    /// Draws large dots, for few points.
    #[must_use]
    pub fn large(mut self) -> Self {
        self.large = true;
        self
    }
}

impl Svg for ScatterChart {
    fn to_svg(&self) -> String {
        let mut svg = open_svg(&self.title);
        let finite = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
        let points: Vec<(f64, f64)> = self.points.iter().filter(finite).copied().collect();
        let values = || points.iter().flat_map(|p| [p.0, p.1]);
        let (Some(x), Some(y)) = (
            AxisScale::over(values(), LEFT, WIDTH - RIGHT, false).map(AxisScale::with_margin),
            AxisScale::over(values(), HEIGHT - BOTTOM, TOP, false).map(AxisScale::with_margin),
        ) else {
            svg.push_str(r#"<text x="320" y="140" text-anchor="middle">no values</text></svg>"#);
            return svg;
        };
        draw_axes(&mut svg, &x, &y, &self.x_label);
        // Both axes have the same ends, so that the diagonal runs from corner to corner.
        let _ = write!(
            svg,
            r#"<line x1="{LEFT}" y1="{}" x2="{}" y2="{TOP}" class="reference"/><text x="{}" y="{}" text-anchor="end">{}</text>"#,
            HEIGHT - BOTTOM,
            WIDTH - RIGHT,
            WIDTH - RIGHT - 26.0,
            TOP + 6.0,
            escape("equal")
        );
        let step = points.len().div_ceil(MOST_DOTS).max(1);
        let mut path = String::new();
        for point in points.iter().step_by(step) {
            if let (Some(px), Some(py)) = (x.pixel(point.0), y.pixel(point.1)) {
                // A line of no length with round ends is a dot.
                let _ = write!(path, "M{px:.1} {py:.1}h0");
            }
        }
        let class = if self.large { "dots large" } else { "dots" };
        let _ = write!(
            svg,
            r#"<path d="{path}" stroke="{}" class="{class}"/></svg>"#,
            COLOURS[0]
        );
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dots_are_selected_evenly_and_stay_inside() {
        let points = (0..10_000).map(|i| (f64::from(i), f64::from(i) * 1.1));
        let svg = ScatterChart::new("x", "true", points.collect()).to_svg();
        let dots = svg.matches("h0").count();
        assert!((1000..=MOST_DOTS).contains(&dots), "{dots}");
        let odd = ScatterChart::new("x", "true", vec![(f64::NAN, 1.0), (2.0, f64::INFINITY)]);
        assert!(odd.to_svg().contains("no values"));
    }
}
