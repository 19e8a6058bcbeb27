use deepfusion_train::{Error, Reprojection, TrainConfig};
use serde::{Deserialize, Serialize};

/// One row of the table: what is switched on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Row {
    /// Hierarchical context encoding, with the attention that works on it.
    pub hce: bool,
    /// The speed loss, and with it every measured motion.
    pub speed: bool,
    /// The flow loss, and with it the masks of what moves.
    pub flow: bool,
    /// Three frames and the minimum of their errors, instead of two frames in both directions.
    pub minimum: bool,
}

impl Row {
    /// The full system first, then everything that lacks something, then the full system with three frames.
    pub fn all() -> Vec<Self> {
        let combinations = (0..8_u8).map(|off| Self {
            hce: off & 1 == 0,
            speed: off & 2 == 0,
            flow: off & 4 == 0,
            minimum: false,
        });
        let three_frames = Self {
            hce: true,
            speed: true,
            flow: true,
            minimum: true,
        };
        combinations.chain([three_frames]).collect()
    }

    /// Its name in file names and on the command line: what is on, joined by `+`; `none`, or `minimum` for the row with
    /// three frames.
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

    /// The settings of the row, from those that all rows share.
    pub fn config(self, shared: &TrainConfig) -> Result<TrainConfig, Error> {
        let mut config = shared.clone();
        let parts = [
            (self.hce, &["hce", "attention"][..]),
            (self.flow, &["flow", "moving"][..]),
            (self.speed, &["speed"][..]),
        ];
        for (on, terms) in parts {
            for term in terms {
                if on {
                    config.with(term)?;
                } else {
                    config.without(term)?;
                }
            }
        }
        if self.minimum {
            (config.reprojection, config.frames) = (Reprojection::Minimum, vec![-1, 1]);
            // It compares the depths of both frames, and three frames have the target's alone.
            config.loss.affine = 0.0;
        }
        config.validate()?;
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_train::Preset;
    use std::collections::HashSet;

    #[test]
    fn every_row_is_another_configuration_of_the_same_rest() {
        let shared = Preset::Light.config();
        let rows = Row::all();
        assert_eq!(rows.len(), 9);
        let names: HashSet<String> = rows.iter().map(|row| row.name()).collect();
        assert_eq!(names.len(), 9, "{names:?}");
        assert_eq!(
            (rows[0].name(), rows[7].name()),
            ("hce+speed+flow".into(), "none".into())
        );
        for row in rows {
            let config = row.config(&shared).unwrap();
            assert_eq!(config.loss.speed > 0.0, row.speed);
            assert_eq!(config.loss.flow.weight > 0.0, row.flow);
            assert_eq!(config.loss.moving.enabled, row.flow);
            assert_eq!(config.size, shared.size);
            let frames = if row.minimum { 3 } else { 2 };
            assert_eq!(1 + config.frames.len(), frames);
        }
    }
}
