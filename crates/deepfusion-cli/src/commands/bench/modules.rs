//! What each part of a run's networks costs, as a table.

use deepfusion_model::ModuleCost;
use deepfusion_model::TrainConfig;
use serde::Serialize;

/// A part of the networks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Module {
    name: String,
    /// Numbers that are learned.
    parameters: u64,
    /// For one image; the pose network's for one pair.
    multiply_adds: u64,
    /// Its parameters in f32.
    weights_mb: f64,
    /// What its operations give for one image, in f32. The fused engine's buffers share memory, a training step
    /// keeps more.
    values_mb: f64,
}

impl From<ModuleCost> for Module {
    fn from(cost: ModuleCost) -> Self {
        let megabytes = |numbers: u64| numbers as f64 * 4.0 / (1024.0 * 1024.0);
        Self {
            weights_mb: megabytes(cost.parameters),
            values_mb: megabytes(cost.values),
            name: cost.name,
            parameters: cost.parameters,
            multiply_adds: cost.multiply_adds,
        }
    }
}

/// The depth network's parts in the order in which they run, and the pose network, which only trains.
#[derive(Debug)]
pub(super) struct Modules {
    pub depth: Vec<Module>,
    pub pose: Module,
}

impl Modules {
    pub(super) fn new(config: &TrainConfig) -> Self {
        let depth = config.depth_net.costs(config.size);
        Self {
            depth: depth.into_iter().map(Module::from).collect(),
            pose: config.pose_net.cost(config.size).into(),
        }
    }

    /// Of the depth network.
    pub(super) fn parameters(&self) -> u64 {
        self.depth.iter().map(|m| m.parameters).sum()
    }

    /// Of the depth network, for one image.
    pub(super) fn multiply_adds(&self) -> u64 {
        self.depth.iter().map(|m| m.multiply_adds).sum()
    }

    /// All of them.
    pub(super) fn into_list(self) -> Vec<Module> {
        self.depth.into_iter().chain([self.pose]).collect()
    }

    pub(super) fn table(&self) -> String {
        let row = |m: &Module| {
            format!(
                "{:18} {:10.3} {:12.3} {:11.1} {:10.1}\n",
                m.name,
                m.parameters as f64 / 1e6,
                m.multiply_adds as f64 / 1e9,
                m.weights_mb,
                m.values_mb
            )
        };
        let sum = |of: fn(&Module) -> f64| self.depth.iter().map(of).sum();
        let whole = Module {
            name: "depth network".into(),
            parameters: self.parameters(),
            multiply_adds: self.multiply_adds(),
            weights_mb: sum(|m| m.weights_mb),
            values_mb: sum(|m| m.values_mb),
        };
        let head = format!(
            "{:18} {:>10} {:>12} {:>11} {:>10}\n",
            "module", "M params", "G mult-adds", "weights MB", "values MB"
        );
        let parts: String = self.depth.iter().map(row).collect();
        format!("{head}{parts}{}{}", row(&whole), row(&self.pose))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_model::Preset;

    #[test]
    fn the_papers_parts_are_all_there_and_add_up() {
        let modules = Modules::new(&Preset::Paper.config());
        let table = modules.table();
        for part in [
            "encoder.stem",
            "encoder.layer4",
            "hce.3",
            "attention.3",
            "aggregation",
        ] {
            assert!(table.contains(part), "{table}");
        }
        for part in [
            "decoder.stages.4",
            "decoder.heads",
            "depth network",
            "pose_net",
        ] {
            assert!(table.contains(part), "{table}");
        }
        let (parameters, multiply_adds) = (modules.parameters(), modules.multiply_adds());
        let all = modules.into_list();
        let (pose, depth) = all.split_last().unwrap();
        assert_eq!(pose.name, "pose_net");
        assert_eq!(depth.iter().map(|m| m.parameters).sum::<u64>(), parameters);
        assert_eq!(
            depth.iter().map(|m| m.multiply_adds).sum::<u64>(),
            multiply_adds
        );
    }
}
