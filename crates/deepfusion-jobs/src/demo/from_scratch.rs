//! From scratch: six simulated streets, a small network that knows nothing, and a seventh street to be measured on.

use std::path::{Path, PathBuf};

use deepfusion_model::{CompareAt, InputSize, Preset, Reprojection, TrainConfig, ViewMotion};
use deepfusion_render::HtmlReport;
use deepfusion_sim::SimConfig;

use super::measure::PROTOCOL;
use super::{DemoSettings, ShownPrediction};
use crate::duration::duration_text;
use crate::evaluation::Evaluated;
use crate::{Result, RunHistory};

/// Far from any seed a user is likely to choose for training.
const TEST_SEED: u64 = 1_000_003;
/// Streets that are trained on, each filmed at its own rate: one street alone is learned by heart. At few
/// frames a second far things move enough to be measured; at many, cars parked beside the lane move
/// little enough to be found.
const FRAMES_PER_SECOND: [f64; 6] = [5.0, 8.0, 12.0, 18.0, 26.0, 36.0];
/// Frames of each.
const STREET_FRAMES: usize = 260;
/// Their pictures: larger than what the network sees, small enough to draw quickly.
const STREET_SIZE: (u32, u32) = (320, 96);
/// Every n-th of their frames has a scan, for the mean-depth baseline alone.
const STREET_SCAN_EVERY: usize = 20;
/// Frames of the street that is measured on, and how many of them have a scan.
const TEST_FRAMES: usize = 200;
const TEST_SCAN_EVERY: usize = 8;
/// Steps of training: a few minutes on two cores.
const STEPS: usize = 1500;
/// Small images: many steps in few minutes, and image motion within a network's reach.
const SIZE: InputSize = InputSize {
    width: 192,
    height: 64,
};

/// The streets that are trained on.
#[must_use]
pub fn training_streets(settings: &DemoSettings) -> Vec<SimConfig> {
    let (width, height) = settings.size(STREET_SIZE);
    let street = |(i, fps): (usize, f64)| SimConfig {
        seed: settings.seed.wrapping_add(i as u64),
        frames: settings.frames(STREET_FRAMES),
        width,
        height,
        scan_every: STREET_SCAN_EVERY,
        fps,
        ..SimConfig::default()
    };
    let rates = FRAMES_PER_SECOND.into_iter().enumerate();
    rates.map(street).collect()
}

/// The street that is measured on.
#[must_use]
pub fn test_street(settings: &DemoSettings) -> SimConfig {
    let usual = SimConfig::default();
    let (width, height) = settings.size((usual.width, usual.height));
    SimConfig {
        seed: settings.seed.wrapping_add(TEST_SEED),
        frames: settings.frames(TEST_FRAMES),
        width,
        height,
        scan_every: TEST_SCAN_EVERY,
        ..usual
    }
}

/// How the network learns on these drives, from the images and the vehicle's motion.
#[must_use]
pub fn recipe(settings: &DemoSettings, drives: &[PathBuf]) -> TrainConfig {
    let mut preset = Preset::Tiny.config();
    // Two frames of a pair show nearly the same: in one direction a step sees twice as many places.
    (preset.reprojection, preset.batch) = (Reprojection::Minimum, 2 * preset.batch);
    preset.loss.compare_at = CompareAt::Own;
    preset.data.paths = drives.to_vec();
    let steps = settings.steps(STEPS);
    TrainConfig {
        view_motion: ViewMotion::Vehicle,
        size: settings.input_size(SIZE),
        steps: Some(steps),
        seed: settings.seed,
        validate_every: steps / 5,
        ..preset
    }
}

/// The frames to be shown, of a drive with so many.
#[must_use]
pub fn shown_frames(frames: usize) -> [usize; 3] {
    [frames / 10, frames * 2 / 5, frames * 7 / 10]
}

/// What the page shows.
pub struct FromScratchPage<'a> {
    /// How it measures on the street never seen.
    pub evaluated: &'a Evaluated,
    /// What it sees there; the first frame with its truth and its cloud.
    pub shown: &'a [ShownPrediction],
    /// Of the whole demo.
    pub seconds: f64,
    /// The folder of the run that learned.
    pub run: &'a Path,
    /// The command that makes the page again.
    pub command: &'a str,
}

impl FromScratchPage<'_> {
    /// The page; the pictures of the truth on it are files, too.
    ///
    /// # Errors
    /// A picture that cannot be encoded or written; a run's log that is another program's.
    pub fn compose(&self) -> Result<HtmlReport> {
        let mut page = self
            .facts()
            .section("Accuracy on the street never seen")
            .paragraph(PROTOCOL);
        page = self.evaluated.add_to(page).section("What it sees");
        for (i, shown) in self.shown.iter().enumerate() {
            page = shown.add_to(page, "predicted depth in metres")?;
            if i == 0 {
                page = shown.add_truth_to(page)?;
                page = shown.add_cloud_to(page)?;
            }
        }
        page = RunHistory::read(self.run)?.add_to(page);
        Ok(page.section("Again").command(self.command))
    }

    /// Title and key figures.
    fn facts(&self) -> HtmlReport {
        let page = HtmlReport::new(
            "DeepFusion: metric depth from one camera and a speed signal",
            "Learned from scratch on six simulated streets from images, speed and yaw rate, without any depth label; measured on another",
        );
        let time = duration_text(self.seconds);
        self.evaluated.add_key_figures(page, ("time", &time))
    }
}
