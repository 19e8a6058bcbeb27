//! A run's reports and checkpoints.

use super::Trainer;
use super::step::PanelInput;
use super::validation::validation_loss;
use crate::focal_spread::focal_spread;
use crate::selection::selection;
use crate::{CheckpointKind, Checkpoints, Control, Error, TrainEvent, TrainWarning};
use deepfusion_model::LearnedCamera;

/// Below this share of pixels in view the geometry has diverged, and a warning is given.
const MIN_VALID_SHARE: f64 = 0.2;
/// Above this share of dynamic pixels the masks remove too much of what depth should learn from, and a warning is given.
const MAX_MOVING_SHARE: f64 = 0.4;

impl Trainer {
    /// Reports the panel, validates and writes checkpoints.
    pub(super) fn report(
        &mut self,
        listen: &mut dyn FnMut(TrainEvent) -> Control,
        shown: Option<PanelInput>,
        [valid_share, moving_share]: [f64; 2],
        validate: bool,
    ) -> Result<(), Error> {
        let step = self.state.step;
        if let Some(shown) = shown {
            let panel = Box::new(shown.panel());
            listen(TrainEvent::Panel { step, panel });
        }
        // Without video both are NaN, which gives no warning.
        if valid_share < MIN_VALID_SHARE {
            let warning = TrainWarning::FewInView { share: valid_share };
            listen(TrainEvent::Warning { step, warning });
        }
        if moving_share > MAX_MOVING_SHARE {
            let warning = TrainWarning::ManyDynamic {
                share: moving_share,
            };
            listen(TrainEvent::Warning { step, warning });
        }
        if !self.workers.leads() {
            return Ok(());
        }
        if validate && !self.validation.is_empty() {
            let (losses, scale_ratio) =
                validation_loss(self.model(), &self.config, &self.validation, &self.device)?;
            let selection = selection(&self.config, &losses);
            let best =
                selection.is_finite() && self.state.best_validation.is_none_or(|b| selection < b);
            if best {
                self.state.best_validation = Some(selection);
            }
            listen(TrainEvent::Validated {
                step,
                losses,
                selection,
                scale_ratio,
                best,
            });
            if best {
                let path =
                    self.folder
                        .save(CheckpointKind::Best, self.model(), None, &self.state)?;
                listen(TrainEvent::Saved { step, path });
            }
        }
        self.save_last(listen)
    }

    /// Reports which camera was learned and how well, and stores it among the run's findings.
    pub(super) fn report_camera(
        &self,
        listen: &mut dyn FnMut(TrainEvent) -> Control,
    ) -> Result<(), Error> {
        let Some(focal) = self.model().focal.as_ref().filter(|_| self.workers.leads()) else {
            return Ok(());
        };
        let size = self.train.camera().map(|k| (k.width, k.height));
        let camera = size.and_then(|size| self.config.camera_learned(focal.ratio(), size));
        let Some(camera) = camera else {
            return Ok(());
        };
        let spread = focal_spread(self.model(), &self.config, &self.train, &self.device)?;
        let step = self.state.step;
        let learned = LearnedCamera {
            focal_px: [camera.fx, camera.fy],
            sigma_px: spread.map(|sigma| [sigma * camera.fx, sigma * camera.fy]),
            step,
        };
        let mut findings = self.folder.read_findings()?;
        findings.learn_camera(&self.config, camera);
        findings.learned_camera = Some(learned);
        self.folder
            .write_config(&self.folder.read_settings()?, &findings)?;
        listen(TrainEvent::Camera { camera, learned });
        if !learned.is_reliable() {
            let warning = TrainWarning::CameraUndetermined;
            listen(TrainEvent::Warning { step, warning });
        }
        Ok(())
    }

    /// Writes the checkpoint to resume from.
    pub(super) fn save_last(
        &self,
        listen: &mut dyn FnMut(TrainEvent) -> Control,
    ) -> Result<(), Error> {
        if !self.workers.leads() {
            return Ok(());
        }
        let step = self.state.step;
        let path = self.folder.save(
            CheckpointKind::Last,
            self.model(),
            Some(&self.adam),
            &self.state,
        )?;
        listen(TrainEvent::Saved { step, path });
        Ok(())
    }
}
