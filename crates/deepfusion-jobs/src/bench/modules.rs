//! What each part of a run's networks costs, as a table.

use std::fmt;

use deepfusion_model::{ModuleCost, TrainConfig};
use serde::{Serialize, Serializer};

/// The depth network's parts in the order in which they run, and the pose network, which is only used in training: a table for people, a
/// list for scripts.
#[derive(Debug, Clone)]
pub struct ModuleCosts {
    depth: Vec<ModuleCost>,
    pose: ModuleCost,
}

impl ModuleCosts {
    /// The costs for a configuration.
    #[must_use]
    pub fn new(config: &TrainConfig) -> Self {
        Self {
            depth: config.depth_net.costs(config.size),
            pose: config.pose_net.cost(config.size),
        }
    }

    /// The sum over the depth network.
    #[must_use]
    pub fn depth_network(&self) -> ModuleCost {
        ModuleCost::sum("depth network", &self.depth)
    }

    /// All parts of both networks.
    fn all(&self) -> impl Iterator<Item = &ModuleCost> {
        self.depth.iter().chain([&self.pose])
    }
}

/// A part of the networks, as written for scripts.
#[derive(Serialize)]
struct ModuleRecord<'a> {
    name: &'a str,
    /// Number of learned parameters.
    parameters: u64,
    /// Number for one image; the pose network's for a pair of images.
    multiply_adds: u64,
    /// Size of its parameters in f32.
    weights_mb: f64,
    /// Size of its operations' outputs for one image, in f32. The fused engine's buffers share memory; a training step keeps more.
    values_mb: f64,
}

impl<'a> From<&'a ModuleCost> for ModuleRecord<'a> {
    fn from(cost: &'a ModuleCost) -> Self {
        Self {
            name: &cost.name,
            parameters: cost.parameters,
            multiply_adds: cost.multiply_adds,
            weights_mb: cost.weights_mb(),
            values_mb: cost.values_mb(),
        }
    }
}

impl Serialize for ModuleCosts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.all().map(ModuleRecord::from))
    }
}

impl fmt::Display for ModuleCosts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:18} {:>10} {:>12} {:>11} {:>10}",
            "module", "M params", "G mult-adds", "weights MB", "values MB"
        )?;
        let parts = self.depth.iter().cloned();
        let rows = parts.chain([self.depth_network(), self.pose.clone()]);
        for row in rows {
            writeln!(
                f,
                "{:18} {:10.3} {:12.3} {:11.1} {:10.1}",
                row.name,
                row.parameters as f64 / 1e6,
                row.multiply_adds as f64 / 1e9,
                row.weights_mb(),
                row.values_mb()
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_model::Preset;

    #[test]
    fn the_papers_parts_are_complete_and_add_up() {
        let modules = ModuleCosts::new(&Preset::Paper.config());
        let table = modules.to_string();
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
        let total = modules.depth_network();
        let all: Vec<_> = modules.all().collect();
        let (pose, depth) = all.split_last().unwrap();
        assert_eq!(pose.name, "pose_net");
        assert_eq!(
            depth.iter().map(|m| m.parameters).sum::<u64>(),
            total.parameters
        );
        assert_eq!(
            depth.iter().map(|m| m.multiply_adds).sum::<u64>(),
            total.multiply_adds
        );
    }
}
