use super::OdometryReport;
use super::segments::SHORT_LENGTHS_M;
use deepfusion_hint::count_of;
use std::fmt;

const LABEL: usize = 30;

impl fmt::Display for OdometryReport {
    /// The tables for people: one row per drive and one for all, then the drift by length.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} poses over {:.1} m, unscaled; truth: {}",
            self.n, self.distance_m, self.truth
        )?;
        writeln!(f)?;
        write!(f, "{:LABEL$}{:>7}{:>10}", "", "poses", "m")?;
        writeln!(
            f,
            "{:>10}{:>12}{:>9}{:>9}",
            "t_rel, %", "r_rel, °/m", "ATE, m", "scale"
        )?;
        for row in &self.drives {
            write!(f, "{:LABEL$}{:>7}{:>10.1}", row.name, row.n, row.distance_m)?;
            numbers(
                f,
                row.t_rel_percent,
                row.r_rel_deg_per_m,
                row.ate_m,
                row.scale,
            )?;
        }
        if self.drives.len() > 1 {
            write!(f, "{:LABEL$}{:>7}{:>10.1}", "all", self.n, self.distance_m)?;
            numbers(
                f,
                self.t_rel_percent,
                self.r_rel_deg_per_m,
                self.ate_m,
                self.scale,
            )?;
        }
        writeln!(f)?;
        self.lengths_lines(f)?;
        writeln!(
            f,
            "ATE    over 5 poses, root mean square relative to the first, mean over snippets{}",
            match self.ate_scaled_m {
                Some(scaled) => format!("; SfMLearner's form (scaled, √Σe²/5): {scaled:.4} m"),
                None => String::new(),
            }
        )?;
        writeln!(
            f,
            "scale  median of true / predicted displacement per pair: 1 for a metric method"
        )?;
        if let (Some(m), Some(deg)) = (self.rpe_m, self.rpe_deg) {
            writeln!(f, "pairs  off by {m:.4} m and {deg:.4}° (root mean square)")?;
        }
        Ok(())
    }
}

impl OdometryReport {
    fn lengths_lines(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.lengths.first() {
            None => writeln!(f, "drift  no stretches of 10 m: the drives are too short"),
            Some(first) => {
                let short = SHORT_LENGTHS_M.contains(&first.length_m);
                writeln!(
                    f,
                    "drift over stretches of {} m{}",
                    if short { "10 to 50" } else { "100 to 800" },
                    if short {
                        " (no drive has KITTI's 100 m: not comparable with its tables)"
                    } else {
                        ""
                    }
                )?;
                for row in &self.lengths {
                    writeln!(
                        f,
                        "{:>9} m{:>17}{:>10.3} %{:>12.5} °/m",
                        row.length_m,
                        count_of(row.n, "stretch"),
                        row.t_rel_percent,
                        row.r_rel_deg_per_m
                    )?;
                }
                writeln!(f)
            }
        }
    }
}

fn numbers(
    f: &mut fmt::Formatter<'_>,
    t_rel: Option<f64>,
    r_rel: Option<f64>,
    ate: Option<f64>,
    scale: Option<f64>,
) -> fmt::Result {
    let number = |value: Option<f64>, width: usize, digits: usize| {
        value.map_or_else(
            || format!("{:>width$}", "-"),
            |v| format!("{v:>width$.digits$}"),
        )
    };
    writeln!(
        f,
        "{}{}{}{}",
        number(t_rel, 10, 3),
        number(r_rel, 12, 5),
        number(ate, 9, 4),
        number(scale, 9, 3)
    )
}
