use crate::{AskedBy, Error, ExpectedSetting};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The size at which views at a coarser scale are compared with their targets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CompareAt {
    /// Full size, to which the scale's disparity is enlarged: fewer holes and copied textures.
    #[default]
    Full,
    /// The scale's own size. There, a pixel sees 2ˢ times as far, so that near objects, which move far, are found even from a wrong first
    /// depth; and it costs a third.
    Own,
}

/// Weights and switches of the loss terms. A weight of 0 switches a term off.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LossConfig {
    /// α of the photometric error: the share of SSIM; the rest is the absolute difference.
    pub ssim_weight: f64,
    /// The size at which views at a coarser scale are compared.
    #[serde(default)]
    pub compare_at: CompareAt,
    /// λ_s of the edge-aware smoothness at full resolution; halved at each coarser scale.
    pub smoothness: f64,
    /// λ_v of the speed loss.
    pub speed: f64,
    /// β_R: weight of the rotation within the speed loss. It is not used if warping uses the vehicle's motion: PoseNet then learns all of
    /// that motion, with a weight of its own.
    pub rotation: f64,
    /// Steps over which λ_v rises from 0; at least one epoch, at most a tenth of the run.
    pub speed_warmup_steps: usize,
    /// Automask: whether pixels that the unwarped source explains better contribute its error, a constant, instead.
    pub automask: bool,
    /// λ_e of the explainability masks' −ln E, which keeps the masks from explaining nothing; above 0 if `pose_net.explainability` is true,
    /// else 0 (absent).
    #[serde(default, skip_serializing_if = "is_zero")]
    pub explainability: f64,
    /// λ_a of the affine invariant loss, which needs the depths of both frames.
    #[serde(default)]
    pub affine: f64,
    /// The optical flow's terms.
    #[serde(default)]
    pub flow: FlowLossConfig,
    /// Dynamic pixels.
    #[serde(default)]
    pub moving: MovingConfig,
    /// Known depth, for data sets that train on it.
    #[serde(default)]
    pub depth: DepthLossConfig,
}

/// The loss on known depth. It only has an effect if a data set says `learn = "depth"` or `"both"`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DepthLossConfig {
    /// Weight of the depth loss relative to the terms that are learned from video. 0 with `depth_net.uncertainty`: only the uncertainty
    /// head learns.
    pub weight: f64,
    /// λ_g of the differences between neighbouring pixels, which make edges sharp.
    pub gradient: f64,
}

impl Default for DepthLossConfig {
    fn default() -> Self {
        Self {
            weight: 1.0,
            gradient: 0.5,
        }
    }
}

/// The terms of the optical flow (Eq. 16–20), all within L_flow except the agreement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FlowLossConfig {
    /// λ_f of the flow loss; 0 trains no flow decoder.
    pub weight: f64,
    /// Weight of the consistency L_c relative to the photometric terms (0.1 in the paper).
    pub consistency: f64,
    /// Weight of the flow's edge-aware smoothness relative to the photometric terms.
    pub smoothness: f64,
    /// Weight, in the total loss, of the agreement between flow and rigid flow where both explain the pixel, per pixel of distance. It
    /// applies from when dynamic pixels are looked for.
    pub agreement: f64,
}

impl Default for FlowLossConfig {
    /// Off; the other weights are those that [`LossConfig::with`] sets.
    fn default() -> Self {
        Self {
            weight: 0.0,
            consistency: 0.1,
            smoothness: 0.05,
            agreement: 0.002,
        }
    }
}

/// Which pixels count as dynamic, and are therefore taken out of the rigid reprojection.
///
/// These are pixels that the flow explains better than the rigid warp by `margin`, while the two flows differ by more than `min_flow_px`
/// and `min_flow_share`. The flow also has to leave the epipolar line by `min_epipolar_px`, or go along it `min_parallax_ratio` times as
/// far as the depth says, or as little. If neither limit is set, neither is checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MovingConfig {
    /// Whether to look for dynamic pixels; needs the flow.
    pub enabled: bool,
    /// How much smaller the flow's photometric error must be than the rigid warp's.
    pub margin: f64,
    /// Smallest distance between flow and rigid flow, in pixels of the training size.
    pub min_flow_px: f64,
    /// Smallest distance between flow and rigid flow, as a share of the longer of the two.
    pub min_flow_share: f64,
    /// Distance of the flow's end from the motion's epipolar line, in pixels, from which a pixel cannot be static; 0: not checked.
    pub min_epipolar_px: f64,
    /// Ratio of the flow's parallax to that of the predicted depth, or the inverse, from which a pixel cannot be static; 0: not checked.
    /// Whatever drives along the road moves along its epipolar lines.
    pub min_parallax_ratio: f64,
    /// Share of the run before which no pixel is taken out, because the flow has to be learned first.
    pub warmup_share: f64,
}

impl Default for MovingConfig {
    /// Off, with the usual limits.
    fn default() -> Self {
        Self {
            enabled: false,
            margin: 0.02,
            min_flow_px: 1.0,
            min_flow_share: 0.05,
            min_epipolar_px: 1.0,
            min_parallax_ratio: 1.5,
            warmup_share: 0.25,
        }
    }
}

impl LossConfig {
    /// The names that [`Self::with`] and [`Self::without`] take.
    pub const TERMS: [&'static str; 6] = [
        "smoothness",
        "speed",
        "automask",
        "affine",
        "flow",
        "moving",
    ];

    /// Weights λ that [`Self::with`] sets: the paper's.
    const SMOOTHNESS: f64 = 1e-3;
    const SPEED: f64 = 0.2;
    const AFFINE: f64 = 0.01;
    const FLOW: f64 = 0.1;

    /// All terms switched on.
    #[must_use]
    #[expect(clippy::expect_used, reason = "a list of its own names")]
    pub fn with_every_term(mut self) -> Self {
        for term in Self::TERMS {
            self.with(term).expect("TERMS are the names that it takes");
        }
        self
    }

    /// Switches a term on by its name, at the paper's weight unless it already has one. `moving` also switches the flow on.
    ///
    /// # Errors
    /// [`Error::Config`] for a name that is not in [`Self::TERMS`].
    pub fn with(&mut self, term: &str) -> Result<(), Error> {
        let switch_on = |weight: &mut f64, value: f64| {
            if *weight == 0.0 {
                *weight = value;
            }
        };
        match term {
            "smoothness" => switch_on(&mut self.smoothness, Self::SMOOTHNESS),
            "speed" => switch_on(&mut self.speed, Self::SPEED),
            "automask" => self.automask = true,
            "affine" => switch_on(&mut self.affine, Self::AFFINE),
            "flow" => switch_on(&mut self.flow.weight, Self::FLOW),
            "moving" => {
                switch_on(&mut self.flow.weight, Self::FLOW);
                self.moving.enabled = true;
            }
            _ => return Err(unknown("with", term)),
        }
        Ok(())
    }

    /// Switches a term off by its name. Without the flow, dynamic pixels cannot be found, so `moving` is switched off too.
    ///
    /// # Errors
    /// [`Error::Config`] for a name that is not in [`Self::TERMS`].
    pub fn without(&mut self, term: &str) -> Result<(), Error> {
        match term {
            "smoothness" => self.smoothness = 0.0,
            "speed" => self.speed = 0.0,
            "automask" => self.automask = false,
            "affine" => self.affine = 0.0,
            "flow" => {
                self.flow.weight = 0.0;
                self.moving.enabled = false;
            }
            "moving" => self.moving.enabled = false,
            _ => return Err(unknown("without", term)),
        }
        Ok(())
    }

    /// # Errors
    /// [`Error::Config`] naming the first invalid weight.
    pub fn validate(&self) -> Result<(), Error> {
        let weights = [
            ("loss.smoothness", self.smoothness),
            ("loss.speed", self.speed),
            ("loss.rotation", self.rotation),
            ("loss.explainability", self.explainability),
            ("loss.affine", self.affine),
            ("loss.flow.weight", self.flow.weight),
            ("loss.flow.consistency", self.flow.consistency),
            ("loss.flow.smoothness", self.flow.smoothness),
            ("loss.flow.agreement", self.flow.agreement),
            ("loss.moving.margin", self.moving.margin),
            ("loss.moving.min_flow_px", self.moving.min_flow_px),
            ("loss.moving.min_epipolar_px", self.moving.min_epipolar_px),
            ("loss.depth.weight", self.depth.weight),
            ("loss.depth.gradient", self.depth.gradient),
            (
                "loss.moving.min_parallax_ratio",
                self.moving.min_parallax_ratio,
            ),
        ];
        for (field, weight) in weights {
            if !(weight >= 0.0 && weight.is_finite()) {
                let expected = ExpectedSetting::NotNegative;
                return Err(Error::config(field, expected, weight.to_string()));
            }
        }
        for (field, share) in [
            ("loss.ssim_weight", self.ssim_weight),
            ("loss.moving.min_flow_share", self.moving.min_flow_share),
            ("loss.moving.warmup_share", self.moving.warmup_share),
        ] {
            if !(0.0..=1.0).contains(&share) {
                let expected = ExpectedSetting::Within { from: 0.0, to: 1.0 };
                return Err(Error::config(field, expected, share.to_string()));
            }
        }
        if self.moving.enabled && self.flow.weight == 0.0 {
            let found = "true".to_owned();
            return Err(Error::config("loss.moving.enabled", AskedBy::NoFlow, found));
        }
        Ok(())
    }
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde hands out references"
)]
fn is_zero(weight: &f64) -> bool {
    *weight == 0.0
}

fn unknown(field: &'static str, term: &str) -> Error {
    let known = LossConfig::TERMS.map(str::to_owned).to_vec();
    Error::config(field, ExpectedSetting::OneOf(known), term.to_owned())
}

#[cfg(test)]
mod tests {
    use crate::{Error, Preset};

    #[test]
    fn terms_are_switched_by_name() {
        let start = Preset::Light.config().loss;
        let mut loss = start.clone();
        for term in super::LossConfig::TERMS {
            loss.with(term).unwrap();
        }
        loss.validate().unwrap();
        assert!(loss.moving.enabled && loss.flow.weight == 0.1 && loss.affine == 0.01);
        loss.without("flow").unwrap();
        assert!(!loss.moving.enabled && loss.flow.weight == 0.0);
        loss.with("moving").unwrap();
        assert!(loss.moving.enabled && loss.flow.weight == 0.1);
        for term in super::LossConfig::TERMS {
            loss.without(term).unwrap();
        }
        assert_eq!((loss.speed, loss.smoothness, loss.affine), (0.0, 0.0, 0.0));
        // A weight that is already set stays.
        let mut own = start;
        own.speed = 0.7;
        own.with("speed").unwrap();
        assert_eq!(own.speed, 0.7);
    }

    #[test]
    fn invalid_weights_are_refused_by_field() {
        let start = Preset::Light.config().loss;
        let field = |change: fn(&mut super::LossConfig)| {
            let mut loss = start.clone();
            change(&mut loss);
            match loss.validate() {
                Err(Error::Config { field, .. }) => field,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(field(|l| l.affine = -1.0), "loss.affine");
        assert_eq!(field(|l| l.flow.weight = f64::NAN), "loss.flow.weight");
        assert_eq!(field(|l| l.moving.enabled = true), "loss.moving.enabled");
        let share = "loss.moving.warmup_share";
        assert_eq!(field(|l| l.moving.warmup_share = 1.5), share);
        let mut loss = start.clone();
        let error = loss.without("hope").unwrap_err().to_string();
        assert!(error.contains("automask, affine, flow"), "{error}");
    }
}
