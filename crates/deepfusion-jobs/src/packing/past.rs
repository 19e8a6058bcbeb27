//! Whether a network saw real images, as far as its run, those it began from and those that it is the mean of can tell.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use deepfusion_data::{Cameras, Dataset, DatasetKind, OpenOptions};
use deepfusion_model::{AveragedNetwork, RunFolder, TrainConfig, TrainFindings};
use deepfusion_runtime::embedded;
use deepfusion_weights::Shipped;

use crate::held_out::surely_real;
use crate::{Error, Result};

/// Recordings and networks of a run's past of which nothing shows that their images were simulated: bags, what is not there any more,
/// weights of other projects, packed networks whose cards do not say so.
///
/// # Errors
/// [`Error::SawReal`] for a recording that is surely real.
pub(super) fn not_known_as_simulated(
    run: &Path,
    config: &TrainConfig,
    findings: &TrainFindings,
) -> Result<Vec<PathBuf>> {
    let mut past = Past::default();
    past.add_run(run, config, findings)?;
    Ok(past.not_known)
}

#[derive(Default)]
struct Past {
    /// Runs and recordings that were looked at.
    seen: HashSet<PathBuf>,
    not_known: Vec<PathBuf>,
}

impl Past {
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
        let of_sets = data.sets.iter().flat_map(|set| &set.paths);
        for path in data.paths.iter().chain(of_sets) {
            self.add_recording(run, path, config)?;
        }
        if data.paths.is_empty() && data.sets.is_empty() && findings.averaged.is_empty() {
            // Imported: it learned elsewhere.
            self.not_known.push(run.to_owned());
        }
        if let Some(init) = &config.init {
            self.add_network(init, config.init_sha256.as_deref())?;
        }
        for AveragedNetwork { path, sha256, .. } in &findings.averaged {
            self.add_network(path, sha256.as_deref())?;
        }
        Ok(())
    }

    fn add_recording(&mut self, run: &Path, path: &Path, config: &TrainConfig) -> Result<()> {
        if !self.seen.insert(path.to_owned()) {
            return Ok(());
        }
        match is_real(path, config) {
            Some(true) => {
                return Err(Error::SawReal {
                    run: run.to_owned(),
                    recording: path.to_owned(),
                });
            }
            Some(false) => {}
            None => self.not_known.push(path.to_owned()),
        }
        Ok(())
    }

    /// A network that a run began from or is the mean of: an embedded one by its name and `sha256`, else a packed file or a run.
    fn add_network(&mut self, path: &Path, sha256: Option<&str>) -> Result<()> {
        let packed = match sha256 {
            // Another one of the name tells nothing of it.
            Some(sha256) => {
                let network = embedded(path).ok().flatten();
                network.filter(|network| network.card.sha256 == sha256)
            }
            None if Shipped::is_at(path) => Shipped::read(path).ok().map(Box::new),
            None => return self.add_run_at(path),
        };
        let simulated = packed.is_some_and(|network| network.card.simulated_only);
        if !simulated {
            self.not_known.push(path.to_owned());
        }
        Ok(())
    }

    fn add_run_at(&mut self, path: &Path) -> Result<()> {
        let read = || {
            let (folder, _) = RunFolder::open(path).ok()?;
            let (config, findings) = (folder.read_config().ok()?, folder.read_findings().ok()?);
            Some((folder, config, findings))
        };
        let Some((folder, config, findings)) = read() else {
            self.not_known.push(path.to_owned());
            return Ok(());
        };
        self.add_run(folder.path(), &config, &findings)
    }
}

/// Whether a recording is real; `None` where nothing shows it.
fn is_real(path: &Path, config: &TrainConfig) -> Option<bool> {
    // The exact motion lies beside a simulated drive's images, and within a bag.
    if Dataset::kind_at(path).ok()? == DatasetKind::Bag {
        return None;
    }
    let options = OpenOptions {
        camera: Cameras::Both,
        assumed_camera: config.assumed_camera.map(|camera| camera.intrinsics()),
        ..OpenOptions::default()
    };
    let datasets = Dataset::open(path, &options).ok()?;
    Some(datasets.iter().any(surely_real))
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_model::Preset;
    use deepfusion_sim::{SimConfig, Simulation, write_kitti};
    use std::fs;

    /// A simulated drive's folder.
    fn drive(at: &Path) -> PathBuf {
        let config = SimConfig {
            frames: 2,
            width: 64,
            height: 48,
            scan_every: 0,
            ..SimConfig::default()
        };
        let simulation = Simulation::new(&config).unwrap();
        let root = write_kitti(&simulation, at, &mut |_, _| ()).unwrap();
        let drive = &Dataset::open(&root, &OpenOptions::default()).unwrap()[0];
        drive.folder().to_owned()
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

    /// What [`not_known_as_simulated`] says of a mean of these, of whose first the settings are.
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
        let (simulated, real) = (drive(&at.join("simulated")), drive(&at.join("real")));
        fs::remove_file(real.join("poses.txt")).unwrap();
        let first = trained_on(&at.join("first"), &simulated);
        let second = trained_on(&at.join("second"), &simulated);
        let third = trained_on(&at.join("third"), &real);
        let none: Vec<PathBuf> = Vec::new();
        assert_eq!(of_mean(&[first.clone(), second.clone()]).unwrap(), none);
        let refused = of_mean(&[first.clone(), third.clone()]).unwrap_err();
        let Error::SawReal { run, recording } = &refused else {
            panic!("{refused}");
        };
        assert_eq!((run, recording), (&third, &real));
        // One that went on from the real drive.
        let (folder, _) = RunFolder::open(&second).unwrap();
        let mut config = folder.read_settings().unwrap();
        config.init = Some(third);
        folder
            .write_config(&config, &TrainFindings::default())
            .unwrap();
        let refused = of_mean(&[first.clone(), second]).unwrap_err();
        assert!(matches!(refused, Error::SawReal { .. }), "{refused}");

        // A run and a recording that are gone, weights of nobody knows what.
        let gone = at.join("gone");
        let of_gone = trained_on(&at.join("fourth"), &gone.join("drive"));
        let networks = [first, gone.clone(), of_gone];
        let expected = vec![gone.clone(), gone.join("drive")];
        assert_eq!(of_mean(&networks).unwrap(), expected);
        let config = Preset::Tiny.config();
        let imported = not_known_as_simulated(&gone, &config, &TrainFindings::default());
        assert_eq!(imported.unwrap(), [gone]);
    }

    #[test]
    fn an_embedded_network_says_it_itself() {
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
                (config.init, config.init_sha256) = (Some(name.clone()), Some(sha256));
                let findings = TrainFindings::default();
                let found = not_known_as_simulated(Path::new("run"), &config, &findings);
                assert_eq!(
                    found.unwrap().is_empty(),
                    known && network.card.simulated_only
                );
            }
        }
    }
}
