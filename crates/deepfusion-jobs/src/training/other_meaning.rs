//! Warns of weights that have another meaning in the network that starts from them.

use deepfusion_geometry::DepthRange;
use deepfusion_model::{InputNormalisation, TrainConfig};

use super::pose_unit::mixed_units;

/// Why weights do not quite fit a network: it reads images or represents depth in another way than the one they were trained in.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OtherMeaning {
    /// Images are normalised in another way.
    #[error(
        "the weights to start from were trained on images normalised as {}, but this configuration has {}: \
         set depth_net.encoder.normalisation={} to keep what they have learned",
        name(*was),
        name(*is),
        name(*was)
    )]
    Normalisation {
        /// The normalisation for the weights.
        was: InputNormalisation,
        /// The normalisation in this configuration.
        is: InputNormalisation,
    },
    /// Depth is refined from another initial depth.
    #[error(
        "the weights to start from refine depth from {}, but this configuration refines it from {} (depth_net.initial_depth_m): they have to learn this again",
        initial(*was),
        initial(*is)
    )]
    InitialDepth {
        /// The initial depth for the weights in metres; `None`: the middle of the range.
        was: Option<f64>,
        /// The initial depth in this configuration.
        is: Option<f64>,
    },
    /// The range of depths differs.
    #[error(
        "the weights to start from predict depths of {} to {} m, but this configuration has {} to {} m: \
         set depth_net.range.min_m={} and depth_net.range.max_m={} to keep their scale",
        was.min_m,
        was.max_m,
        is.min_m,
        is.max_m,
        was.min_m,
        was.max_m
    )]
    Range {
        /// The range of the weights.
        was: DepthRange,
        /// The range of this configuration.
        is: DepthRange,
    },
    /// PoseNet's motions have several units, one for each data set that it was trained on.
    #[error(
        "the PoseNet to start from has units of {least_m} m to {most_m} m for its data sets, and these recordings belong to none of them: \
         it takes their mean and has to learn the scale again (set metres_per_unit to the unit of one set to keep that)"
    )]
    PoseUnits {
        /// The smallest unit, in metres.
        least_m: f64,
        /// The largest unit, in metres.
        most_m: f64,
    },
}

impl OtherMeaning {
    /// All differences. If only the encoders were trained, there are no depths yet.
    pub(super) fn all(theirs: &TrainConfig, own: &TrainConfig, depth_learned: bool) -> Vec<Self> {
        let mut all = Vec::new();
        let of = |config: &TrainConfig| config.depth_net.encoder.normalisation;
        let (was, is) = (of(theirs), of(own));
        if was != is {
            all.push(Self::Normalisation { was, is });
        }
        let refined = |config: &TrainConfig| {
            let net = &config.depth_net;
            net.r_msfm.as_ref().map(|_| net.initial_depth_m)
        };
        if let (true, Some(was), Some(is)) = (depth_learned, refined(theirs), refined(own))
            && was != is
        {
            all.push(Self::InitialDepth { was, is });
        }
        // A range given for a data set is intended.
        let own_range = own.data.sets.iter().any(|set| set.range.is_some());
        let one_range = theirs.data.sets.len() <= 1 && !own_range;
        let (was, is) = (theirs.factors(0).0, own.factors(0).0);
        if depth_learned && one_range && was != is {
            all.push(Self::Range { was, is });
        }
        all
    }

    /// The difference for a PoseNet that a run starts from.
    pub(super) fn of_pose_net(theirs: &TrainConfig, own: &TrainConfig) -> Option<Self> {
        let [least_m, most_m] = mixed_units(theirs, own)?;
        Some(Self::PoseUnits { least_m, most_m })
    }
}

fn name(normalisation: InputNormalisation) -> String {
    format!("{normalisation:?}").to_lowercase()
}

fn initial(metres: Option<f64>) -> String {
    metres.map_or("the middle of the range".into(), |m| format!("{m} m"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_model::Preset;

    #[test]
    fn differences_are_reported_if_depth_was_trained() {
        let theirs = Preset::RMsfm3.config();
        assert!(OtherMeaning::all(&theirs, &theirs, true).is_empty());
        let mut own = theirs.clone();
        own.depth_net.encoder.normalisation = InputNormalisation::Centred;
        own.depth_net.initial_depth_m = Some(33.0);
        own.depth_net.range.max_m = 60.0;
        let warnings = |depth_learned| {
            let all = OtherMeaning::all(&theirs, &own, depth_learned);
            all.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        let all = warnings(true);
        let [images, initial, range] = all.as_slice() else {
            panic!("{all:?}")
        };
        assert!(
            images.contains("this configuration has centred"),
            "{images}"
        );
        assert!(
            initial.contains("this configuration refines it from 33 m"),
            "{initial}"
        );
        assert!(range.contains("to 60 m"), "{range}");
        assert_eq!(warnings(false), std::slice::from_ref(images));
    }
}
