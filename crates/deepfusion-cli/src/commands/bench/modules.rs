//! What each part of a run's networks costs, as a table.

use deepfusion_model::{ModuleCost, TrainConfig};
use serde::Serialize;

/// A part of the networks, as `--json` prints it.
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

impl From<&ModuleCost> for Module {
    fn from(cost: &ModuleCost) -> Self {
        Self {
            name: cost.name.clone(),
            parameters: cost.parameters,
            multiply_adds: cost.multiply_adds,
            weights_mb: cost.weights_mb(),
            values_mb: cost.values_mb(),
        }
    }
}

/// The depth network's parts in the order in which they run, and the pose network, which only trains.
#[derive(Debug)]
pub(super) struct Modules {
    depth: Vec<ModuleCost>,
    pose: ModuleCost,
}

impl Modules {
    pub(super) fn new(config: &TrainConfig) -> Self {
        Self {
            depth: config.depth_net.costs(config.size),
            pose: config.pose_net.cost(config.size),
        }
    }

    /// The depth network as one.
    pub(super) fn whole(&self) -> ModuleCost {
        ModuleCost::sum("depth network", &self.depth)
    }

    /// All of them.
    pub(super) fn list(&self) -> Vec<Module> {
        let all = self.depth.iter().chain([&self.pose]);
        all.map(Module::from).collect()
    }

    pub(super) fn table(&self) -> String {
        let row = |m: &ModuleCost| {
            format!(
                "{:18} {:10.3} {:12.3} {:11.1} {:10.1}\n",
                m.name,
                m.parameters as f64 / 1e6,
                m.multiply_adds as f64 / 1e9,
                m.weights_mb(),
                m.values_mb()
            )
        };
        let head = format!(
            "{:18} {:>10} {:>12} {:>11} {:>10}\n",
            "module", "M params", "G mult-adds", "weights MB", "values MB"
        );
        let parts: String = self.depth.iter().map(row).collect();
        format!("{head}{parts}{}{}", row(&self.whole()), row(&self.pose))
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
        let whole = modules.whole();
        let all = modules.list();
        let (pose, depth) = all.split_last().unwrap();
        assert_eq!(pose.name, "pose_net");
        assert_eq!(
            depth.iter().map(|m| m.parameters).sum::<u64>(),
            whole.parameters
        );
        assert_eq!(
            depth.iter().map(|m| m.multiply_adds).sum::<u64>(),
            whole.multiply_adds
        );
    }
}
