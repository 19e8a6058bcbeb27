//! Whether networks come from one.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use deepfusion_model::{AveragedNetwork, RunFolder, TrainConfig};
use deepfusion_weights::Shipped;

/// Whether all networks come from one, as far as their configurations say: one of them from the other, or all from another one, be it the
/// first weights of a seed.
pub(super) fn are_related(networks: &[AveragedNetwork]) -> bool {
    let mut common: Option<HashSet<String>> = None;
    for network in networks {
        let mut found = HashSet::new();
        add(&network.path, network.sha256.as_deref(), &mut found);
        common = Some(match common {
            None => found,
            Some(common) => common.intersection(&found).cloned().collect(),
        });
    }
    common.is_some_and(|common| !common.is_empty())
}

/// A network and those it came from: runs by their folders, packed networks by what is in them, the first weights of a seed by what they
/// follow from. ImageNet's encoders are no ancestor: the rest of the network came from a seed.
fn add(path: &Path, sha256: Option<&str>, found: &mut HashSet<String>) {
    if let Some(sha256) = sha256 {
        found.insert(sha256.to_owned());
        return;
    }
    if Shipped::is_at(path) {
        found.extend(Shipped::read(path).map(|network| network.card.sha256));
        return;
    }
    let Ok((folder, kind)) = RunFolder::open(path) else {
        // A run that is not there any more still has its name; a file of a ResNet is no run.
        if !path.is_file() {
            found.insert(name_of(path));
        }
        return;
    };
    let kind = kind.unwrap_or_else(|| folder.preferred());
    let state = folder.read_state(kind).ok();
    if state.is_some_and(|s| s.encoders_only) {
        return;
    }
    // Once around is enough.
    if !found.insert(name_of(folder.path())) {
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
fn first_weights(config: &TrainConfig) -> Option<String> {
    let mut layers = config.depth_net.of_the_weights();
    layers.initial_depth_m = config.depth_net.initial_depth_m;
    let layers = serde_json::to_string(&layers).ok()?;
    Some(format!("seed {}, {layers}", config.seed))
}

/// A run's folder, by whichever way it was named.
fn name_of(path: &Path) -> String {
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
