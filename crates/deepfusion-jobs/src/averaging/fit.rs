//! Checks that the weights of two networks have the same meaning, so that they can be averaged.

use deepfusion_model::{StoredNetwork, UNCERTAINTY_PREFIX};
use toml::Value;

use crate::NoMean;

/// Focal lengths whose ratio differs from 1 by less than this belong to one camera.
const SAME_FOCAL: f64 = 1e-3;

/// Why a network cannot be averaged with the first one; `None` if it can.
pub(super) fn hindrance(first: &StoredNetwork, other: &StoredNetwork) -> Option<NoMean> {
    if other.config.learned_camera().is_some() {
        return Some(NoMean::LearnedCamera);
    }
    let settings = || {
        let canonical = |network: &StoredNetwork| table_of(network.config.canonical_focal_px);
        let layers = |network: &StoredNetwork| table_of(network.config.depth_net.of_the_weights());
        difference("depth_net", &layers(first), &layers(other))
            .or_else(|| difference("canonical_focal_px", &canonical(first), &canonical(other)))
    };
    tensors(first, other).or_else(settings).or_else(|| {
        // With a canonical focal length, metres do not depend on the training camera.
        if first.config.canonical_focal_px.is_some() {
            return None;
        }
        let (a, b) = (focal(first), focal(other));
        let same = match (a, b) {
            (Some(a), Some(b)) => (a / b - 1.0).abs() < SAME_FOCAL,
            (None, None) => true,
            _ => false,
        };
        let say = |f: Option<f64>| f.map_or("unknown".into(), |f| format!("{f:.1} px"));
        (!same).then(|| NoMean::Setting {
            key: "the focal length trained with, at the network's input".into(),
            found: say(b),
            first: say(a),
        })
    })
}

/// The first tensor that only one of them has, or whose shape differs. Only one may have an uncertainty head.
fn tensors(first: &StoredNetwork, other: &StoredNetwork) -> Option<NoMean> {
    let (a, b) = (&first.weights.tensors, &other.weights.tensors);
    let mut names = a.keys().chain(b.keys());
    let differs = |name: &&String| match (a.get(*name), b.get(*name)) {
        (Some(a), Some(b)) => a.shape != b.shape,
        _ => !name.starts_with(UNCERTAINTY_PREFIX),
    };
    let name = names.find(differs)?;
    Some(NoMean::Layers { name: name.clone() })
}

fn table_of(value: impl serde::Serialize) -> Option<Value> {
    Value::try_from(value).ok()
}

/// The first key in which two tables differ.
fn difference(key: &str, first: &Option<Value>, other: &Option<Value>) -> Option<NoMean> {
    if let (Some(Value::Table(a)), Some(Value::Table(b))) = (first, other) {
        let keys = a.keys().chain(b.keys().filter(|k| !a.contains_key(*k)));
        return keys
            .map(|k| (k, a.get(k).cloned(), b.get(k).cloned()))
            .find_map(|(k, a, b)| difference(&format!("{key}.{k}"), &a, &b));
    }
    let say = |value: &Option<Value>| value.as_ref().map_or("none".into(), Value::to_string);
    (first != other).then(|| NoMean::Setting {
        key: key.into(),
        found: say(other),
        first: say(first),
    })
}

/// f_y of the training camera, in pixels of the network's input.
fn focal(network: &StoredNetwork) -> Option<f64> {
    let camera = network.camera?;
    Some(camera.fy * network.config.size.height as f64 / f64::from(camera.height))
}
