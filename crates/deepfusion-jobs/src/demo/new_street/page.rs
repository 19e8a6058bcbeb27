//! The page: what the network sees zero-shot and after learning.

use std::path::Path;

use deepfusion_render::{HtmlReport, PictureFormat};

use crate::demo::ShownPrediction;
use crate::demo::measure::PROTOCOL;
use crate::duration::duration_text;
use crate::evaluation::Evaluated;
use crate::{Result, RunHistory};

/// How a network does on the street: what it sees in a frame, and how it measures on all of them.
#[derive(Clone, Copy)]
pub struct StreetResult<'a> {
    /// The frame.
    pub shown: &'a ShownPrediction,
    /// All frames.
    pub evaluated: &'a Evaluated,
}

/// What the page shows.
pub struct NewStreetPage<'a> {
    /// The network as it was given.
    pub zero_shot: StreetResult<'a>,
    /// What it learned; the same frame.
    pub learned: StreetResult<'a>,
    /// The picture of the frame with its targets ([`ShownPrediction::overlay_in`]).
    pub overlay: Option<&'a Path>,
    /// From the first image to its depth, milliseconds.
    pub first_ms: f64,
    /// Of the whole demo.
    pub seconds: f64,
    /// The folder of the run that learned.
    pub run: &'a Path,
    /// The command that makes the page again.
    pub command: &'a str,
}

impl NewStreetPage<'_> {
    /// The page; the pictures on it are files, too.
    ///
    /// # Errors
    /// A picture that cannot be read, encoded or written; a run's log that is another program's.
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
            "What is learned is the metre. So little video alone may also let the sky come nearer and soften edges; simulated depth beside it, as \
             `deepfusion adapt` learns, holds edges but needs more steps.",
        );
        let second = self.learned.shown;
        page = second.add_to(page, "its depth in metres after learning")?;
        page = second.add_error_to(page, "error_learned", "Relative error after learning")?;
        page = page
            .section("Accuracy on the part of the street that was not learned from")
            .paragraph(PROTOCOL);
        page = self.learned.evaluated.add_to(page);
        page = RunHistory::read(self.run)?.add_to(page);
        Ok(page.section("Again").command(self.command))
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
            "A simulated street that the embedded network has never seen, by a camera and in a light of its own: zero-shot, and after learning on \
             its first part from images, speed and yaw rate, without any depth label",
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
