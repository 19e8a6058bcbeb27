//! The request for a new run, and the configuration that follows from it.

use deepfusion_data::Dataset;
use deepfusion_model::{Compute, InputSize, Preset, Reprojection, TrainConfig, ViewMotion};

use super::AskedRecordings;
use super::resume::ClockAhead;
use crate::recordings::training_recordings;
use crate::{Error, Result};

/// The request for a new run. What is not set comes from the file or the preset.
#[derive(Debug, Clone, Default)]
pub struct StartRequest {
    /// A configuration file, read over its preset.
    pub file: Option<Box<TrainConfig>>,
    /// A preset, used without a file; by default [`Preset::Tiny`].
    pub preset: Option<Preset>,
    /// The kind of device, which determines a preset's sizes.
    pub compute: Compute,
    /// Steps of the whole run.
    pub steps: Option<usize>,
    /// Epochs of the whole run, instead of steps.
    pub epochs: Option<usize>,
    /// The size of the network's input.
    pub size: Option<InputSize>,
    /// Number of samples in a batch.
    pub batch: Option<usize>,
    /// The seed.
    pub seed: Option<u64>,
    /// Whether the camera is learned.
    pub learned_camera: bool,
    /// The pose used for warping.
    pub view_motion: Option<ViewMotion>,
    /// Loss terms and parts of the network to switch on.
    pub with: Vec<String>,
    /// Loss terms and parts of the network to switch off.
    pub without: Vec<String>,
    /// Keys with values, such as `batch=4`.
    pub assignments: Vec<String>,
    /// The recordings, and how they are opened.
    pub recordings: AskedRecordings,
}

impl StartRequest {
    /// The run's configuration. If the camera's clock is to be measured, `measure_clock` returns, from the opened recordings, how many
    /// seconds it is ahead.
    ///
    /// # Errors
    /// An unknown term or key; as [`AskedRecordings::replace_in`]; if the clock is measured, as [`training_recordings`], and an error of
    /// `measure_clock`.
    pub fn config<E: From<Error>>(
        &self,
        measure_clock: impl FnOnce(&[Dataset]) -> Result<f64, E>,
    ) -> Result<TrainConfig, E> {
        let mut config = self.settings()?;
        if self.recordings.clock == Some(ClockAhead::Measured) {
            // Measured relative to the recordings' own files, and saved in the configuration as a number.
            config.data.camera_ahead_s = None;
            let mut measured = config.clone();
            // Turns measured in the images would follow the camera's clock.
            measured.data.measured_turns_only = true;
            let recordings = training_recordings(&measured)?;
            let datasets: Vec<_> = recordings.into_iter().map(|(_, dataset)| dataset).collect();
            config.data.camera_ahead_s = Some(measure_clock(&datasets)?);
        }
        Ok(config)
    }

    /// The configuration before the clock is measured.
    fn settings(&self) -> Result<TrainConfig> {
        // Destructured, so that a new field cannot be forgotten here.
        let Self {
            file,
            preset,
            compute,
            steps,
            epochs,
            size,
            batch,
            seed,
            learned_camera,
            view_motion,
            with,
            without,
            assignments,
            recordings,
        } = self;
        let mut config = match file {
            Some(file) => (**file).clone(),
            None => preset.unwrap_or(Preset::Tiny).config_on(*compute),
        };
        config.size = size.unwrap_or(config.size);
        config.steps = steps.or(config.steps);
        if let Some(epochs) = epochs {
            (config.epochs, config.steps, config.min_steps) = (*epochs, None, 0);
        }
        config.batch = batch.unwrap_or(config.batch);
        config.seed = seed.unwrap_or(config.seed);
        for term in with {
            config.with(term)?;
        }
        for term in without {
            config.without(term)?;
        }
        if recordings.stereo {
            (config.stereo, config.reprojection) = (true, Reprojection::Minimum);
        }
        // Set last: a motion that contradicts a term left out is then an error, not silently replaced.
        config.view_motion = view_motion.unwrap_or(config.view_motion);
        if *learned_camera {
            let camera = config.assumed_camera.get_or_insert_default();
            camera.learn = true;
        }
        for assignment in assignments {
            config.set(assignment)?;
        }
        recordings.replace_in(&mut config.data)?;
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(request: &StartRequest) -> Result<TrainConfig> {
        request.config(|_| unreachable!("no clock is to be measured"))
    }

    fn recordings() -> AskedRecordings {
        AskedRecordings {
            paths: vec!["/no/such/street".into()],
            ..AskedRecordings::default()
        }
    }

    #[test]
    fn unset_values_come_from_the_preset_or_the_file() {
        let request = StartRequest {
            recordings: recordings(),
            ..StartRequest::default()
        };
        let config = of(&request).unwrap();
        let tiny = Preset::Tiny.config_on(Compute::Processor);
        assert_eq!((config.preset, config.size), (Preset::Tiny, tiny.size));
        assert_eq!(config.data.paths, request.recordings.paths);
        let gpu = StartRequest {
            preset: Some(Preset::Light),
            compute: Compute::Gpu,
            ..request.clone()
        };
        let light = Preset::Light.config_on(Compute::Gpu);
        assert_eq!(of(&gpu).unwrap().batch, light.batch);
        let file = TrainConfig {
            seed: 7,
            ..Preset::Light.config()
        };
        let by_file = StartRequest {
            file: Some(Box::new(file.clone())),
            ..request
        };
        let config = of(&by_file).unwrap();
        assert_eq!((config.seed, config.size), (7, file.size));
    }

    #[test]
    fn requested_values_replace_those_of_the_file() {
        let size = InputSize {
            width: 192,
            height: 64,
        };
        let request = StartRequest {
            epochs: Some(3),
            size: Some(size),
            batch: Some(2),
            learned_camera: true,
            view_motion: Some(ViewMotion::PoseNet),
            with: vec!["hce".into()],
            without: vec!["automask".into()],
            assignments: vec!["seed=9".into()],
            recordings: AskedRecordings {
                stereo: true,
                clock: Some(ClockAhead::Seconds(0.25)),
                ..recordings()
            },
            ..StartRequest::default()
        };
        let config = of(&request).unwrap();
        assert_eq!((config.size, config.batch, config.seed), (size, 2, 9));
        assert_eq!(
            (config.epochs, config.steps, config.min_steps),
            (3, None, 0)
        );
        assert!(config.depth_net.hce.is_some() && !config.loss.automask);
        assert!(config.stereo && config.assumed_camera.is_some_and(|camera| camera.learn));
        assert_eq!(config.reprojection, Reprojection::Minimum);
        assert_eq!(config.view_motion, ViewMotion::PoseNet);
        assert_eq!(config.data.camera_ahead_s, Some(0.25));
        let wrong = StartRequest {
            without: vec!["hope".into()],
            ..request
        };
        assert!(of(&wrong).unwrap_err().to_string().contains("hope"));
    }

    /// Only then are the recordings opened, and these do not exist.
    #[test]
    fn the_clock_is_measured_on_request() {
        let request = StartRequest {
            recordings: AskedRecordings {
                clock: Some(ClockAhead::Measured),
                ..recordings()
            },
            ..StartRequest::default()
        };
        let error = of(&request).unwrap_err().to_string();
        assert!(error.contains("/no/such/street"), "{error}");
    }
}
