//! The unit of a PoseNet's translations, for a run that starts from another run's PoseNet.

use deepfusion_model::{DataSetConfig, TrainConfig};

/// Fills in the units that a configuration leaves open, for a run that starts from another run's PoseNet; `theirs` is that run's
/// configuration, complete with its findings. A data set keeps the unit that it had there; any other gets the unit of that run, or the mean
/// of its units if there are several.
pub(super) fn inherit(theirs: &TrainConfig, config: &mut TrainConfig) {
    let common = common_unit(theirs).unwrap_or(theirs.pose_net.metres_per_unit);
    let fill = |open: &mut f64, unit: f64| {
        if *open == 0.0 {
            *open = unit;
        }
    };
    fill(&mut config.pose_net.metres_per_unit, common);
    for set in moving_sets_mut(config) {
        let unit = unit_of(theirs, &set.name).unwrap_or(common);
        fill(&mut set.metres_per_unit, unit);
    }
}

/// The smallest and the largest of a PoseNet's units, if a run that starts from it has recordings with none of these units, which get the
/// mean.
pub(super) fn mixed_units(theirs: &TrainConfig, own: &TrainConfig) -> Option<[f64; 2]> {
    let units: Vec<f64> = moving_sets(theirs).map(|set| set.metres_per_unit).collect();
    if units.is_empty() || common_unit(theirs).is_some() {
        return None;
    }
    let mean = theirs.pose_net.metres_per_unit;
    let has_mean = if own.data.sets.is_empty() {
        own.pose_net.metres_per_unit == mean
    } else {
        moving_sets(own)
            .any(|set| set.metres_per_unit == mean && unit_of(theirs, &set.name).is_none())
    };
    let least = units.iter().copied().fold(f64::INFINITY, f64::min);
    let most = units.iter().copied().fold(0.0, f64::max);
    has_mean.then_some([least, most])
}

/// The unit of all data sets of a run; `None` if they have several, or there are none.
fn common_unit(config: &TrainConfig) -> Option<f64> {
    let mut units = moving_sets(config).map(|set| set.metres_per_unit);
    let first = units.next()?;
    units.all(|unit| unit == first).then_some(first)
}

/// The unit of a data set, by its name.
fn unit_of(config: &TrainConfig, name: &str) -> Option<f64> {
    let mut sets = moving_sets(config);
    sets.find(|set| set.name == name)
        .map(|set| set.metres_per_unit)
}

/// The data sets whose motion is learned.
fn moving_sets(config: &TrainConfig) -> impl Iterator<Item = &DataSetConfig> {
    let sets = config.data.sets.iter();
    sets.filter(|set| set.learn.from_motion())
}

fn moving_sets_mut(config: &mut TrainConfig) -> impl Iterator<Item = &mut DataSetConfig> {
    let sets = config.data.sets.iter_mut();
    sets.filter(|set| set.learn.from_motion())
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_model::{Learn, Preset};

    /// A run with this unit and these data sets.
    fn run(unit: f64, sets: &[(&str, f64)]) -> TrainConfig {
        let mut config = Preset::Tiny.config();
        config.pose_net.metres_per_unit = unit;
        let set = |(name, metres_per_unit): &(&str, f64)| DataSetConfig {
            name: (*name).into(),
            metres_per_unit: *metres_per_unit,
            ..DataSetConfig::default()
        };
        config.data.sets = sets.iter().map(set).collect();
        config
    }

    /// The unit of PoseNet and those of the data sets in the new run.
    fn inherited(theirs: &TrainConfig, mut config: TrainConfig) -> (f64, Vec<f64>) {
        inherit(theirs, &mut config);
        let sets = config.data.sets.iter().map(|set| set.metres_per_unit);
        (config.pose_net.metres_per_unit, sets.collect())
    }

    #[test]
    fn data_sets_inherit_the_unit_of_a_run_without_data_sets() {
        let theirs = run(0.8, &[]);
        let mut config = run(0.0, &[("road", 0.0), ("garage", 0.1), ("streets", 0.0)]);
        config.data.sets[2].learn = Learn::Depth;
        // Given units stay; a set without motion needs none.
        assert_eq!(inherited(&theirs, config), (0.8, vec![0.8, 0.1, 0.0]));
        assert_eq!(inherited(&theirs, run(0.5, &[])), (0.5, vec![]));
    }

    #[test]
    fn a_run_without_data_sets_inherits_the_only_unit() {
        let mut theirs = run(0.7, &[("drives", 1.2), ("streets", 1.0)]);
        theirs.data.sets[1].learn = Learn::Depth;
        assert_eq!(inherited(&theirs, run(0.0, &[])), (1.2, vec![]));
        let other = run(0.0, &[("other", 0.0)]);
        assert_eq!(inherited(&theirs, other.clone()), (1.2, vec![1.2]));
        assert_eq!(mixed_units(&theirs, &other), None);
    }

    #[test]
    fn several_units_are_kept_by_name_or_reported() {
        let theirs = run(0.7, &[("road", 1.2), ("garage", 0.1)]);
        let mut known = run(0.0, &[("garage", 0.0), ("road", 0.0)]);
        inherit(&theirs, &mut known);
        assert_eq!(inherited(&theirs, known.clone()), (0.7, vec![0.1, 1.2]));
        assert_eq!(mixed_units(&theirs, &known), None);
        for mut own in [run(0.0, &[]), run(0.0, &[("road", 0.0), ("yard", 0.0)])] {
            inherit(&theirs, &mut own);
            assert_eq!(mixed_units(&theirs, &own), Some([0.1, 1.2]));
        }
        // A given unit is intended.
        assert_eq!(mixed_units(&theirs, &run(1.2, &[])), None);
        assert_eq!(mixed_units(&run(0.8, &[]), &run(0.8, &[])), None);
    }
}
