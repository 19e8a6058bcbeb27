use serde::{Deserialize, Serialize};

use crate::{Error, ExpectedProtocolSetting as Expected, Result};

/// The part of the image that is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Crop {
    /// The whole image.
    #[default]
    None,
    /// The crop of Garg et al., the field's default for KITTI raw.
    Garg,
}

impl Crop {
    /// Its name, on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Garg => "garg",
        }
    }

    /// The rows and columns compared in an image of `width` × `height`: half-open ranges of whole pixels. Fractions are truncated, as in
    /// the field's scripts.
    #[must_use]
    pub fn window(
        self,
        width: usize,
        height: usize,
    ) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        match self {
            Self::None => (0..height, 0..width),
            Self::Garg => {
                let cut = |fraction: f64, size: usize| (fraction * size as f64) as usize;
                (
                    cut(0.408_108_11, height)..cut(0.991_891_89, height),
                    cut(0.035_947_71, width)..cut(0.964_052_29, width),
                )
            }
        }
    }
}

/// The scaling of the headline metrics. Unscaled and median-scaled metrics are always both reported.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Scaling {
    /// Metres as predicted: the headline of a metric method.
    #[default]
    None,
    /// Each prediction is multiplied by median(gt) / median(prediction).
    Median,
    /// Each prediction is multiplied by this factor; reported as an additional row.
    Fixed(f64),
}

/// What to do with predicted values that are not valid depths (NaN, infinite, zero or negative).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Holes {
    /// Report an error that names the image: the default, since networks produce no holes.
    #[default]
    Refuse,
    /// Treat them as "no prediction": left out of the metrics and counted in `missing_rate`.
    Skip,
}

/// The kind of depth in the ground truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GroundTruth {
    /// Camera z.
    #[default]
    Z,
    /// Forward distance from the velodyne, as in the field's `eigen` files.
    Velodyne,
    /// KITTI's annotated depth (camera z, accumulated over eleven scans and checked against stereo): the field's `eigen_benchmark`.
    Annotated,
}

impl GroundTruth {
    /// A description in words.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Z => "camera z",
            Self::Velodyne => "the velodyne's forward distance",
            Self::Annotated => "KITTI's annotated depth",
        }
    }
}

/// How predictions are compared with ground truth (docs/concepts/evaluation.md).
#[derive(Debug, Clone, PartialEq)]
pub struct Protocol {
    /// The part of the image that is compared.
    pub crop: Crop,
    /// Ground truth at or beyond this depth is left out, and predictions are clamped to it. In metres.
    pub cap_m: f64,
    /// Ground truth at or below this depth is left out, and predictions are clamped to it. In metres, above 0.
    pub min_m: f64,
    /// The kind of depth in the ground truth; only recorded.
    pub gt: GroundTruth,
    /// The scaling of the headline metrics.
    pub scaling: Scaling,
    /// What to do with predicted values that are not valid depths.
    pub holes: Holes,
    /// Number of pixels drawn for the point statistics (the paper's Fig. 11); 0 = none.
    pub points: usize,
    /// Seed for drawing the points.
    pub points_seed: u64,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Default for Protocol {
    /// The whole image, 1e-3 to 80 m, camera z, unscaled.
    fn default() -> Self {
        Self {
            crop: Crop::None,
            cap_m: 80.0,
            min_m: 1e-3,
            gt: GroundTruth::Z,
            scaling: Scaling::None,
            holes: Holes::Refuse,
            points: 0,
            points_seed: 0,
            seed: 0,
        }
    }
}

impl Protocol {
    /// Checks that the protocol can measure something.
    ///
    /// # Errors
    /// [`Error::Protocol`], naming the field.
    pub fn validate(&self) -> Result<()> {
        let fail = |field, value: f64, expected| {
            Err(Error::Protocol {
                field,
                value: value.to_string(),
                expected,
            })
        };
        if !(self.min_m.is_finite() && self.min_m > 0.0) {
            return fail("the minimum depth", self.min_m, Expected::Metres);
        }
        if !(self.cap_m.is_finite() && self.cap_m > self.min_m) {
            return fail("the cap", self.cap_m, Expected::MetresAboveMinimum);
        }
        if let Scaling::Fixed(factor) = self.scaling
            && !(factor.is_finite() && factor > 0.0)
        {
            return fail("the fixed scale", factor, Expected::Factor);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_garg_crop_equals_the_usual_one() {
        // Monodepth2 and its successors print [153, 371) × [44, 1197) for 375×1242.
        assert_eq!(Crop::Garg.window(1242, 375), (153..371, 44..1197));
        assert_eq!(Crop::None.window(1242, 375), (0..375, 0..1242));
    }

    #[test]
    fn protocols_that_measure_nothing_are_refused() {
        let ok = Protocol::default();
        assert!(ok.validate().is_ok());
        for bad in [
            Protocol {
                min_m: 0.0,
                ..ok.clone()
            },
            Protocol {
                min_m: f64::NAN,
                ..ok.clone()
            },
            Protocol {
                cap_m: 1e-4,
                ..ok.clone()
            },
            Protocol {
                cap_m: f64::INFINITY,
                ..ok.clone()
            },
            Protocol {
                scaling: Scaling::Fixed(-1.0),
                ..ok.clone()
            },
        ] {
            assert!(bad.validate().is_err(), "{bad:?}");
        }
    }

    #[test]
    fn expected_settings_as_text() {
        let with = |min_m, cap_m, scaling| Protocol {
            min_m,
            cap_m,
            scaling,
            ..Protocol::default()
        };
        for (protocol, text) in [
            (
                with(0.0, 80.0, Scaling::None),
                "the minimum depth is 0, expected metres above 0",
            ),
            (
                with(0.5, 0.25, Scaling::None),
                "the cap is 0.25, expected metres above the minimum depth",
            ),
            (
                with(0.5, 80.0, Scaling::Fixed(-1.0)),
                "the fixed scale is -1, expected a factor above 0",
            ),
        ] {
            assert_eq!(protocol.validate().unwrap_err().to_string(), text);
        }
    }
}
