//! Finds out whether networks have a common ancestor.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use deepfusion_model::{AveragedNetwork, RunFolder, TrainConfig};
use deepfusion_weights::Shipped;

/// The common origin of several networks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kinship {
    /// All were trained from one network, or one of them is that network.
    Network,
    /// Only the random weights of one seed that they began with. Such networks are usually not in one valley: their mean is often worse
    /// than each of them.
    FirstWeights,
    /// Nothing known. The mean of unrelated networks is useless.
    Unknown,
}

/// The common origin of networks, as far as their configurations record it: one of two networks was trained from the other, or both from a
/// third.
pub(super) fn kinship(networks: &[AveragedNetwork]) -> Kinship {
    let mut common: Option<HashSet<Ancestor>> = None;
    for network in networks {
        let mut found = HashSet::new();
        add(&network.path, network.sha256.as_deref(), &mut found);
        common = Some(match common {
            None => found,
            Some(common) => common.intersection(&found).cloned().collect(),
        });
    }
    let common = common.unwrap_or_default();
    let is_network = |ancestor: &Ancestor| matches!(ancestor, Ancestor::Network(_));
    if common.iter().any(is_network) {
        Kinship::Network
    } else if common.is_empty() {
        Kinship::Unknown
    } else {
        Kinship::FirstWeights
    }
}

/// A possible origin of a network.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Ancestor {
    /// A trained network: a run by its folder, a packed one by its checksum.
    Network(String),
    /// The first weights of a seed, by the settings that determine them.
    FirstWeights(String),
}

/// Adds a network and its ancestors. ImageNet's encoders are not an ancestor: the rest of the network came from a seed.
fn add(path: &Path, sha256: Option<&str>, found: &mut HashSet<Ancestor>) {
    if let Some(sha256) = sha256 {
        found.insert(Ancestor::Network(sha256.to_owned()));
        return;
    }
    if Shipped::is_at(path) {
        let sha256 = Shipped::read(path).map(|network| network.card.sha256);
        found.extend(sha256.map(Ancestor::Network));
        return;
    }
    let Ok((folder, kind)) = RunFolder::open(path) else {
        // A run that no longer exists still has its name; a ResNet's weights file is not a run.
        if !path.is_file() {
            found.insert(Ancestor::Network(place_of(path)));
        }
        return;
    };
    let kind = kind.unwrap_or_else(|| folder.preferred());
    let state = folder.read_state(kind).ok();
    if state.is_some_and(|s| s.encoders_only) {
        return;
    }
    // Stops at a cycle.
    if !found.insert(Ancestor::Network(place_of(folder.path()))) {
        return;
    }
    let findings = folder.read_findings().unwrap_or_default();
    // Imported or averaged weights came from no seed, whatever their configuration says.
    let learned = state.is_some_and(|s| s.step > 0) && findings.averaged.is_empty();
    if let Ok(config) = folder.read_settings() {
        match &config.init {
            Some(init) => add(init, config.init_sha256.as_deref(), found),
            None => found.extend(first_weights(&config).filter(|_| learned)),
        }
    }
    for network in &findings.averaged {
        add(&network.path, network.sha256.as_deref(), found);
    }
}

/// What determines the depth network's weights at the start of training from scratch: the seed and the layers. The uncertainty head is
/// initialised last, and changes no other weight.
fn first_weights(config: &TrainConfig) -> Option<Ancestor> {
    let mut layers = config.depth_net.of_the_weights();
    layers.initial_depth_m = config.depth_net.initial_depth_m;
    let layers = serde_json::to_string(&layers).ok()?;
    let of_seed = format!("seed {}, {layers}", config.seed);
    Some(Ancestor::FirstWeights(of_seed))
}

/// The path of a run's folder, however it was given.
fn place_of(path: &Path) -> String {
    let folder = match path.extension() {
        Some(end) if end == "safetensors" => path.parent().unwrap_or(path),
        _ => path,
    };
    let resolved = folder
        .canonicalize()
        .or_else(|_| std::path::absolute(folder));
    let resolved = resolved.unwrap_or_else(|_| folder.to_owned());
    // Removes a slash at the end.
    resolved
        .components()
        .collect::<PathBuf>()
        .display()
        .to_string()
}
