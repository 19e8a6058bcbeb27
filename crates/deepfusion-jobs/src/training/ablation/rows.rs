use deepfusion_model::{Error, ExpectedSetting, Reprojection, TrainConfig};
use serde::{Deserialize, Serialize};

/// A row of the table: which parts are switched on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Row {
    /// Hierarchical context encoding.
    pub hce: bool,
    /// The speed loss.
    pub speed: bool,
    /// The flow loss.
    pub flow: bool,
    /// Three frames and the minimum of their errors, instead of two frames in both directions.
    pub minimum: bool,
}

impl Row {
    /// The rows of the paper's Table 3: everything on first, then those that lack something.
    #[must_use]
    pub fn table_3() -> Vec<Self> {
        let combination = |off: u8| Self {
            hce: off & 1 == 0,
            speed: off & 2 == 0,
            flow: off & 4 == 0,
            minimum: false,
        };
        (0..8).map(combination).collect()
    }

    /// All rows that can be requested: those of Table 3, and everything on with three frames.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let three_frames = Self {
            hce: true,
            speed: true,
            flow: true,
            minimum: true,
        };
        Self::table_3().into_iter().chain([three_frames]).collect()
    }

    /// The rows with these names; without names, those of the paper's table.
    ///
    /// # Errors
    /// [`Error::Config`] for an unknown row.
    pub fn named(names: &[String]) -> Result<Vec<Self>, Error> {
        if names.is_empty() {
            return Ok(Self::table_3());
        }
        let all = Self::all();
        let find = |name: &String| {
            let row = all.iter().find(|row| row.name() == *name).copied();
            row.ok_or_else(|| {
                let known = all.iter().map(|row| row.name()).collect();
                Error::config("rows", ExpectedSetting::OneOf(known), name.clone())
            })
        };
        names.iter().map(find).collect()
    }

    /// Its name in file names: the parts that are on, joined by `+`; `none`, or `minimum` for the row with three frames.
    #[must_use]
    pub fn name(self) -> String {
        if self.minimum {
            return "minimum".into();
        }
        let parts = [
            ("hce", self.hce),
            ("speed", self.speed),
            ("flow", self.flow),
        ];
        let on: Vec<_> = parts
            .iter()
            .filter(|(_, on)| *on)
            .map(|(n, _)| *n)
            .collect();
        if on.is_empty() {
            "none".into()
        } else {
            on.join("+")
        }
    }

    /// The settings of the row, from those that all rows share. Only the row's parts differ: the pose used for warping is the same in every
    /// row, so that a row without the speed loss lacks only that loss. Only the masks of dynamic pixels are switched with the flow, since
    /// they are made from it.
    ///
    /// # Errors
    /// [`Error::Config`] if the shared settings contradict the row's.
    pub fn config(self, shared: &TrainConfig) -> Result<TrainConfig, Error> {
        let mut config = shared.clone();
        for (on, term) in [
            (self.hce, "hce"),
            (self.flow, "flow"),
            (self.speed, "speed"),
        ] {
            if on {
                config.with(term)?;
            } else {
                config.without(term)?;
            }
        }
        config.view_motion = shared.view_motion;
        if self.minimum {
            (config.reprojection, config.frames) = (Reprojection::Minimum, vec![-1, 1]);
            // It compares the depths of both frames, but with three frames only the target has depth.
            config.loss.affine = 0.0;
        }
        config.validate()?;
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_model::{Preset, ViewMotion};
    use std::collections::HashSet;

    fn shared(preset: Preset) -> TrainConfig {
        TrainConfig {
            view_motion: ViewMotion::PoseNet,
            ..preset.config()
        }
    }

    #[test]
    fn rows_differ_only_in_their_parts() {
        let shared = shared(Preset::Light);
        assert_eq!(Row::table_3().len(), 8);
        let rows = Row::all();
        let names: HashSet<String> = rows.iter().map(|row| row.name()).collect();
        assert_eq!(names.len(), 9, "{names:?}");
        assert_eq!(
            (rows[0].name(), rows[7].name()),
            ("hce+speed+flow".into(), "none".into())
        );
        for row in rows {
            let config = row.config(&shared).unwrap();
            assert_eq!(config.depth_net.hce.is_some(), row.hce);
            assert_eq!(config.loss.speed > 0.0, row.speed);
            assert_eq!(config.loss.flow.weight > 0.0, row.flow);
            assert_eq!(config.size, shared.size);
            let frames = if row.minimum { 3 } else { 2 };
            assert_eq!(1 + config.frames.len(), frames);
        }
    }

    /// A row switches only its own part: not attention with HCE, not masks with the flow, not the pose used for warping with the speed
    /// loss.
    #[test]
    fn a_row_lacks_only_its_own_part() {
        for preset in [Preset::Light, Preset::Paper] {
            let mut shared = shared(preset);
            shared.loss.moving.enabled = false;
            let full = Row::table_3()[0].config(&shared).unwrap();
            for row in Row::table_3() {
                let mut config = row.config(&shared).unwrap();
                if !row.hce {
                    config.depth_net.hce.clone_from(&full.depth_net.hce);
                }
                if !row.speed {
                    config.loss.speed = full.loss.speed;
                }
                if !row.flow {
                    config.loss.flow.weight = full.loss.flow.weight;
                }
                assert_eq!(config, full, "{preset}, {}", row.name());
            }
        }
    }

    /// Masks of dynamic pixels that all rows share are made from the flow: without it they are off.
    #[test]
    fn masks_are_switched_off_with_the_flow() {
        let shared = shared(Preset::Paper);
        assert!(shared.loss.moving.enabled);
        for row in Row::table_3() {
            let config = row.config(&shared).unwrap();
            assert_eq!(config.loss.moving.enabled, row.flow, "{}", row.name());
        }
    }

    /// With measured motion for warping, a row without the speed loss would still learn from speed, so it is refused.
    #[test]
    fn a_row_without_the_speed_loss_takes_no_measured_pose() {
        let mut shared = shared(Preset::Light);
        shared.view_motion = ViewMotion::Distance;
        for row in Row::table_3() {
            assert_eq!(row.config(&shared).is_ok(), row.speed, "{}", row.name());
        }
    }
}
