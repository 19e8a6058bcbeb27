//! A calibration's report: JSON, lines, and the calibration's file.

use std::fmt;
use std::path::Path;

use deepfusion_calibrate::{Board, Calibration, View};
use deepfusion_data::camera_info_yaml;
use deepfusion_geometry::Distortion;
use deepfusion_hint::count_of;
use serde::{Serialize, Serializer};

use super::{BoardViews, BoardWarning, LeftOut};

/// At most this many left-out pictures are named; the others are counted.
const NAMED: usize = 6;

/// A calibration's report: lines for people, JSON for scripts.
#[derive(Debug, Serialize)]
pub struct CalibrationReport<'a> {
    /// The camera.
    #[serde(flatten)]
    pub calibration: &'a Calibration,
    /// What makes the calibration less accurate than it could be.
    #[serde(serialize_with = "in_words")]
    pub warnings: Vec<BoardWarning>,
    /// Names of `coefficients`.
    pub coefficient_names: &'static [&'static str],
    /// The board.
    pub board: Board,
    /// Number of pictures and frames of videos that were searched.
    pub looked_at: usize,
    /// Pictures and frames that show no whole board.
    pub left_out: &'a [LeftOut],
    /// Number of video frames left out because another frame shows the board in the same place, or more sharply.
    pub not_picked: usize,
    /// Path of the calibration's file.
    pub written: &'a Path,
    /// Where the board was seen.
    #[serde(skip)]
    pub views: &'a [View],
    /// The camera's lens.
    #[serde(skip)]
    pub lens: &'a Distortion,
}

fn in_words<S: Serializer>(warnings: &[BoardWarning], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(warnings.iter().map(ToString::to_string))
}

impl BoardViews {
    /// The report of the camera computed from these views, with its lens ([`Self::calibrate`]); `written` is the calibration's file.
    #[must_use]
    pub fn report<'a>(
        &'a self,
        board: &Board,
        (found, lens): (&'a Calibration, &'a Distortion),
        written: &'a Path,
    ) -> CalibrationReport<'a> {
        let mut warnings = self.warnings(found, lens);
        warnings.extend(BoardWarning::of_squares(board));
        CalibrationReport {
            calibration: found,
            warnings,
            coefficient_names: found.model.coefficients(),
            board: *board,
            looked_at: self.looked_at,
            left_out: &self.left_out,
            not_picked: self.not_picked,
            written,
            views: &self.views,
            lens,
        }
    }
}

impl CalibrationReport<'_> {
    /// The camera as ROS's camera_info YAML, with a comment that says what it was made from.
    #[must_use]
    pub fn yaml(&self, name: &str) -> String {
        let (found, board) = (self.calibration, &self.board);
        let errors = &found.standard_errors;
        let comments = [
            format!(
                "deepfusion calibrate: {} of a board of {}x{} inner corners{}; error {:.3} px (root mean square)",
                count_of(found.used(), "view"),
                board.columns,
                board.rows,
                board.of_squares(),
                found.rms_px
            ),
            format!(
                "standard errors in px: fx {:.3}, fy {:.3}, cx {:.3}, cy {:.3}",
                errors.fx, errors.fy, errors.cx, errors.cy
            ),
        ];
        camera_info_yaml(name, &found.intrinsics, self.lens, &comments)
    }

    /// All results: a name and a value each. The name is empty if the value continues the one above.
    #[must_use]
    pub fn rows(&self) -> Vec<(String, String)> {
        let found = self.calibration;
        let (k, errors) = (&found.intrinsics, &found.standard_errors);
        let mut rows = Vec::new();
        let mut row = |name: &str, what: String| rows.push((name.to_owned(), what));
        let lens = found.model.label();
        row("camera", format!("{}x{} pixels, {lens}", k.width, k.height));
        for (name, value, error) in [
            ("fx", k.fx, errors.fx),
            ("fy", k.fy, errors.fy),
            ("cx", k.cx, errors.cx),
            ("cy", k.cy, errors.cy),
        ] {
            row(name, format!("{value:.3} ± {error:.3} px"));
        }
        let lens = found.coefficients.iter().zip(&errors.coefficients);
        for (name, (value, error)) in self.coefficient_names.iter().zip(lens) {
            row(name, format!("{value:.5} ± {error:.5}"));
        }
        row(
            "field of view",
            match found.hfov_deg {
                Some(degrees) => format!("{degrees:.1} degrees from left to right"),
                None => "unknown: the lens model ends before the image does".into(),
            },
        );
        let corners = found.used() * self.board.corners();
        row(
            "error",
            format!(
                "{:.3} px, root mean square of {corners} corners",
                found.rms_px
            ),
        );
        row("views", self.counted_views());
        let out = self.without_use();
        for (name, why) in out.iter().take(NAMED) {
            row("", format!("left out: {name} ({why})"));
        }
        if out.len() > NAMED {
            row("", format!("left out: {} more", out.len() - NAMED));
        }
        let tilts = found.views.iter().filter(|v| v.used);
        let tilts = tilts.filter_map(|v| v.tilt_deg);
        let (least, most) = tilts.fold((f64::MAX, 0.0f64), |(a, b), t| (a.min(t), b.max(t)));
        row("tilt", format!("{least:.0} to {most:.0} degrees"));
        row(
            "coverage",
            format!(
                "{:.0} % of the image; corners in each ninth of it:",
                100.0 * found.coverage.share
            ),
        );
        for [left, middle, right] in found.coverage.ninths {
            row("", format!("{left:6}{middle:6}{right:6}"));
        }
        row("written", self.written.display().to_string());
        rows
    }

    /// How many views were used, and of how many pictures and frames.
    fn counted_views(&self) -> String {
        let used = self.calibration.used();
        let used = format!("{used} of {} used", self.looked_at);
        if self.not_picked == 0 {
            return used;
        }
        format!(
            "{used}; {} more show the board in the same pose as one of these",
            self.not_picked
        )
    }

    /// The pictures that were not used, and why: first those that disagree with the others, then those without the board.
    fn without_use(&self) -> Vec<(&str, String)> {
        let disagree = self.calibration.views.iter().filter(|v| !v.used);
        let disagree = disagree.map(|v| match v.rms_px {
            Some(px) => (v.name.as_str(), format!("{px:.2} px off")),
            None => (v.name.as_str(), "disagrees with the others".into()),
        });
        let left_out = self.left_out.iter();
        let left_out = left_out.map(|l| (l.name.as_str(), l.why.to_string()));
        disagree.chain(left_out).collect()
    }
}

impl fmt::Display for CalibrationReport<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.rows()
            .iter()
            .try_for_each(|(name, what)| writeln!(f, "{name:14}{what}"))
    }
}
