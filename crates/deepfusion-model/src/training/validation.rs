//! Which settings of a run mean something.

use deepfusion_hint::count_of;

use crate::{Error, Reprojection, TrainConfig, ViewMotion};

impl TrainConfig {
    /// That video at several sizes has a canonical focal length: without it one sigmoid disparity would have to mean the same metres at
    /// every size. [`Self::validate`] leaves this open, as the network that a run starts from may bring it.
    ///
    /// # Errors
    /// [`Error::Config`].
    pub fn validate_video_sizes(&self) -> Result<(), Error> {
        let sizes = self.augmentation.video_sizes.len();
        if sizes == 0 || self.canonical_focal_px.is_some() {
            return Ok(());
        }
        Err(Error::Config {
            field: "augmentation.video_sizes",
            expected: "none without canonical_focal_px".into(),
            found: count_of(sizes, "size"),
        })
    }

    /// # Errors
    /// [`Error::Config`] naming the first setting that means nothing.
    pub fn validate(&self) -> Result<(), Error> {
        let fail = |field, expected: &str, found: String| {
            Err(Error::Config {
                field,
                expected: expected.into(),
                found,
            })
        };
        self.size.validate()?;
        self.depth_net.validate()?;
        self.pose_net.encoder.validate()?;
        self.flow_decoder.validate()?;
        self.loss.validate()?;
        self.validate_sets()?;
        let sets = 0..self.data.sets.len().max(1);
        if self.depth_net.uncertainty && !sets.into_iter().any(|set| self.learn(set).from_depth()) {
            let expected = "false where nothing is learned from known depth: the head has nothing else to learn from";
            return fail("depth_net.uncertainty", expected, "true".into());
        }
        if !self.depth_net.is_resnet() && self.loss.flow.weight > 0.0 {
            return fail(
                "loss.flow.weight",
                "0 where the depth network is no ResNet with its decoder: the flow decoder reads a ResNet's features",
                self.loss.flow.weight.to_string(),
            );
        }
        if self.batch == 0 {
            return fail("batch", "at least 1", "0".into());
        }
        self.validate_stereo()?;
        if let Some(threads) = self.data.loader_threads
            && !(1..=1024).contains(&threads)
        {
            return fail("data.loader_threads", "1 to 1024", threads.to_string());
        }
        if self.accumulate == 0 {
            return fail("accumulate", "at least 1", "0".into());
        }
        if self.steps.unwrap_or(self.epochs) == 0 {
            return fail("steps", "at least 1", "0".into());
        }
        if !(self.learning_rate > 0.0 && self.learning_rate.is_finite()) {
            return fail("learning_rate", "above 0", self.learning_rate.to_string());
        }
        if let Some(focal) = self.canonical_focal_px
            && !(focal > 0.0 && focal.is_finite())
        {
            return fail("canonical_focal_px", "above 0", focal.to_string());
        }
        if let Some(camera) = &self.assumed_camera {
            camera.validate()?;
        }
        if self.learning_rate_steps == Some(0) {
            return fail("learning_rate_steps", "at least 1", "0".into());
        }
        if !(0.0..=1.0).contains(&self.learning_rate_drop) {
            let found = self.learning_rate_drop.to_string();
            return fail("learning_rate_drop", "0 to 1", found);
        }
        if !(0.0..=0.5).contains(&self.validation_share) {
            return fail(
                "validation_share",
                "0 to 0.5",
                self.validation_share.to_string(),
            );
        }
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
                return fail(field, "0 or more", weight.to_string());
            }
        }
        let zoom = self.augmentation.zoom;
        if !(1.0..=8.0).contains(&zoom) {
            return fail("augmentation.zoom", "1 to 8", zoom.to_string());
        }
        let video_sizes = &self.augmentation.video_sizes;
        for size in self.augmentation.sizes.iter().chain(video_sizes) {
            size.validate()?;
        }
        for (field, share) in [
            ("augmentation.jitter", self.augmentation.jitter),
            (
                "augmentation.brightness",
                f64::from(self.augmentation.brightness),
            ),
            ("augmentation.hue", f64::from(self.augmentation.hue) * 2.0),
        ] {
            if !(0.0..=1.0).contains(&share) {
                return fail(field, "0 to 1", share.to_string());
            }
        }
        // Without the speed term a run learns from images alone; and PoseNet would have no loss at all where
        // the vehicle's motion synthesises the views.
        if self.loss.speed == 0.0 && self.view_motion != ViewMotion::PoseNet {
            let found = format!("{:?}", self.view_motion).to_lowercase();
            return fail("view_motion", "posenet where loss.speed is 0", found);
        }
        if self.loss.affine > 0.0 && self.reprojection != Reprojection::Bidirectional {
            let found = self.loss.affine.to_string();
            return fail(
                "loss.affine",
                "0 where reprojection is not bidirectional: it compares both frames' depths",
                found,
            );
        }
        self.validate_explainability()?;
        match (self.reprojection, self.frames.as_slice()) {
            (_, []) => fail("frames", "at least one offset", "[]".into()),
            (_, frames) if frames.contains(&0) => {
                fail("frames", "offsets other than 0", format!("{frames:?}"))
            }
            (Reprojection::Bidirectional, frames) if frames != [1] => fail(
                "frames",
                "[1] for bidirectional reprojection",
                format!("{frames:?}"),
            ),
            _ => Ok(()),
        }
    }

    /// Masks and their term need each other, and every source's own error; the automask compares the sources'.
    fn validate_explainability(&self) -> Result<(), Error> {
        let fail = |field, expected: &str, found: String| {
            Err(Error::Config {
                field,
                expected: expected.into(),
                found,
            })
        };
        let weight = self.loss.explainability;
        let mean = self.reprojection == Reprojection::Mean;
        match (self.pose_net.explainability, weight > 0.0) {
            (true, false) => fail(
                "loss.explainability",
                "above 0 where pose_net.explainability is true: nothing else keeps the masks up",
                weight.to_string(),
            ),
            (false, true) => fail(
                "loss.explainability",
                "0 where pose_net.explainability is false: there are no masks",
                weight.to_string(),
            ),
            (true, true) if !mean => fail(
                "reprojection",
                "mean where pose_net.explainability is true",
                format!("{:?}", self.reprojection).to_lowercase(),
            ),
            _ if mean && self.loss.automask => fail(
                "loss.automask",
                "false where reprojection is mean",
                "true".into(),
            ),
            _ => Ok(()),
        }
    }

    /// What the other camera's view cannot be beside.
    fn validate_stereo(&self) -> Result<(), Error> {
        let fail = |field, expected: &str, found: String| {
            Err(Error::Config {
                field,
                expected: format!("{expected} where stereo is on"),
                found,
            })
        };
        if !self.stereo {
            return Ok(());
        }
        if self.reprojection != Reprojection::Minimum {
            let found = format!("{:?}", self.reprojection).to_lowercase();
            return fail("reprojection", "minimum", found);
        }
        if self.loss.flow.weight > 0.0 {
            return fail("loss.flow.weight", "0", self.loss.flow.weight.to_string());
        }
        if self.learned_camera().is_some() {
            return fail("assumed_camera.learn", "false", "true".into());
        }
        Ok(())
    }
}
