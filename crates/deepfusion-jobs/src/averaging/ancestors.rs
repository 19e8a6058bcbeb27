//! Whether networks come from one.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use deepfusion_model::{AveragedNetwork, RunFolder};
use deepfusion_weights::Shipped;

/// Whether all networks come from one, as far as their configurations say: one of them from the other, or all from another one.
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

/// A network and those it came from: runs by their folders, packed networks by what is in them. ImageNet's encoders are no ancestor: the
/// rest of the network came from a seed.
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
    if folder.read_state(kind).is_ok_and(|s| s.encoders_only) {
        return;
    }
    // Once around is enough.
    if !found.insert(name_of(folder.path())) {
        return;
    }
    if let Ok(config) = folder.read_settings()
        && let Some(init) = &config.init
    {
        add(init, config.init_sha256.as_deref(), found);
    }
    for network in folder.read_findings().iter().flat_map(|f| &f.averaged) {
        add(&network.path, network.sha256.as_deref(), found);
    }
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
