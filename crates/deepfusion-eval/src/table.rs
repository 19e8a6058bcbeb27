use std::fmt;

use crate::{Crop, Intervals, Metrics, PointErrors, Points, Report, Sharpness};
use deepfusion_hint::count_of;

const LABEL: usize = 22;

impl fmt::Display for Report {
    /// The tables for people: metrics row by row, then the scale, then the ranges.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let crop = match self.protocol.crop {
            Crop::None => "whole image",
            Crop::Garg => "garg crop",
        };
        let gt = self.protocol.gt.meaning();
        let images = match (self.expected, self.n) {
            (Some(expected), n) => format!("{n} of the split's {}", count_of(expected, "image")),
            (None, n) => count_of(n, "image"),
        };
        let (min, cap) = (self.protocol.min_m, self.protocol.cap_m);
        writeln!(f, "{images}, {crop}, {min} to {cap} m, ground truth: {gt}")?;
        writeln!(f)?;
        write!(f, "{:LABEL$}", "")?;
        for name in Metrics::NAMES {
            write!(f, "{name:>9}")?;
        }
        writeln!(f)?;
        self.rows(f)?;
        writeln!(f)?;
        self.scale_lines(f)?;
        writeln!(f)?;
        writeln!(
            f,
            "{:LABEL$}{:>9}{:>9}{:>9}",
            "range (unscaled)", "pixels", "abs_rel", "rmse"
        )?;
        for bin in &self.ranges {
            let label = format!("{} to {} m", bin.from_m, bin.to_m);
            write!(f, "{label:LABEL$}{:>9}", bin.n)?;
            writeln!(f, "{}{}", number(bin.abs_rel), number(bin.rmse))?;
        }
        if let Some(points) = &self.points {
            writeln!(f)?;
            point_table(f, points)?;
        }
        if !self.skipped.is_empty() {
            writeln!(f)?;
            writeln!(
                f,
                "skipped, no ground truth inside the mask: {}",
                self.skipped.join(", ")
            )?;
        }
        Ok(())
    }
}

impl Report {
    fn rows(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        row(f, "unscaled", &self.unscaled)?;
        row(f, "median-scaled", &self.median_scaled)?;
        if let Some(fixed) = &self.fixed_scaled {
            row(f, &format!("scaled by {}", fixed.factor), &fixed.metrics)?;
        }
        // Without dynamic pixels, the static row would only repeat the first.
        if let Some(metrics) = &self.moving {
            if let Some(still) = &self.still {
                row(f, "static (labelled)", still)?;
            }
            let images = count_of(self.moving_images, "image");
            row(f, &format!("moving, {images}"), metrics)?;
        }
        if let Some(mean_depth_baseline) = &self.mean_depth_baseline {
            row(f, "mean-depth baseline", &mean_depth_baseline.unscaled)?;
            row(f, "  median-scaled", &mean_depth_baseline.median_scaled)?;
        }
        for scenario in &self.scenarios {
            let label = format!("{}, scale {:.3}", scenario.name, scenario.scale.median);
            row(f, &label, &scenario.unscaled)?;
        }
        Ok(())
    }

    fn scale_lines(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scale = &self.scale;
        writeln!(
            f,
            "scale   median(gt) / median(prediction) = {:.3}, relative spread {:.3}",
            scale.median, scale.std_rel
        )?;
        let interval = match scale.bias_ci95 {
            Some([low, high]) => format!("95 % interval {low:+.3} to {high:+.3}"),
            None => "no interval from one image".to_owned(),
        };
        writeln!(
            f,
            "bias    ln(median(prediction) / median(gt)) = {:+.3}, {interval}",
            scale.bias
        )?;
        if let Some(rate) = self.hole_rate {
            let near = self.protocol.cap_m * 0.5;
            write!(
                f,
                "holes   {:.2} % of pixels nearer than {near} m are predicted at the far limit or more than 3 times too far",
                100.0 * rate
            )?;
            match self.hole_rate_moving {
                Some(rate) => writeln!(f, "; {:.2} % of dynamic pixels", 100.0 * rate)?,
                None => writeln!(f)?,
            }
        }
        if let Some(rate) = self.missing_rate {
            writeln!(
                f,
                "missing {:.2} % of the ground truth has no prediction",
                100.0 * rate
            )?;
        }
        if let Some(sharpness) = &self.sharpness {
            sharp_lines(f, sharpness)?;
        }
        self.intervals
            .as_ref()
            .map_or(Ok(()), |i| interval_lines(f, i))
    }
}

/// One line per level.
fn interval_lines(f: &mut fmt::Formatter<'_>, intervals: &Intervals) -> fmt::Result {
    let whose = if intervals.in_sample {
        "the pixels they were calibrated on"
    } else if intervals.calibrated {
        "calibrated"
    } else {
        "as predicted, not calibrated"
    };
    for row in &intervals.levels {
        writeln!(
            f,
            "sigma   the {:.0} % intervals contain the truth for {:.1} % of the pixels; mean width {:.0} % of the depth ({whose})",
            100.0 * row.level,
            100.0 * row.coverage,
            100.0 * row.width_rel,
        )?;
    }
    Ok(())
}

/// Prints only the values that exist: without boundaries in the truth there is no boundary error.
fn sharp_lines(f: &mut fmt::Formatter<'_>, sharpness: &Sharpness) -> fmt::Result {
    if let (Some(accuracy), Some(completeness)) = (
        sharpness.boundary_accuracy_px,
        sharpness.boundary_completeness_px,
    ) {
        writeln!(
            f,
            "edges   {accuracy:.2} px from the true ones (accuracy), {completeness:.2} px including missed ones (completeness); {}",
            count_of(sharpness.boundary_images, "image")
        )?;
    }
    if let Some(share) = sharpness.flying_share {
        writeln!(
            f,
            "flying  {:.1} % of the pixels at depth jumps lie between the two sides; {}",
            100.0 * share,
            count_of(sharpness.flying_images, "image")
        )?;
    }
    Ok(())
}

/// The distances of drawn points: all, then by range.
fn point_table(f: &mut fmt::Formatter<'_>, points: &Points) -> fmt::Result {
    let kind = if points.in_space {
        "Euclidean distance, m"
    } else {
        "distance along z, m (no camera)"
    };
    writeln!(
        f,
        "{} drawn with seed {}: {kind}",
        count_of(points.unscaled.n, "point"),
        points.seed
    )?;
    writeln!(
        f,
        "{:LABEL$}{:>9}{:>9}{:>9}{:>9}{:>15}{:>14}",
        "", "points", "mean", "std", "sem", "sem by image", "median-scaled"
    )?;
    let row =
        |f: &mut fmt::Formatter<'_>, label: &str, errors: &PointErrors, scaled: &PointErrors| {
            writeln!(
                f,
                "{label:LABEL$}{:>9}{}{}{}{:>15}{:>14}",
                errors.n,
                number(errors.mean_m),
                number(errors.std_m),
                number(errors.sem_m),
                number(errors.sem_images_m).trim_start(),
                number(scaled.mean_m).trim_start()
            )
        };
    row(f, "all", &points.unscaled, &points.median_scaled)?;
    for range in &points.ranges {
        let label = format!("{} to {} m", range.from_m, range.to_m);
        row(f, &label, &range.unscaled, &range.median_scaled)?;
    }
    Ok(())
}

fn row(f: &mut fmt::Formatter<'_>, label: &str, metrics: &Metrics) -> fmt::Result {
    write!(f, "{label:LABEL$}")?;
    for value in metrics.to_array() {
        write!(f, "{value:>9.3}")?;
    }
    writeln!(f)
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| format!("{:>9}", "-"), |v| format!("{v:>9.3}"))
}
