//! Whether networks come from one.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use deepfusion_model::{AveragedNetwork, RunFolder, TrainConfig};
use deepfusion_weights::Shipped;

/// What networks have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kinship {
    /// All were trained from one network, or one of them is it.
    Network,
    /// Nothing but the random weights that they began with, of one seed. They are usually not in one valley: their mean is often worse than
    /// each of them.
    FirstWeights,
    /// Nothing that is known. The mean of unrelated networks is worth nothing.
    Unknown,
}

/// What networks have in common, as far as their configurations say: all come from one where one of them does from the other, or all from
/// another one.
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

/// What a network comes from.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Ancestor {
    /// A trained network: a run by its folder, a packed one by what is in it.
    Network(String),
    /// The first weights of a seed, by what they follow from.
    FirstWeights(String),
}

/// A network and those it came from. ImageNet's encoders are no ancestor: the rest of the network came from a seed.
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
        // A run that is not there any more still has its name; a file of a ResNet is no run.
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
    // Once around is enough.
    if !found.insert(Ancestor::Network(place_of(folder.path()))) {
        return;
    }
    let findings = folder.read_findings().unwrap_or_default();
    // Weights that were imported or averaged came from no seed, whatever their configuration says.
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

/// What the depth network's weights follow from where a run begins from nothing: its seed and its layers. The head for uncertainty is drawn
/// last, and changes no other weight.
fn first_weights(config: &TrainConfig) -> Option<Ancestor> {
    let mut layers = config.depth_net.of_the_weights();
    layers.initial_depth_m = config.depth_net.initial_depth_m;
    let layers = serde_json::to_string(&layers).ok()?;
    let of_seed = format!("seed {}, {layers}", config.seed);
    Some(Ancestor::FirstWeights(of_seed))
}

/// A run's folder, by whichever way it was named.
fn place_of(path: &Path) -> String {
    let folder = match path.extension() {
        Some(end) if end == "safetensors" => path.parent().unwrap_or(path),
        _ => path,
    };
    let whole = folder
        .canonicalize()
        .or_else(|_| std::path::absolute(folder));
    let whole = whole.unwrap_or_else(|_| folder.to_owned());
    // Without a slash at its end.
    whole
        .components()
        .collect::<PathBuf>()
        .display()
        .to_string()
}
