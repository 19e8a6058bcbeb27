//! Checks that the settings of a run are valid together.

use deepfusion_hint::count_of;

use crate::{
    AskedBy, Error, ExpectedSetting, FoundSetting, Learn, Reprojection, TrainConfig, ViewMotion,
};

impl TrainConfig {
    /// Checks that video at several sizes has a canonical focal length: without it, one sigmoid disparity would have to mean the same
    /// metres at every size. [`Self::validate`] leaves this open, as the network that a run starts from may provide it.
    ///
    /// # Errors
    /// [`Error::Config`].
    pub fn validate_video_sizes(&self) -> Result<(), Error> {
        let sizes = self.augmentation.video_sizes.len();
        if sizes == 0 || self.canonical_focal_px.is_some() {
            return Ok(());
        }
        fail(
            "augmentation.video_sizes",
            AskedBy::NoCanonicalFocal,
            count_of(sizes, "size"),
        )
    }

    /// # Errors
    /// [`Error::Config`] naming the first invalid setting.
    pub fn validate(&self) -> Result<(), Error> {
        self.size.validate()?;
        self.depth_net.validate()?;
        self.pose_net.validate_layers()?;
        self.flow_decoder.validate()?;
        self.loss.validate()?;
        self.validate_sets()?;
        let sets = 0..self.data.sets.len().max(1);
        if self.depth_net.uncertainty && !sets.into_iter().any(|set| self.learn(set).from_depth()) {
            let found = "true".to_owned();
            return fail("depth_net.uncertainty", AskedBy::NoKnownDepth, found);
        }
        let alone = (0..self.data.sets.len().max(1)).any(|set| self.learn(set) == Learn::Depth);
        if self.loss.depth.weight == 0.0 && alone && !self.depth_net.uncertainty {
            return fail("loss.depth.weight", AskedBy::DepthAlone, "0".to_owned());
        }
        if !self.depth_net.is_resnet() && self.loss.flow.weight > 0.0 {
            let found = self.loss.flow.weight.to_string();
            return fail("loss.flow.weight", AskedBy::NoResNet, found);
        }
        at_least_one("batch", self.batch)?;
        self.validate_stereo()?;
        if let Some(threads) = self.data.loader_threads
            && !(1..=1024).contains(&threads)
        {
            let expected = ExpectedSetting::Within {
                from: 1.0,
                to: 1024.0,
            };
            return fail("data.loader_threads", expected, threads.to_string());
        }
        at_least_one("accumulate", self.accumulate)?;
        at_least_one("steps", self.steps.unwrap_or(self.epochs))?;
        above_zero("learning_rate", self.learning_rate)?;
        if let Some(focal) = self.canonical_focal_px {
            above_zero("canonical_focal_px", focal)?;
        }
        if let Some(camera) = &self.assumed_camera {
            camera.validate()?;
        }
        if let Some(steps) = self.learning_rate_steps {
            at_least_one("learning_rate_steps", steps)?;
        }
        within("learning_rate_drop", self.learning_rate_drop, (0.0, 1.0))?;
        within("validation_share", self.validation_share, (0.0, 0.5))?;
        let weights = [
            ("clip_norm", self.clip_norm),
            ("weight_decay", self.weight_decay),
            ("min_speed_mps", self.min_speed_mps),
            ("checkpoint_minutes", self.checkpoint_minutes),
            ("frame_distance_m", self.frame_distance_m),
            ("pose_net.metres_per_unit", self.pose_net.metres_per_unit),
        ];
        for (field, weight) in weights {
            if !(weight >= 0.0 && weight.is_finite()) {
                return fail(field, ExpectedSetting::NotNegative, weight.to_string());
            }
        }
        let augmentation = &self.augmentation;
        // The message shows the digits of an f32, not of its f64.
        let zoom = augmentation.zoom;
        if !(1.0..=8.0).contains(&zoom) {
            let expected = ExpectedSetting::Within { from: 1.0, to: 8.0 };
            return fail("augmentation.zoom", expected, zoom.to_string());
        }
        let video_sizes = &augmentation.video_sizes;
        for size in augmentation.sizes.iter().chain(video_sizes) {
            size.validate()?;
        }
        let brightness = f64::from(augmentation.brightness);
        for (field, share) in [
            ("augmentation.jitter", augmentation.jitter),
            ("augmentation.brightness", brightness),
            ("augmentation.hue", f64::from(augmentation.hue) * 2.0),
        ] {
            within(field, share, (0.0, 1.0))?;
        }
        // Without the speed loss a run learns from images alone. PoseNet would have no loss at all if the vehicle's motion were used for
        // warping.
        if self.loss.speed == 0.0 && self.view_motion != ViewMotion::PoseNet {
            let found = format!("{:?}", self.view_motion).to_lowercase();
            return fail("view_motion", AskedBy::NoSpeedLoss, found);
        }
        if self.loss.affine > 0.0 && self.reprojection != Reprojection::Bidirectional {
            let found = self.loss.affine.to_string();
            return fail("loss.affine", AskedBy::OneWay, found);
        }
        self.validate_explainability()?;
        let found = || format!("{:?}", self.frames);
        match (self.reprojection, self.frames.as_slice()) {
            (_, []) => fail("frames", ExpectedSetting::OneOffset, found()),
            (_, frames) if frames.contains(&0) => {
                fail("frames", ExpectedSetting::OtherOffsets, found())
            }
            (Reprojection::Bidirectional, frames) if frames != [1] => {
                fail("frames", AskedBy::BothWays, found())
            }
            _ => Ok(()),
        }
    }

    /// Masks and their term need each other, and the separate error of each source. The automask compares sources instead.
    fn validate_explainability(&self) -> Result<(), Error> {
        let weight = self.loss.explainability;
        let mean = self.reprojection == Reprojection::Mean;
        match (self.pose_net.explainability, weight > 0.0) {
            (true, false) => fail(
                "loss.explainability",
                AskedBy::MasksForTerm,
                weight.to_string(),
            ),
            (false, true) => fail("loss.explainability", AskedBy::NoMasks, weight.to_string()),
            (true, true) if !mean => fail(
                "reprojection",
                AskedBy::MasksForMean,
                format!("{:?}", self.reprojection).to_lowercase(),
            ),
            _ if mean && self.loss.automask => {
                fail("loss.automask", AskedBy::MeanOfSources, "true".to_owned())
            }
            _ => Ok(()),
        }
    }

    /// Checks settings that conflict with the other camera's view.
    fn validate_stereo(&self) -> Result<(), Error> {
        if !self.stereo {
            return Ok(());
        }
        if self.reprojection != Reprojection::Minimum {
            let found = format!("{:?}", self.reprojection).to_lowercase();
            return fail("reprojection", AskedBy::Stereo("minimum"), found);
        }
        if self.loss.flow.weight > 0.0 {
            let found = self.loss.flow.weight.to_string();
            return fail("loss.flow.weight", AskedBy::Stereo("0"), found);
        }
        if self.learned_camera().is_some() {
            let expected = AskedBy::Stereo("false");
            return fail("assumed_camera.learn", expected, "true".to_owned());
        }
        Ok(())
    }
}

fn fail(
    field: &'static str,
    expected: impl Into<ExpectedSetting>,
    found: impl Into<FoundSetting>,
) -> Result<(), Error> {
    Err(Error::config(field, expected, found))
}

fn at_least_one(field: &'static str, count: usize) -> Result<(), Error> {
    match count {
        0 => fail(field, ExpectedSetting::AtLeastOne, count.to_string()),
        _ => Ok(()),
    }
}

fn above_zero(field: &'static str, value: f64) -> Result<(), Error> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        fail(field, ExpectedSetting::AboveZero, value.to_string())
    }
}

/// Within two limits, both included; NaN is not.
fn within(field: &'static str, value: f64, (from, to): (f64, f64)) -> Result<(), Error> {
    if (from..=to).contains(&value) {
        Ok(())
    } else {
        let expected = ExpectedSetting::Within { from, to };
        fail(field, expected, value.to_string())
    }
}
