//! Finds out whether a network saw real images, as far as its run and its ancestors record it.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use deepfusion_data::kitti::{Drive, find_drives};
use deepfusion_data::{Dataset, DatasetKind, Split};
use deepfusion_model::{AveragedNetwork, RunFolder, TrainConfig, TrainFindings};
use deepfusion_runtime::embedded;
use deepfusion_weights::Shipped;

use crate::{Error, Result};

/// The recordings and networks in a run's past for which it cannot be shown that their images were simulated: recordings without the mark
/// ([`Dataset::is_simulated`]) or no longer existing, weights of other projects, packed networks whose cards do not claim it.
///
/// # Errors
/// [`Error::SawReal`] for a recording that is known to be real.
pub(super) fn not_known_as_simulated(
    run: &Path,
    config: &TrainConfig,
    findings: &TrainFindings,
) -> Result<Vec<PathBuf>> {
    let mut past = Ancestry::default();
    past.add_run(run, config, findings)?;
    Ok(past.not_known)
}

#[derive(Default)]
struct Ancestry {
    /// Runs that were visited.
    seen: HashSet<PathBuf>,
    /// Recordings that were visited, each with the split that selected its frames.
    recordings: HashSet<(PathBuf, Option<PathBuf>)>,
    not_known: Vec<PathBuf>,
}

impl Ancestry {
    fn add_run(
        &mut self,
        run: &Path,
        config: &TrainConfig,
        findings: &TrainFindings,
    ) -> Result<()> {
        if !self.seen.insert(run.to_owned()) {
            return Ok(());
        }
        let data = &config.data;
        let of_sets = data.sets.iter().map(|set| (&set.paths, &set.split));
        for (paths, split) in std::iter::once((&data.paths, &data.split)).chain(of_sets) {
            for path in paths {
                self.add_recording(run, path, split.as_deref())?;
            }
        }
        if data.paths.is_empty() && data.sets.is_empty() && findings.averaged.is_empty() {
            // Imported: it was trained elsewhere.
            self.add_not_known(run);
        }
        if let Some(init) = &config.init {
            self.add_network(init, config.init_sha256.as_deref())?;
        }
        for AveragedNetwork { path, sha256, .. } in &findings.averaged {
            self.add_network(path, sha256.as_deref())?;
        }
        Ok(())
    }

    fn add_recording(&mut self, run: &Path, path: &Path, split: Option<&Path>) -> Result<()> {
        let selected = (path.to_owned(), split.map(Path::to_owned));
        if !self.recordings.insert(selected) {
            return Ok(());
        }
        match images_of(path, split) {
            Images::Real(layout) => {
                return Err(Error::SawReal {
                    run: run.to_owned(),
                    recording: path.to_owned(),
                    layout,
                });
            }
            Images::Simulated => {}
            Images::NotKnown => self.add_not_known(path),
        }
        Ok(())
    }

    /// Adds a network that a run started from or is the mean of: an embedded one by its name and `sha256`, otherwise a packed file or a
    /// run.
    fn add_network(&mut self, path: &Path, sha256: Option<&str>) -> Result<()> {
        let packed = match sha256 {
            // An embedded network with the same name but other weights says nothing about it.
            Some(sha256) => {
                let network = embedded(path).ok().flatten();
                network.filter(|network| network.card.sha256 == sha256)
            }
            None if Shipped::is_at(path) => Shipped::read(path).ok().map(Box::new),
            None => return self.add_run_at(path),
        };
        let simulated = packed.is_some_and(|network| network.card.simulated_only);
        if !simulated {
            self.add_not_known(path);
        }
        Ok(())
    }

    /// Adds a path once, however often it is in the run's past.
    fn add_not_known(&mut self, path: &Path) {
        if !self.not_known.iter().any(|known| known == path) {
            self.not_known.push(path.to_owned());
        }
    }

    fn add_run_at(&mut self, path: &Path) -> Result<()> {
        let read = || {
            let (folder, _) = RunFolder::open(path).ok()?;
            let (config, findings) = (folder.read_config().ok()?, folder.read_findings().ok()?);
            Some((folder, config, findings))
        };
        let Some((folder, config, findings)) = read() else {
            self.add_not_known(path);
            return Ok(());
        };
        self.add_run(folder.path(), &config, &findings)
    }
}

/// What is known about a recording's images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Images {
    /// Real: the layout is used only by its authors' drives, or the drive was recorded on a day of KITTI raw.
    Real(DatasetKind),
    /// Simulated.
    Simulated,
    /// Unknown: any program may have written them.
    NotKnown,
}

/// What is known about the images that a split selects at a path, according to names and folders; no image is opened.
fn images_of(path: &Path, split: Option<&Path>) -> Images {
    match Dataset::kind_at(path) {
        Ok(
            layout @ (DatasetKind::NuScenes | DatasetKind::Kitti360 | DatasetKind::KittiOdometry),
        ) => Images::Real(layout),
        Ok(DatasetKind::KittiRaw) => images_of_drives(path, split),
        Ok(_) if Dataset::all_simulated_at(path) => Images::Simulated,
        _ => Images::NotKnown,
    }
}

/// As [`images_of`], for drives in KITTI raw's layout, which other programs write, too; `data convert` writes it for any recording.
fn images_of_drives(path: &Path, split: Option<&Path>) -> Images {
    let Ok(mut drives) = find_drives(path) else {
        return Images::NotKnown;
    };
    // A split that can no longer be read may have selected any drive.
    if let Some(split) = split.and_then(|split| Split::read(split).ok()) {
        let named: HashSet<&str> = split.entries.iter().map(|e| e.folder.as_str()).collect();
        drives.retain(|drive| named.contains(drive.split_name().as_str()));
    }
    if drives.iter().any(is_kittis_own) {
        Images::Real(DatasetKind::KittiRaw)
    } else if !drives.is_empty() && drives.iter().all(Drive::is_simulated) {
        Images::Simulated
    } else {
        Images::NotKnown
    }
}

/// Whether a drive is named after a day on which KITTI was recorded.
fn is_kittis_own(drive: &Drive) -> bool {
    const DAYS: [&str; 5] = [
        "2011_09_26_",
        "2011_09_28_",
        "2011_09_29_",
        "2011_09_30_",
        "2011_10_03_",
    ];
    DAYS.iter().any(|day| drive.name.starts_with(day))
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_data::OpenOptions;
    use deepfusion_model::Preset;
    use deepfusion_sim::{SimConfig, Simulation, write_kitti};
    use std::fs;
    use std::ops::ControlFlow;

    /// Writes a simulated drive; returns its folder.
    fn drive(at: &Path) -> PathBuf {
        let config = SimConfig {
            frames: 2,
            width: 64,
            height: 48,
            scan_every: 0,
            ..SimConfig::default()
        };
        let simulation = Simulation::new(&config).unwrap();
        let root = write_kitti(&simulation, at, &mut |_, _| ControlFlow::Continue(())).unwrap();
        let drive = &Dataset::open(&root, &OpenOptions::default()).unwrap()[0];
        drive.folder().to_owned()
    }

    /// Makes a folder that looks like a sequence of KITTI odometry.
    fn sequence(at: &Path) -> PathBuf {
        let folder = at.join("sequences/00");
        fs::create_dir_all(folder.join("image_2")).unwrap();
        for name in ["calib.txt", "times.txt"] {
            fs::write(folder.join(name), "").unwrap();
        }
        folder
    }

    /// A run that learned from a recording.
    fn trained_on(folder: &Path, recording: &Path) -> PathBuf {
        let mut config = Preset::Tiny.config();
        config.data.paths = vec![recording.to_owned()];
        let run = RunFolder::create(folder).unwrap();
        run.write_config(&config, &TrainFindings::default())
            .unwrap();
        folder.to_owned()
    }

    /// The result of [`not_known_as_simulated`] for a mean of these networks, with the settings of the first.
    fn of_mean(networks: &[PathBuf]) -> Result<Vec<PathBuf>> {
        let (first, _) = RunFolder::open(&networks[0]).unwrap();
        let part = |path: &PathBuf| AveragedNetwork {
            path: path.clone(),
            sha256: None,
            share: 0.5,
        };
        let findings = TrainFindings {
            averaged: networks.iter().map(part).collect(),
            ..TrainFindings::default()
        };
        let config = first.read_settings().unwrap();
        not_known_as_simulated(Path::new("mean"), &config, &findings)
    }

    #[test]
    fn a_mean_saw_what_its_networks_saw() {
        let at = tempfile::tempdir().unwrap();
        let at = at.path();
        let simulated = drive(&at.join("simulated"));
        let real = sequence(&at.join("real"));
        let first = trained_on(&at.join("first"), &simulated);
        let second = trained_on(&at.join("second"), &simulated);
        let third = trained_on(&at.join("third"), &real);
        let none: Vec<PathBuf> = Vec::new();
        assert_eq!(of_mean(&[first.clone(), second.clone()]).unwrap(), none);
        let refused = of_mean(&[first.clone(), third.clone()]).unwrap_err();
        let Error::SawReal {
            run,
            recording,
            layout: DatasetKind::KittiOdometry,
        } = &refused
        else {
            panic!("{refused}");
        };
        assert_eq!((run, recording), (&third, &real));
        // Fine-tuned from the one with the real drive.
        let (folder, _) = RunFolder::open(&second).unwrap();
        let mut config = folder.read_settings().unwrap();
        config.init = Some(third);
        folder
            .write_config(&config, &TrainFindings::default())
            .unwrap();
        let refused = of_mean(&[first.clone(), second]).unwrap_err();
        assert!(matches!(refused, Error::SawReal { .. }), "{refused}");

        // A run and a recording that no longer exist, and weights of unknown origin.
        let gone = at.join("gone");
        let of_gone = trained_on(&at.join("fourth"), &gone.join("drive"));
        let networks = [first, gone.clone(), gone.clone(), of_gone];
        let expected = vec![gone.clone(), gone.join("drive")];
        assert_eq!(of_mean(&networks).unwrap(), expected);
        let config = Preset::Tiny.config();
        let imported = not_known_as_simulated(&gone, &config, &TrainFindings::default());
        assert_eq!(imported.unwrap(), [gone]);
    }

    /// Images alone prove nothing: another simulator's have no exact poses either. The mark of `data convert` does.
    #[test]
    fn the_origin_of_images_without_a_mark_is_unknown() {
        let at = tempfile::tempdir().unwrap();
        let at = at.path();
        let of = |recording: &Path| images_of(recording, None);
        let converted = drive(&at.join("converted"));
        assert_eq!(of(&converted), Images::Simulated);
        fs::remove_file(converted.join("poses.txt")).unwrap();
        assert_eq!(of(&converted), Images::NotKnown);
        let pictures = at.join("pictures");
        fs::create_dir(&pictures).unwrap();
        fs::write(pictures.join("0.png"), "").unwrap();
        for beside in ["notes.txt", "poses.txt"] {
            fs::write(pictures.join(beside), "").unwrap();
            assert_eq!(Dataset::kind_at(&pictures).unwrap(), DatasetKind::Folder);
            assert_eq!(of(&pictures), Images::NotKnown, "{beside}");
        }
        let run = [trained_on(&at.join("run"), &converted)];
        assert_eq!(of_mean(&run).unwrap(), std::slice::from_ref(&converted));
        let mark = |folder: &Path| fs::write(folder.join("dataset.toml"), "simulated = true\n");
        mark(converted.parent().unwrap()).unwrap();
        mark(&pictures).unwrap();
        for marked in [&converted, &pictures] {
            assert_eq!(of(marked), Images::Simulated, "{}", marked.display());
        }
        assert!(of_mean(&run).unwrap().is_empty());
    }

    /// A root of KITTI raw with one of its own drives, to which exact poses were added, and a simulated drive.
    #[test]
    fn a_split_says_which_drives_were_learned_from() {
        let at = tempfile::tempdir().unwrap();
        let at = at.path().canonicalize().unwrap();
        let root = at.join("raw");
        let simulated = drive(&root);
        let real = root.join("2011_09_26/2011_09_26_drive_0001_sync");
        for folder in ["image_02/data", "moving_02"] {
            fs::create_dir_all(real.join(folder)).unwrap();
        }
        fs::write(real.join("poses.txt"), "").unwrap();
        let kittis = Images::Real(DatasetKind::KittiRaw);
        assert_eq!(images_of(&root, None), kittis);
        let split = |drive: &Path| {
            let drive = drive.strip_prefix(&root).unwrap().display().to_string();
            let file = at.join("split.txt");
            fs::write(&file, format!("{drive} 0 l\n{drive} 1 l\n")).unwrap();
            file
        };
        for (drive, expected) in [
            (&simulated, Images::Simulated),
            (&real, kittis),
            (&root.join("another"), Images::NotKnown),
        ] {
            assert_eq!(images_of(&root, Some(&split(drive))), expected);
        }
        assert_eq!(images_of(&root, Some(&at.join("gone.txt"))), kittis);
        let mut config = Preset::Tiny.config();
        config.data.paths = vec![root.clone()];
        let mut saw = |split: Option<PathBuf>| {
            config.data.split = split;
            not_known_as_simulated(Path::new("run"), &config, &TrainFindings::default())
        };
        assert!(saw(Some(split(&simulated))).unwrap().is_empty());
        assert!(matches!(saw(None), Err(Error::SawReal { .. })));
    }

    #[test]
    fn the_card_of_an_embedded_network_is_believed() {
        let mut config = Preset::Tiny.config();
        config.data = toml::from_str(
            "sets = [{ name = 'streets', learn = 'depth', simulated = { seed = 1 } }]",
        )
        .unwrap();
        for network in deepfusion_weights::all().unwrap() {
            let name = PathBuf::from(&network.card.name);
            for (sha256, known) in [
                (network.card.sha256.clone(), true),
                ("ab".repeat(32), false),
            ] {
                (config.init, config.init_sha256) = (Some(name.clone()), Some(sha256.clone()));
                // A mean of networks that were fine-tuned from the same one, which is named only once.
                let part = AveragedNetwork {
                    path: name.clone(),
                    sha256: Some(sha256),
                    share: 0.5,
                };
                let findings = TrainFindings {
                    averaged: vec![part.clone(), part],
                    ..TrainFindings::default()
                };
                let found = not_known_as_simulated(Path::new("run"), &config, &findings);
                let known = known && network.card.simulated_only;
                assert_eq!(found.unwrap().len(), usize::from(!known));
            }
        }
    }
}
