//! Which rows of metrics cannot be right.
//!
//! The seven metrics are not independent. Every bound below is derived for one image and also applies to the mean over images. Figures are
//! taken at the end of their rounding interval that favours the row. With t = ln 1.25, L = |ln(pred/gt)| of a pixel and bₖ = 1 − δₖ, the
//! share of pixels with L ≥ k·t:
//!
//! - δ₁ ≤ δ₂ ≤ δ₃, since the thresholds grow.
//! - RMSE log ≥ t·(b₁ + b₂ + b₃): min(⌊L/t⌋, 3) is the number of thresholds that a pixel misses, so mean L is at least t times
//!   their sum, and a root mean square is at least the mean. It is linear in bₖ, so it also applies to means over images, and it
//!   is sharp: images in which all pixels are right or all are wrong reach it.
//! - Abs Rel ≥ 0.2·b₁ + 0.16·b₂ + 0.128·b₃: a pixel that misses k thresholds is off by at least 1 − 0.8ᵏ of its depth.
//! - RMSE ≤ √(cap · Sq Rel): gt ≤ cap in every pixel gives this for each image, and the root is concave.
//! - Sq Rel ≤ cap · Abs Rel: no clamped depth is off by more than the cap.
//!
//! One bound is about what is likely. Inside an image, RMSE log ≥ t·√(b₁ + 3·b₂ + 5·b₃) applies (a pixel that misses k thresholds adds
//! k²t², and 1 + 3 + … = k²). The root is concave, so means over images may fall below it if a few images contain most of the wrong pixels.
//! A row that does is flagged as implausible, not impossible.

mod reason;

pub use self::reason::FlagReason;

use crate::Metrics;

/// The seven metrics, `None` if unknown, in the order of [`Metrics::NAMES`].
pub type Seven = [Option<f64>; 7];

/// How certain it is that a row is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    /// No predictions can give these figures.
    Impossible,
    /// Possible, but only with unusually distributed errors; or a sign of a mistake.
    Implausible,
    /// Not a fault of the row: something a reader must know.
    Note,
}

impl Severity {
    /// The word as printed.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Impossible => "impossible",
            Self::Implausible => "implausible",
            Self::Note => "note",
        }
    }
}

/// What is wrong with a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Flag {
    /// How certain it is that the row is wrong.
    pub severity: Severity,
    /// The reason.
    pub why: FlagReason,
}

impl Flag {
    /// Something a reader must know.
    #[must_use]
    pub fn note(why: FlagReason) -> Self {
        Self {
            severity: Severity::Note,
            why,
        }
    }
}

/// Half a unit of the third decimal, as published tables print three decimals.
pub const THREE_DECIMALS: f64 = 0.0005;

/// What cannot be right about a row. `rounding` is half a unit of the last printed decimal (0 for figures with full precision), `cap_m` the
/// largest depth that counts.
#[must_use]
pub fn check(row: &Seven, rounding: f64, cap_m: f64) -> Vec<Flag> {
    let mut flags = Vec::new();
    let mut flag = |severity, why| flags.push(Flag { severity, why });
    for (value, metric) in row.iter().zip(Metrics::NAMES) {
        let Some(value) = *value else { continue };
        let share = metric.starts_with('a') && metric.len() == 2;
        if !value.is_finite() || value < 0.0 {
            flag(
                Severity::Impossible,
                FlagReason::OutOfRange { metric, value },
            );
        } else if share && value > 1.0 {
            flag(Severity::Impossible, FlagReason::AboveOne { metric, value });
        }
    }
    let [abs_rel, sq_rel, rmse, rmse_log, a1, a2, a3] = *row;
    for (low, high, names) in [
        (a1, a2, ("δ₁", "δ₂")),
        (a2, a3, ("δ₂", "δ₃")),
        (a1, a3, ("δ₁", "δ₃")),
    ] {
        if let (Some(low), Some(high)) = (low, high)
            && low > high
            // The two comparisons before cover this one.
            && !(names == ("δ₁", "δ₃") && a2.is_some())
        {
            let (narrow, wide) = names;
            flag(
                Severity::Impossible,
                FlagReason::Order {
                    narrow,
                    within: low,
                    wide,
                    within_wide: high,
                },
            );
        }
    }
    // In favour of the row: shares are rounded up, the missed share is never below 0, and a share that is not printed may be 1.
    let missed = |share: Option<f64>| share.map_or(0.0, |a| (1.0 - a - rounding).max(0.0));
    let b = [missed(a1), missed(a2), missed(a3)];
    let t = 1.25f64.ln();
    // The rounding error of an f64 sum over a thousand images is smaller.
    let slack = rounding + 1e-9;
    if let Some(rmse_log) = rmse_log {
        let least = t * (b[0] + b[1] + b[2]);
        let alike = t * (b[0] + 3.0 * b[1] + 5.0 * b[2]).sqrt();
        if rmse_log + slack < least {
            flag(
                Severity::Impossible,
                FlagReason::RmseLog { rmse_log, least },
            );
        } else if rmse_log + slack < alike {
            flag(
                Severity::Implausible,
                FlagReason::RmseLogOfAlike {
                    rmse_log,
                    alike,
                    least,
                },
            );
        }
    }
    if let Some(abs_rel) = abs_rel {
        let least = 0.2 * b[0] + 0.16 * b[1] + 0.128 * b[2];
        if abs_rel + slack < least {
            flag(Severity::Impossible, FlagReason::AbsRel { abs_rel, least });
        }
    }
    if let (Some(rmse), Some(sq_rel)) = (rmse, sq_rel) {
        let most = (cap_m * (sq_rel + slack)).max(0.0).sqrt();
        if rmse - slack > most {
            flag(Severity::Impossible, FlagReason::Rmse { rmse, most, cap_m });
        }
    }
    if let (Some(abs_rel), Some(sq_rel)) = (abs_rel, sq_rel) {
        let most = cap_m * (abs_rel + slack);
        if sq_rel - slack > most {
            flag(
                Severity::Impossible,
                FlagReason::SqRel {
                    sq_rel,
                    most,
                    cap_m,
                },
            );
        }
    }
    flags
}

/// Flags rows in which every figure equals another row's: two methods never agree that exactly. `rows` are the names and figures of one
/// table. Rows with fewer than four figures are not compared.
#[must_use]
pub fn identical(rows: &[(&str, Seven)]) -> Vec<Option<Flag>> {
    let known = |row: &Seven| row.iter().flatten().count();
    let twin = |i: usize| {
        let (_, row) = &rows[i];
        let same = |j: &usize| *j != i && known(row) >= 4 && rows[*j].1 == *row;
        let twin = (0..rows.len()).find(same)?;
        Some(Flag {
            severity: Severity::Implausible,
            why: FlagReason::Twin {
                row: rows[twin].0.to_owned(),
            },
        })
    };
    (0..rows.len()).map(twin).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn published(row: [f64; 7]) -> Vec<Flag> {
        check(&row.map(Some), THREE_DECIMALS, 80.0)
    }

    #[test]
    fn published_rows_pass() {
        for row in [
            [0.115, 0.903, 4.863, 0.193, 0.877, 0.959, 0.981],
            [0.107, 0.765, 4.561, 0.183, 0.886, 0.963, 0.983],
            [0.392, 5.767, 10.612, 0.464, 0.449, 0.721, 0.857],
        ] {
            assert_eq!(published(row), []);
        }
    }

    #[test]
    fn the_papers_row_with_the_order_reversed_is_impossible() {
        let flags = published([0.057, 0.716, 3.692, 0.175, 0.977, 0.968, 0.985]);
        assert_eq!(flags.len(), 1);
        assert_eq!(flags[0].severity, Severity::Impossible);
        let why = flags[0].why.to_string();
        assert!(why.starts_with("δ₁ = 0.977 above δ₂ = 0.968"), "{why}");
    }

    #[test]
    fn the_papers_low_rmse_log_is_implausible_not_impossible() {
        let flags = published([0.112, 0.849, 4.263, 0.075, 0.887, 0.961, 0.980]);
        assert_eq!(flags.len(), 1);
        assert_eq!(flags[0].severity, Severity::Implausible);
        // t·√(0.1125 + 3·0.0385 + 5·0.0195) = 0.2231·0.5705.
        let why = flags[0].why.to_string();
        assert!(why.contains("at least 0.127"), "{why}");
    }

    #[test]
    fn each_bound_is_reported() {
        for (row, word) in [
            ([0.1, 1.0, 5.0, 0.01, 0.8, 0.9, 0.95], "RMSE log"),
            ([0.01, 1.0, 5.0, 0.5, 0.8, 0.9, 0.95], "Abs Rel"),
            ([0.1, 0.2, 5.0, 0.5, 0.8, 0.9, 0.95], "RMSE = 5"),
            ([0.1, 9.0, 5.0, 0.5, 0.8, 0.9, 0.95], "Sq Rel"),
            ([0.1, 1.0, 5.0, 0.5, 88.0, 0.9, 0.95], "share is at most 1"),
            ([f64::NAN, 1.0, 5.0, 0.5, 0.8, 0.9, 0.95], "abs_rel is NaN"),
            ([0.1, -1.0, 5.0, 0.5, 0.8, 0.9, 0.95], "sq_rel is -1"),
        ] {
            let flags = published(row);
            assert!(
                flags.iter().any(|f| f.why.to_string().contains(word)),
                "{word}: {flags:?}"
            );
            assert!(
                flags.iter().all(|f| f.severity == Severity::Impossible),
                "{flags:?}"
            );
        }
        // Without δ₂, δ₁ and δ₃ are compared.
        let gap = [None, None, None, None, Some(0.9), None, Some(0.8)];
        assert_eq!(check(&gap, 0.0, 80.0).len(), 1);
        assert_eq!(check(&[None; 7], 0.0, 80.0), []);
    }

    #[test]
    fn twins_are_both_reported() {
        let row = [0.392, 5.767, 10.612, 0.464, 0.449, 0.721, 0.857].map(Some);
        let mut other = row;
        other[0] = Some(0.388);
        let flags = identical(&[("row 1", row), ("row 2", other), ("row 4", row)]);
        let twin_of = |row: &str| {
            let row = row.to_owned();
            Some(Flag {
                severity: Severity::Implausible,
                why: FlagReason::Twin { row },
            })
        };
        assert_eq!(flags, [twin_of("row 4"), None, twin_of("row 1")]);
        let few = [None, None, None, None, Some(0.9), None, None];
        assert_eq!(identical(&[("a", few), ("b", few)]), [None, None]);
    }

    proptest! {
        /// Metrics of real pixels are never flagged as impossible, however odd: images of random sizes, depths up to the cap, any
        /// predictions, averaged as in the tables.
        #[test]
        fn real_predictions_are_never_impossible(
            images in prop::collection::vec(
                prop::collection::vec((0.5f64..79.9, 0.001f64..80.0), 1..12), 1..6)
        ) {
            let each: Vec<Metrics> = images.iter().map(|pixels| {
                let (gt, pred): (Vec<f64>, Vec<f64>) = pixels.iter().copied().unzip();
                Metrics::of(&gt, &pred).unwrap()
            }).collect();
            let mean = Metrics::mean(&each).unwrap().to_array();
            let exact = check(&mean.map(Some), 0.0, 80.0);
            prop_assert!(exact.iter().all(|f| f.severity != Severity::Impossible), "{exact:?}");
            let printed = mean.map(|v| Some((v * 1000.0).round() / 1000.0));
            let rounded = check(&printed, THREE_DECIMALS, 80.0);
            prop_assert!(rounded.iter().all(|f| f.severity != Severity::Impossible), "{rounded:?}");
            // For a single image, the stronger bound applies too.
            let one = check(&each[0].to_array().map(Some), 0.0, 80.0);
            prop_assert!(one.is_empty(), "{one:?}");
        }
    }
}
