//! The page: the network's predictions zero-shot and after fine-tuning.

use std::path::Path;

use deepfusion_render::{HtmlReport, PictureFormat};

use crate::demo::ShownPrediction;
use crate::demo::measure::PROTOCOL;
use crate::duration::duration_text;
use crate::evaluation::Evaluated;
use crate::{Result, RunHistory};

/// The results of a network on the street: its prediction for one frame, and its metrics on all.
#[derive(Clone, Copy)]
pub struct StreetResult<'a> {
    /// The prediction for one frame.
    pub shown: &'a ShownPrediction,
    /// The metrics on all frames.
    pub evaluated: &'a Evaluated,
}

/// The contents of the page.
pub struct NewStreetPage<'a> {
    /// The network as it was given.
    pub zero_shot: StreetResult<'a>,
    /// The fine-tuned network, with the same frame.
    pub learned: StreetResult<'a>,
    /// The picture of the frame with its targets ([`ShownPrediction::overlay_in`]).
    pub overlay: Option<&'a Path>,
    /// Time from the first image to its depth, in milliseconds.
    pub first_ms: f64,
    /// Duration of the whole demo, in seconds.
    pub seconds: f64,
    /// The folder of the fine-tuning run.
    pub run: &'a Path,
    /// The command that makes the page again.
    pub command: &'a str,
}

impl NewStreetPage<'_> {
    /// Makes the page; the pictures on it are also saved as files.
    ///
    /// # Errors
    /// A picture that cannot be read, encoded or written; a log in the run's folder that another program wrote.
    pub fn compose(&self) -> Result<HtmlReport> {
        let mut page = self.facts().section("Zero-shot");
        let first = self.zero_shot.shown;
        page = first.add_to(page, "its depth in metres")?;
        page = first.add_truth_to(page)?;
        page = first.add_cloud_to(page)?;
        if let Some(path) = self.overlay {
            let picture = deepfusion_data::load_rgb(path)?;
            let caption = "3D targets: boxes with distance, followed over time";
            page = page.picture(caption, &picture, PictureFormat::Png)?;
        }
        page = page.section("After learning here").paragraph(
            "Fine-tuning corrects the scale. With so little video, the sky may come nearer and edges may soften; with simulated depth added, as \
             `deepfusion adapt` does, edges stay sharp, but more steps are needed.",
        );
        let second = self.learned.shown;
        page = second.add_to(page, "its depth in metres after learning")?;
        page = second.add_error_to(page, "error_learned", "Relative error after learning")?;
        page = page
            .section("Accuracy on the held-out part of the street")
            .paragraph(PROTOCOL);
        page = self.learned.evaluated.add_to(page);
        page = RunHistory::read(self.run)?.add_to(page);
        Ok(page.section("Reproduce").command(self.command))
    }

    /// Title and key figures.
    fn facts(&self) -> HtmlReport {
        let number = |v: f64| format!("{v:.3}");
        let (before, after) = (
            &self.zero_shot.evaluated.report,
            &self.learned.evaluated.report,
        );
        let mean_depth_baseline = after
            .mean_depth_baseline
            .as_ref()
            .map(|t| t.unscaled.abs_rel);
        HtmlReport::new(
            "DeepFusion: metric depth from one camera and a speed signal",
            "A simulated street that the embedded network has never seen, with its own camera and light: zero-shot, and after learning on \
             its first part from images, speed and yaw rate, without depth labels",
        )
        .facts(&[
            ("Abs Rel zero-shot", &number(before.unscaled.abs_rel)),
            ("after learning", &number(after.unscaled.abs_rel)),
            (
                "mean-depth baseline",
                &mean_depth_baseline.map_or("-".into(), number),
            ),
            ("scale (1 is metric)", &number(after.scale.median)),
            ("first image to depth", &format!("{:.0} ms", self.first_ms)),
            ("time", &duration_text(self.seconds)),
        ])
    }
}
