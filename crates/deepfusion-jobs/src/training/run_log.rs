//! What a run leaves to look at: its losses, and pictures of its training samples.

use std::path::{Path, PathBuf};

use deepfusion_data::RgbImage;
use deepfusion_render::{DepthPanel, depth_panel, sample_panel};
use deepfusion_train::log::{CsvLog, CsvRecord, TensorBoardLog};
use deepfusion_train::{SamplePanel, Supervision, TrainEvent};

use crate::Result;

/// Writes a run's events to files: `log.csv`, TensorBoard's, and `panels/STEP.png`.
pub struct RunLog {
    csv: CsvLog,
    events: TensorBoardLog,
    panels: PathBuf,
}

impl RunLog {
    /// Opens the log of the run in `folder`, which continues after `step`.
    ///
    /// # Errors
    /// A folder that cannot be written to; a `log.csv` that another program wrote.
    pub fn open(folder: &Path, step: usize) -> Result<Self> {
        let panels = folder.join("panels");
        std::fs::create_dir_all(&panels).map_err(|e| deepfusion_data::Error::file(&panels, e))?;
        Ok(Self {
            csv: CsvLog::open(&folder.join("log.csv"), step)?,
            events: TensorBoardLog::create(folder)?,
            panels,
        })
    }

    /// Writes what is logged of an event.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, event: &TrainEvent) -> Result<()> {
        match event {
            TrainEvent::Step {
                step,
                losses,
                learning_rate,
                images_per_second,
                scale_ratio,
                gradient_norm,
                ..
            } => {
                self.csv.write(&CsvRecord {
                    step: *step,
                    losses,
                    learning_rate: *learning_rate,
                    scale_ratio: *scale_ratio,
                    images_per_second: *images_per_second,
                    selection: None,
                })?;
                let others = [
                    ("learning_rate", *learning_rate),
                    ("scale_ratio", *scale_ratio),
                    ("gradient_norm", *gradient_norm),
                ];
                self.scalars(*step, "train", losses.named().into_iter().chain(others))
            }
            TrainEvent::Validated {
                step,
                losses,
                selection,
                scale_ratio,
                ..
            } => {
                self.csv.write(&CsvRecord {
                    step: *step,
                    losses,
                    learning_rate: 0.0,
                    scale_ratio: *scale_ratio,
                    images_per_second: 0.0,
                    selection: Some(*selection),
                })?;
                let others = [("selection", *selection)];
                self.scalars(
                    *step,
                    "validation",
                    losses.named().into_iter().chain(others),
                )
            }
            TrainEvent::Panel { step, panel } => {
                let path = self.panels.join(format!("{step:06}.png"));
                Ok(deepfusion_data::save_png(&drawn(panel)?, &path)?)
            }
            TrainEvent::Camera { learned, .. } => {
                let [fx, fy] = learned.focal_px;
                self.scalars(learned.step, "camera", [("fx", fx), ("fy", fy)])
            }
            TrainEvent::Started { .. } | TrainEvent::Saved { .. } | TrainEvent::Warning { .. } => {
                Ok(())
            }
        }
    }

    /// Logs figures of a step under one heading.
    fn scalars(
        &mut self,
        step: usize,
        heading: &str,
        figures: impl IntoIterator<Item = (&'static str, f64)>,
    ) -> Result<()> {
        let tagged: Vec<_> = figures
            .into_iter()
            .map(|(name, value)| (format!("{heading}/{name}"), value))
            .collect();
        let tagged: Vec<_> = tagged.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        Ok(self.events.scalars(step, &tagged)?)
    }
}

/// The picture of a panel.
fn drawn(panel: &SamplePanel) -> deepfusion_render::Result<RgbImage> {
    let (width, height) = (panel.width as u32, panel.height as u32);
    let (image, disparity) = (&panel.image[..], &panel.disparity[..]);
    match &panel.supervision {
        Supervision::View {
            warped,
            error,
            mask,
            flow,
            moving,
        } => sample_panel(&deepfusion_render::SamplePanel {
            width,
            height,
            image,
            disparity,
            warped,
            error,
            mask,
            flow: flow.as_deref(),
            moving: moving.as_deref(),
        }),
        Supervision::Depth { truth, error } => depth_panel(&DepthPanel {
            width,
            height,
            image,
            disparity,
            truth,
            error,
        }),
    }
}
