//! Finds out whether training has seen the evaluated frames.

#[cfg(feature = "train")]
mod of_run;

use std::path::Path;

use deepfusion_data::{Dataset, DatasetKind};
use deepfusion_model::TrainConfig;
use deepfusion_runtime::ModelSource;
use deepfusion_weights::Card;

use crate::Result;
use crate::evaluation::ImageRef;
use crate::verdict::Unseen;

#[cfg(feature = "train")]
pub use of_run::{held_out, unseen_frames};

/// Whether a path is a run's folder, or inside one.
#[must_use]
pub fn is_run(path: &Path) -> bool {
    let in_a_run = |p: &Path| p.join("config.toml").exists();
    path.is_dir() || path.parent().is_some_and(in_a_run)
}

/// Whether a packed network cannot have seen these recordings. Its card only says whether its training data were all simulated. If so, it
/// has not seen recordings that are certainly real.
#[must_use]
pub fn unseen(card: &Card, datasets: &[Dataset]) -> bool {
    /// Exact poses, which no real drive has.
    const SIMULATED: &str = "poses.txt";
    let surely_real = |dataset: &Dataset| {
        let marked = dataset.is_simulated() || dataset.folder().join(SIMULATED).exists();
        dataset.kind() != DatasetKind::Bag && !marked
    };
    card.simulated_only && datasets.iter().all(surely_real)
}

/// Whether a network learned from none of the evaluated images; `None` if that is unknown. `config` is its run's.
///
/// # Errors
/// A run's findings that cannot be read.
pub fn learned_from_none(
    model: &ModelSource,
    config: &TrainConfig,
    datasets: &[Dataset],
    places: &[ImageRef],
) -> Result<Option<bool>> {
    Ok(match model {
        ModelSource::Run { folder, .. } => {
            held_out(config, &folder.read_findings()?.averaged, datasets, places)
        }
        ModelSource::Packed { network, .. } => unseen(&network.card, datasets).then_some(true),
    })
}

/// The frames of the recordings that a network's training did not see. `config` is its run's.
///
/// # Errors
/// A run's findings that cannot be read.
pub fn unseen_by(
    model: &ModelSource,
    config: &TrainConfig,
    datasets: &[Dataset],
) -> Result<Unseen> {
    Ok(match model {
        ModelSource::Run { folder, .. } => {
            unseen_frames(config, &folder.read_findings()?.averaged, datasets)
        }
        ModelSource::Packed { network, .. } if unseen(&network.card, datasets) => Unseen::All,
        ModelSource::Packed { .. } => Unseen::NotKnown,
    })
}

/// A build without training cannot know which frames a run was trained on.
#[cfg(not(feature = "train"))]
#[must_use]
pub fn held_out(
    _: &TrainConfig,
    _: &[deepfusion_model::AveragedNetwork],
    _: &[Dataset],
    _: &[ImageRef],
) -> Option<bool> {
    None
}

/// As [`held_out`], for each frame.
#[cfg(not(feature = "train"))]
#[must_use]
pub fn unseen_frames(
    _: &TrainConfig,
    _: &[deepfusion_model::AveragedNetwork],
    _: &[Dataset],
) -> Unseen {
    Unseen::NotKnown
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_data::{OpenOptions, convert_to_bag, convert_to_kitti};
    use deepfusion_sim::{BagSettings, Sensors, SimConfig, Simulation, write_bag};
    use std::ops::ControlFlow;

    /// A network trained on simulated drives may have seen a converted simulated bag: without its mark, it looks like a real drive.
    #[test]
    fn a_simulated_drive_is_not_surely_real_in_another_layout() {
        let at = tempfile::tempdir().unwrap();
        let at = at.path();
        let config = SimConfig {
            frames: 6,
            width: 64,
            height: 48,
            fps: 25.0,
            sensors: Sensors::Umad,
            ..SimConfig::default()
        };
        let settings = BagSettings {
            lidar_step_deg: 5.0,
            ..BagSettings::default()
        };
        let simulation = Simulation::new(&config).unwrap();
        let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
        let bag = write_bag(&simulation, &at.join("sim"), &settings, &mut go_on).unwrap();
        let open = |path: &Path| Dataset::open(path, &OpenOptions::default()).unwrap();
        let kitti = at.join("kitti");
        convert_to_kitti(&open(&bag), &kitti, &mut go_on).unwrap();
        let again = at.join("again.bag");
        let converted = open(&kitti);
        convert_to_bag(&converted[0], &again, settings.compression, &mut go_on).unwrap();
        let mut card = deepfusion_weights::all().unwrap()[0].card.clone();
        card.simulated_only = true;
        for path in [&bag, &kitti, &again] {
            let drives = open(path);
            assert!(drives[0].is_simulated(), "{}", path.display());
            assert!(!unseen(&card, &drives), "{}", path.display());
        }
        std::fs::remove_file(converted[0].folder().join("dataset.toml")).unwrap();
        assert!(unseen(&card, &open(&kitti)));
    }
}
