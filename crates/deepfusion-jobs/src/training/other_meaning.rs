//! Weights that mean something else in the network that begins with them.

use deepfusion_geometry::DepthRange;
use deepfusion_model::{InputNormalisation, TrainConfig};

use super::pose_unit::mixed_units;

/// How weights fit a network that reads images or says depths in another way than the one that they were learned in.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OtherMeaning {
    /// Images are normalised in another way.
    #[error(
        "the weights to start from were learned on images normalised as {}, this configuration has {}: \
         set depth_net.encoder.normalisation={} to keep what they know",
        name(*was),
        name(*is),
        name(*was)
    )]
    Normalisation {
        /// How they were.
        was: InputNormalisation,
        /// How they are.
        is: InputNormalisation,
    },
    /// Depth is refined from another one.
    #[error(
        "the weights to start from refine {}, this configuration {} (depth_net.initial_depth_m): they have to learn that anew",
        initial(*was),
        initial(*is)
    )]
    InitialDepth {
        /// From which it was, metres; `None`: the middle of the range.
        was: Option<f64>,
        /// From which it is.
        is: Option<f64>,
    },
    /// Depths are of another range.
    #[error(
        "the weights to start from say depths of {} to {} m, this configuration of {} to {} m: \
         set depth_net.range.min_m={} and depth_net.range.max_m={} to keep their metres",
        was.min_m,
        was.max_m,
        is.min_m,
        is.max_m,
        was.min_m,
        was.max_m
    )]
    Range {
        /// Of which they were.
        was: DepthRange,
        /// Of which they are.
        is: DepthRange,
    },
    /// PoseNet's motions are of several units, by the data sets that it learned from.
    #[error(
        "the PoseNet to start from says motions in units of {least_m} m to {most_m} m, by its data sets, and these recordings are none of those: \
         it takes their mean and has to learn the length anew (name the set's unit as metres_per_unit to keep it)"
    )]
    PoseUnits {
        /// The least of them, metres.
        least_m: f64,
        /// The largest.
        most_m: f64,
    },
}

impl OtherMeaning {
    /// All that differs. Where the encoders alone have learned, there are no depths yet.
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
        // A range that a data set names is meant.
        let own_range = own.data.sets.iter().any(|set| set.range.is_some());
        let one_range = theirs.data.sets.len() <= 1 && !own_range;
        let (was, is) = (theirs.factors(0).0, own.factors(0).0);
        if depth_learned && one_range && was != is {
            all.push(Self::Range { was, is });
        }
        all
    }

    /// The same of a PoseNet that is taken over.
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
    fn what_differs_is_said_where_depth_has_learned() {
        let theirs = Preset::RMsfm3.config();
        assert!(OtherMeaning::all(&theirs, &theirs, true).is_empty());
        let mut own = theirs.clone();
        own.depth_net.encoder.normalisation = InputNormalisation::Centred;
        own.depth_net.initial_depth_m = Some(33.0);
        own.depth_net.range.max_m = 60.0;
        let said = |depth_learned| {
            let all = OtherMeaning::all(&theirs, &own, depth_learned);
            all.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        let all = said(true);
        let [images, initial, range] = all.as_slice() else {
            panic!("{all:?}")
        };
        assert!(
            images.contains("this configuration has centred"),
            "{images}"
        );
        assert!(initial.contains("this configuration 33 m"), "{initial}");
        assert!(range.contains("to 60 m"), "{range}");
        assert_eq!(said(false), std::slice::from_ref(images));
    }
}
