//! Common parts of all charts: a frame of 640 × 260 units, axes with round ticks, a legend.

use std::fmt::Write as _;

use crate::html::escape;

pub(super) const WIDTH: f64 = 640.0;
pub(super) const HEIGHT: f64 = 260.0;
pub(super) const LEFT: f64 = 58.0;
pub(super) const RIGHT: f64 = 14.0;
pub(super) const TOP: f64 = 36.0;
pub(super) const BOTTOM: f64 = 40.0;
pub(super) const COLOURS: [&str; 6] = [
    "#2563eb", "#ea580c", "#16a34a", "#9333ea", "#dc2626", "#0891b2",
];

/// A chart as part of a page.
pub trait Svg {
    /// The chart as an SVG element that needs no external resources.
    fn to_svg(&self) -> String;
}

/// The element's beginning, with the title.
pub(super) fn open_svg(title: &str) -> String {
    format!(
        r#"<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{0}"><text x="{LEFT}" y="15" class="title">{0}</text>"#,
        escape(title)
    )
}

/// Lines and numbers of both axes.
pub(super) fn draw_axes(svg: &mut String, x: &AxisScale, y: &AxisScale, x_label: &str) {
    draw_y_axis(svg, y);
    for (value, label) in x.ticks() {
        if let Some(px) = x.pixel(value) {
            let _ = write!(
                svg,
                r#"<text x="{px:.1}" y="{}" text-anchor="middle">{label}</text>"#,
                HEIGHT - BOTTOM + 16.0
            );
        }
    }
    draw_x_line(svg, x_label);
}

/// Horizontal lines and their numbers.
pub(super) fn draw_y_axis(svg: &mut String, y: &AxisScale) {
    let right = WIDTH - RIGHT;
    for (value, label) in y.ticks() {
        if let Some(py) = y.pixel(value) {
            // Writing to a String cannot fail, here and below.
            let _ = write!(
                svg,
                r#"<line x1="{LEFT}" y1="{py:.1}" x2="{right}" y2="{py:.1}" class="grid"/><text x="{}" y="{:.1}" text-anchor="end">{label}</text>"#,
                LEFT - 6.0,
                py + 4.0
            );
        }
    }
}

/// The line at the bottom with its labels.
pub(super) fn draw_x_line(svg: &mut String, label: &str) {
    let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
    let _ = write!(
        svg,
        r#"<line x1="{LEFT}" y1="{bottom}" x2="{right}" y2="{bottom}" class="axis"/><text x="{}" y="{}" text-anchor="middle">{}</text>"#,
        (LEFT + right) / 2.0,
        HEIGHT - 6.0,
        escape(label)
    );
}

/// Names beside their colours. One series needs no legend: the title names it.
pub(super) fn draw_key(svg: &mut String, names: &[&str]) {
    if names.len() < 2 {
        return;
    }
    let mut x = WIDTH - RIGHT;
    for (i, name) in names.iter().enumerate().rev() {
        let colour = COLOURS[i % COLOURS.len()];
        x -= 6.6 * name.chars().count() as f64;
        let _ = write!(svg, r#"<text x="{x:.1}" y="15">{}</text>"#, escape(name));
        x -= 20.0;
        let _ = write!(
            svg,
            r#"<line x1="{x:.1}" y1="11" x2="{:.1}" y2="11" stroke="{colour}" class="line"/>"#,
            x + 15.0
        );
        x -= 12.0;
    }
}

/// Values to pixels, along one axis.
pub(super) struct AxisScale {
    /// Both ends in values, or in their decimal logarithms.
    low: f64,
    high: f64,
    pixels: (f64, f64),
    log: bool,
}

impl AxisScale {
    /// An axis over all usable values; `None` without any.
    pub(super) fn over(
        values: impl Iterator<Item = f64>,
        from: f64,
        to: f64,
        log: bool,
    ) -> Option<Self> {
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

    pub(super) fn with_margin(mut self) -> Self {
        let margin = 0.06 * (self.high - self.low);
        // Loss curves stay above zero, so the axis does not go below it.
        let keeps_sign = !self.log && self.low >= 0.0;
        self.low = if keeps_sign {
            (self.low - margin).max(0.0)
        } else {
            self.low - margin
        };
        self.high += margin;
        self
    }

    pub(super) fn pixel(&self, value: f64) -> Option<f64> {
        let value = if self.log { value.log10() } else { value };
        let place = (value - self.low) / (self.high - self.low);
        // A tiny overshoot of the ends is rounding.
        (place.is_finite() && (-1e-6..=1.0 + 1e-6).contains(&place))
            .then_some(self.pixels.0 + place * (self.pixels.1 - self.pixels.0))
    }

    /// Round values and their labels.
    pub(super) fn ticks(&self) -> Vec<(f64, String)> {
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
    // Steps of 2.5 need one more.
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
