//! The options of `train --resume` as a request to the library ([`resume`]).

use std::path::Path;

use deepfusion_jobs::training::resume::{self, MovedRecordings, ResumeRequest, Setting};
use deepfusion_model::TrainConfig;

use super::clocks;
use crate::cli::TrainArgs;
use crate::error::CliError;
use crate::failure::{Failure, Result, option_of};

/// A run's configuration, changed as the options ask.
pub(super) fn with_options(run: &TrainConfig, args: &TrainArgs) -> Result<TrainConfig> {
    Ok(resume::resumed_config(run, &request(args)?)?)
}

fn request(args: &TrainArgs) -> Result<ResumeRequest> {
    // Every option by name, so that a new one must be handled here.
    let TrainArgs {
        data,
        preset,
        config: file,
        out: _,
        resume: _,
        device,
        epochs,
        steps,
        size,
        batch,
        seed,
        learn,
        camera,
        stereo,
        split,
        val_data,
        val_split,
        intrinsics,
        topics,
        clock_offset,
        init,
        view_motion,
        with,
        without,
        set,
    } = args;
    let file = match file {
        Some(path) => {
            let config = TrainConfig::read_over_preset(path, device.compute())?;
            Some((path.clone(), Box::new(config)))
        }
        None => None,
    };
    Ok(ResumeRequest {
        file,
        moved: MovedRecordings {
            data: data.clone(),
            validation: val_data.clone(),
            split: split.clone(),
            validation_split: val_split.clone(),
        },
        steps: *steps,
        epochs: *epochs,
        preset: *preset,
        size: size.map(Into::into),
        batch: *batch,
        seed: *seed,
        learn: *learn,
        camera: *camera,
        stereo: *stereo,
        learned_camera: intrinsics.is_some(),
        view_motion: *view_motion,
        with: with.clone(),
        without: without.clone(),
        assignments: set.clone(),
        init: init.clone(),
        clock: clock_offset.map(clocks::ahead),
        topics: topics.iter().map(ToString::to_string).collect(),
    })
}

/// If the error is that one of the run's recordings is missing, an error whose hint names the option for its new path.
pub(super) fn where_recordings_are(error: Failure, config: &TrainConfig, run: &Path) -> Failure {
    let Some(path) = error.missing().map(Path::to_owned) else {
        return error;
    };
    let option = match resume::setting_of(&path, config) {
        // Only the run's configuration names it.
        Some(Setting::DataSet) => None,
        Some(setting) => Some(option_of(&setting)),
        None => return error,
    };
    let run = run.to_owned();
    CliError::Moved { path, run, option }.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, Parser};
    use deepfusion_model::Preset;
    use std::path::PathBuf;

    #[derive(Parser)]
    struct Alone {
        #[command(flatten)]
        args: TrainArgs,
    }

    fn asked(options: &[&str]) -> TrainArgs {
        let line = ["train", "--out", "run", "--resume"];
        Alone::parse_from(line.iter().chain(options)).args
    }

    fn a_run() -> TrainConfig {
        let mut run = Preset::Tiny.config();
        run.data.paths = vec!["/data/street".into()];
        run.data.camera = "2".into();
        run.steps = Some(100);
        run
    }

    #[test]
    fn every_option_is_used_or_contradicts() {
        let folder = tempfile::tempdir().unwrap();
        let written = |name: &str, change: &dyn Fn(&mut TrainConfig)| {
            let mut config = a_run();
            change(&mut config);
            let path = folder.path().join(name);
            std::fs::write(&path, config.to_toml().unwrap()).unwrap();
            path.display().to_string()
        };
        let same = written("same.toml", &|c| c.steps = Some(300));
        let other = written("other.toml", &|c| c.learning_rate = 0.5);
        let run = a_run();
        let with = |options: &[&str]| with_options(&run, &asked(options));
        // A value that the run already has is no contradiction, and an option that can apply is used.
        assert_eq!(with(&[]).unwrap(), run);
        type Change = fn(&mut TrainConfig);
        let used: [(&[&str], Change); 18] = [
            (&["--device", "cpu"], |_| {}),
            (&["--init", "none"], |_| {}),
            (&["--preset", "tiny"], |_| {}),
            (&["--size", "320x96"], |_| {}),
            (&["--batch", "4"], |_| {}),
            (&["--seed", "0"], |_| {}),
            (&["--learn", "self"], |_| {}),
            (&["--camera", "2"], |_| {}),
            (&["--view-motion", "auto"], |_| {}),
            (&["--with", "smoothness"], |_| {}),
            (&["--without", "flow"], |_| {}),
            (&["--set", "batch=4"], |_| {}),
            (&["--config", &same], |c| c.steps = Some(300)),
            (&["--config", &same, "--steps", "400"], |c| {
                c.steps = Some(400)
            }),
            (&["--steps", "200"], |c| c.steps = Some(200)),
            (&["--epochs", "7"], |c| {
                (c.epochs, c.steps, c.min_steps) = (7, None, 0);
            }),
            (&["--data", "/mnt/a", "/mnt/b"], |c| {
                c.data.paths = vec!["/mnt/a".into(), "/mnt/b".into()];
            }),
            (&["--config", &same, "--data", "/mnt/a"], |c| {
                (c.steps, c.data.paths) = (Some(300), vec!["/mnt/a".into()]);
            }),
        ];
        for (options, change) in &used {
            let mut expected = run.clone();
            change(&mut expected);
            assert_eq!(with(options).unwrap(), expected, "{options:?}");
        }
        let refused: [(&[&str], &str, &str); 19] = [
            (&["--intrinsics", "learn"], "learn", "none"),
            (&["--preset", "light"], "light", "tiny"),
            (&["--size", "640x192"], "640x192", "320x96"),
            (&["--batch", "3"], "3", "4"),
            (&["--seed", "7"], "7", "0"),
            (&["--set", "batch=5"], "batch=5", "another value"),
            (&["--learn", "both"], "both", "self"),
            (&["--camera", "both"], "both", "2"),
            (&["--stereo"], "on", "has it off"),
            (&["--view-motion", "vehicle"], "vehicle", "auto"),
            (&["--with", "hce"], "hce", "trained without it"),
            (
                &["--without", "smoothness"],
                "smoothness",
                "trained with it",
            ),
            (&["--init", "/w.pth"], "/w.pth", "none"),
            (&["--split", "/s.txt"], "/s.txt", "has none"),
            (&["--val-split", "/s.txt"], "/s.txt", "has none"),
            (&["--clock-offset", "60"], "60 ms", "has none"),
            (&["--topic", "imu=/imu"], "imu=/imu", "names none"),
            (&["--val-data", "/v"], "/v", "held-out end"),
            (
                &["--config", &other],
                "learning_rate = 0.5",
                "learning_rate = 0.001",
            ),
        ];
        for (options, asked, found) in refused {
            let error = with(options).unwrap_err().to_string();
            for part in [options[0], asked, found] {
                assert!(error.contains(part), "{options:?}: no `{part}` in {error}");
            }
        }
        // A new option must be in one of the tables.
        let tested: Vec<&str> = used
            .iter()
            .map(|(o, _)| o[0])
            .chain(refused.iter().map(|(o, ..)| o[0]))
            .collect();
        let command = Alone::command();
        for long in command.get_arguments().filter_map(clap::Arg::get_long) {
            let option = format!("--{long}");
            let known = ["--out", "--resume"].contains(&option.as_str())
                || tested.contains(&option.as_str());
            assert!(known, "{option}: not tested with --resume");
        }
    }

    /// A name is compared as text, independent of the current folder.
    #[test]
    fn the_embedded_network_that_a_run_started_from_is_no_contradiction() {
        let mut run = a_run();
        (run.init, run.init_sha256) = (Some("street".into()), Some("ab".repeat(32)));
        assert_eq!(
            with_options(&run, &asked(&["--init", "street"])).unwrap(),
            run
        );
        assert_eq!(with_options(&run, &asked(&[])).unwrap(), run);
        for other in ["none", "tiny", "/runs/street"] {
            let error = with_options(&run, &asked(&["--init", other])).unwrap_err();
            let error = error.to_string();
            assert!(
                error.contains(other) && error.contains("has street"),
                "{error}"
            );
        }
    }

    #[test]
    fn recordings_of_a_run_may_have_moved() {
        let mut run = a_run();
        run.data.validation = vec!["/data/val".into()];
        run.data.split = Some("/data/split.txt".into());
        run.init = Some("/data/weights.pth".into());
        let options = [
            "--val-data",
            "/v",
            "--split",
            "/s.txt",
            "--init",
            "/data/weights.pth",
        ];
        let moved = with_options(&run, &asked(&options)).unwrap();
        assert_eq!(moved.data.validation, [PathBuf::from("/v")]);
        assert_eq!(moved.data.split, Some("/s.txt".into()));
        // The paths of data sets are in the file.
        run.data = toml::from_str("sets = [{ name = 'road', paths = ['/road'] }]").unwrap();
        for options in [
            ["--data", "/d"],
            ["--val-data", "/v"],
            ["--split", "/s.txt"],
        ] {
            let error = with_options(&run, &asked(&options)).unwrap_err();
            let error = error.to_string();
            assert!(
                error.contains(options[0]) && error.contains("data.sets"),
                "{error}"
            );
        }
    }

    #[test]
    fn the_error_of_a_missing_recording_names_its_option() {
        let mut config = a_run();
        config.data.validation = vec!["/data/val".into()];
        let explained = |path: &str| {
            let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
            let error = deepfusion_data::Error::file(Path::new(path), missing);
            let error = where_recordings_are(error.into(), &config, Path::new("runs/a"));
            (error.to_string(), error.hint().unwrap_or_default())
        };
        let (text, hint) = explained("/data/street");
        assert!(
            text.contains("/data/street") && text.contains("runs/a"),
            "{text}"
        );
        assert!(hint.contains("--data PATH"), "{hint}");
        assert!(explained("/data/val/x").1.contains("--val-data PATH"));
        // Only the run's configuration names the recordings of a data set.
        let with_sets = TrainConfig {
            data: toml::from_str("sets = [{ name = 'road', paths = ['/road'] }]").unwrap(),
            ..a_run()
        };
        let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
        let error = deepfusion_data::Error::file(Path::new("/road/a"), missing);
        let error = where_recordings_are(error.into(), &with_sets, Path::new("runs/a"));
        let hint = error.hint().unwrap_or_default();
        assert!(hint.contains("config.toml"), "{hint}");
        // Other files are not the run's.
        assert!(!explained("/etc/x").0.contains("runs/a"));
    }
}
