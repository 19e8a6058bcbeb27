//! Trains a small network from scratch on six simulated streets, and evaluates it on a seventh.

use std::path::{Path, PathBuf};

use deepfusion_model::{CompareAt, InputSize, Preset, Reprojection, TrainConfig, ViewMotion};
use deepfusion_render::HtmlReport;
use deepfusion_sim::SimConfig;

use super::measure::PROTOCOL;
use super::{DemoSettings, ShownPrediction};
use crate::duration::duration_text;
use crate::evaluation::Evaluated;
use crate::{Result, RunHistory};

/// Added to the demo's seed: far from any seed a user is likely to choose for training.
const TEST_SEED: u64 = 1_000_003;
/// Frame rates of the training streets: a network memorises a single street. At few frames per second, far objects move enough to be
/// measured; at many, cars parked beside the lane move little enough to be matched.
const FRAMES_PER_SECOND: [f64; 6] = [5.0, 8.0, 12.0, 18.0, 26.0, 36.0];
/// Number of frames of each.
const STREET_FRAMES: usize = 260;
/// Size of their pictures: larger than the network's input, small enough to draw quickly.
const STREET_SIZE: (u32, u32) = (320, 96);
/// Every n-th frame has a scan, used only for the mean-depth baseline.
const STREET_SCAN_EVERY: usize = 20;
/// Number of frames of the test street; every `TEST_SCAN_EVERY`-th has a scan.
const TEST_FRAMES: usize = 200;
const TEST_SCAN_EVERY: usize = 8;
/// Number of training steps: a few minutes on two cores.
const STEPS: usize = 1500;
/// Small images: many steps in a few minutes, and image motion within the network's reach.
const SIZE: InputSize = InputSize {
    width: 192,
    height: 64,
};

/// The training streets.
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

/// The test street.
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

/// The configuration that trains on these drives, from images and the vehicle's motion.
#[must_use]
pub fn recipe(settings: &DemoSettings, drives: &[PathBuf]) -> TrainConfig {
    let mut preset = Preset::Tiny.config();
    // The two frames of a pair are nearly alike: with one direction only, a step sees twice as many places.
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

/// The three frames to show, of a drive with this many.
#[must_use]
pub fn shown_frames(frames: usize) -> [usize; 3] {
    [frames / 10, frames * 2 / 5, frames * 7 / 10]
}

/// The contents of the page.
pub struct FromScratchPage<'a> {
    /// Its metrics on the test street.
    pub evaluated: &'a Evaluated,
    /// Its predictions there; the first frame with its ground truth and its cloud.
    pub shown: &'a [ShownPrediction],
    /// Duration of the whole demo, in seconds.
    pub seconds: f64,
    /// The folder of the training run.
    pub run: &'a Path,
    /// The command that makes the page again.
    pub command: &'a str,
}

impl FromScratchPage<'_> {
    /// Makes the page; the pictures of the ground truth on it are also saved as files.
    ///
    /// # Errors
    /// A picture that cannot be encoded or written; a log in the run's folder that another program wrote.
    pub fn compose(&self) -> Result<HtmlReport> {
        let mut page = self
            .facts()
            .section("Accuracy on a street never seen in training")
            .paragraph(PROTOCOL);
        page = self.evaluated.add_to(page).section("Predictions");
        for (i, shown) in self.shown.iter().enumerate() {
            page = shown.add_to(page, "predicted depth in metres")?;
            if i == 0 {
                page = shown.add_truth_to(page)?;
                page = shown.add_cloud_to(page)?;
            }
        }
        page = RunHistory::read(self.run)?.add_to(page);
        Ok(page.section("Reproduce").command(self.command))
    }

    /// Title and key figures.
    fn facts(&self) -> HtmlReport {
        let page = HtmlReport::new(
            "DeepFusion: metric depth from one camera and a speed signal",
            "Trained from scratch on six simulated streets from images, speed and yaw rate, without depth labels; evaluated on a seventh",
        );
        let time = duration_text(self.seconds);
        self.evaluated.add_key_figures(page, ("time", &time))
    }
}
