//! What the options of `train --resume` may change of a run, and what contradicts it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use deepfusion_jobs::recordings::camera_word;
use deepfusion_jobs::training::Start;
use deepfusion_model::TrainConfig;

use crate::cli::{ClockOffset, TrainArgs};
use crate::error::CliError;
use crate::failure::{Failure, Result};

/// A run's configuration with what was asked for: it may be made longer, and its recordings may have moved; all else must be as
/// the run has it.
pub(super) fn with_options(run: &TrainConfig, args: &TrainArgs) -> Result<TrainConfig> {
    // Every option by name: one that is added says here what becomes of it.
    let TrainArgs {
        data,
        preset,
        config: file,
        out: _,
        resume: _,
        device: _,
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
    let mut config = run.clone();
    config.data.make_absolute();
    if let Some(path) = file {
        take_file(&mut config, path, args)?;
    }
    if let Some(preset) = preset {
        same("--preset", preset.to_string(), run.preset.to_string())?;
    }
    if let Some(size) = size {
        let asked = format!("{}x{}", size.width, size.height);
        let found = format!("{}x{}", run.size.width, run.size.height);
        same("--size", asked, found)?;
    }
    if let Some(batch) = batch {
        same("--batch", batch.to_string(), run.batch.to_string())?;
    }
    if let Some(seed) = seed {
        same("--seed", seed.to_string(), run.seed.to_string())?;
    }
    if let Some(learn) = learn {
        let found = run.data.learn.name();
        same("--learn", learn.name().into(), found.into())?;
    }
    if let Some(camera) = camera {
        let found = camera_of(&config);
        same("--camera", camera_word(*camera).into(), found)?;
    }
    if *stereo && !run.stereo {
        return contradicts("--stereo", "on".into(), "has it off".into());
    }
    if intrinsics.is_some() {
        let found = run.learned_camera().map_or("none", |_| "learn");
        same("--intrinsics", "learn".into(), found.into())?;
    }
    if let Some(motion) = view_motion {
        let found = run.view_motion.name();
        same("--view-motion", motion.name().into(), found.into())?;
    }
    for term in with {
        let mut other = run.clone();
        other.with(term)?;
        if other != *run {
            return contradicts("--with", term.clone(), "is learned without it".into());
        }
    }
    for term in without {
        let mut other = run.clone();
        other.without(term)?;
        if other != *run {
            return contradicts("--without", term.clone(), "is learned with it".into());
        }
    }
    for assignment in set {
        let mut other = run.clone();
        other.set(assignment)?;
        if other != *run {
            let found = "has another value in its config.toml";
            return contradicts("--set", assignment.clone(), found.into());
        }
    }
    if let Some(asked) = init {
        // `none`, and the names of embedded networks, are no paths.
        let asked = match (Start::is_none(asked), &run.init_sha256) {
            (true, _) | (false, Some(_)) => asked.clone(),
            (false, None) => std::path::absolute(asked).unwrap_or_else(|_| asked.clone()),
        };
        let found = run.init.as_deref().map_or("none".into(), path_text);
        same("--init", path_text(&asked), found)?;
    }
    let in_ms = |s: f64| format!("{} ms", 1000.0 * s);
    let found = run.data.camera_ahead_s.map(in_ms);
    match clock_offset {
        // What was measured when the run began holds.
        Some(ClockOffset::Auto) if found.is_some() => {}
        Some(ClockOffset::Auto) => same("--clock-offset", "auto".into(), "none".into())?,
        Some(ClockOffset::Seconds(ahead_s)) => {
            let found = found.unwrap_or("none".into());
            same("--clock-offset", in_ms(*ahead_s), found)?;
        }
        None => {}
    }
    for topic in topics {
        let topic = topic.to_string();
        if !run.data.topics.contains(&topic) {
            let found = match run.data.topics.as_slice() {
                [] => "names none".into(),
                topics => format!("has {}", topics.join(", ")),
            };
            return contradicts("--topic", topic, found);
        }
    }
    move_recordings(
        &mut config,
        data,
        val_data,
        [split.as_deref(), val_split.as_deref()],
    )?;
    config.steps = steps.or(config.steps);
    if let Some(epochs) = epochs {
        (config.epochs, config.steps, config.min_steps) = (*epochs, None, 0);
    }
    Ok(config)
}

/// The places where the same recordings are now.
fn move_recordings(
    config: &mut TrainConfig,
    data: &[PathBuf],
    val_data: &[PathBuf],
    splits: [Option<&Path>; 2],
) -> Result<()> {
    let of_sets = "has the data.sets of its config.toml, each with its own".to_owned();
    let sets = !config.data.sets.is_empty();
    if !data.is_empty() {
        if sets {
            return contradicts("--data", list(data), of_sets);
        }
        config.data.paths = data.to_vec();
    }
    if !val_data.is_empty() {
        if sets {
            return contradicts("--val-data", list(val_data), of_sets);
        }
        if config.data.validation.is_empty() {
            let found = "is validated on the held-out end of each drive";
            return contradicts("--val-data", list(val_data), found.into());
        }
        config.data.validation = val_data.to_vec();
    }
    let data = &mut config.data;
    let kept = [
        ("--split", &mut data.split),
        ("--val-split", &mut data.validation_split),
    ];
    for ((option, kept), split) in kept.into_iter().zip(splits) {
        let Some(split) = split else { continue };
        if kept.is_none() {
            let found = if sets {
                of_sets.clone()
            } else {
                "has none".into()
            };
            return contradicts(option, path_text(split), found);
        }
        *kept = Some(split.to_owned());
    }
    config.data.make_absolute();
    Ok(())
}

/// What a configuration file may change, and that it says nothing else than the run's.
fn take_file(config: &mut TrainConfig, path: &Path, args: &TrainArgs) -> Result<()> {
    let file = TrainConfig::read_over_preset(path, args.device.compute())?;
    (config.steps, config.epochs) = (file.steps, file.epochs);
    config.min_steps = file.min_steps;
    config.checkpoint_minutes = file.checkpoint_minutes;
    // What a run fills in from its data, or the options say, is not the file's to say.
    let mut asked = file;
    asked.data.make_absolute();
    asked.init.clone_from(&config.init);
    asked.init_sha256.clone_from(&config.init_sha256);
    if asked.pose_net.metres_per_unit == 0.0 {
        asked.pose_net.metres_per_unit = config.pose_net.metres_per_unit;
    }
    for (asked, has) in asked.data.sets.iter_mut().zip(&config.data.sets) {
        if asked.metres_per_unit == 0.0 {
            asked.metres_per_unit = has.metres_per_unit;
        }
    }
    let (asked_data, has) = (&mut asked.data, &config.data);
    if !args.data.is_empty() {
        asked_data.paths.clone_from(&has.paths);
    }
    if !args.val_data.is_empty() {
        asked_data.validation.clone_from(&has.validation);
    }
    if args.split.is_some() {
        asked_data.split.clone_from(&has.split);
    }
    if args.val_split.is_some() {
        asked_data
            .validation_split
            .clone_from(&has.validation_split);
    }
    let mut has = config.clone();
    (asked.data.camera, has.data.camera) = (camera_of(&asked), camera_of(&has));
    let (asked, has) = (settings(&asked)?, settings(&has)?);
    let keys = asked.keys().chain(has.keys());
    for key in keys {
        if asked.get(key) != has.get(key) {
            let of = |settings: &BTreeMap<String, String>| {
                let value = settings.get(key).map_or("nothing", String::as_str);
                format!("{key} = {value}")
            };
            let option = format!("--config {}", path.display());
            return contradicts(&option, of(&asked), format!("has {}", of(&has)));
        }
    }
    Ok(())
}

/// Every setting by its dotted key.
fn settings(config: &TrainConfig) -> Result<BTreeMap<String, String>> {
    fn add(all: &mut BTreeMap<String, String>, prefix: &str, table: &toml::Table) {
        for (key, value) in table {
            let key = format!("{prefix}{key}");
            match value {
                toml::Value::Table(inner) => add(all, &format!("{key}."), inner),
                value => drop(all.insert(key, value.to_string())),
            }
        }
    }
    let mut all = BTreeMap::new();
    add(&mut all, "", &toml::Table::try_from(config)?);
    Ok(all)
}

/// Which cameras a run learns from; nothing said means 2.
fn camera_of(config: &TrainConfig) -> String {
    match config.data.camera.as_str() {
        "" => "2".into(),
        camera => camera.into(),
    }
}

fn same(option: &str, asked: String, found: String) -> Result<()> {
    if asked == found {
        Ok(())
    } else {
        contradicts(option, asked, format!("has {found}"))
    }
}

fn contradicts<T>(option: &str, asked: String, run: String) -> Result<T> {
    Err(CliError::Contradicts {
        option: option.to_owned(),
        asked,
        run,
    }
    .into())
}

fn list(paths: &[PathBuf]) -> String {
    let paths: Vec<String> = paths.iter().map(|p| path_text(p)).collect();
    paths.join(" ")
}

fn path_text(path: &Path) -> String {
    path.display().to_string()
}

/// Where an error is that one of the run's recordings is not there, one whose hint is the option that says where it is now.
pub(super) fn where_recordings_are(error: Failure, config: &TrainConfig, run: &Path) -> Failure {
    let Some(path) = error.missing().map(Path::to_owned) else {
        return error;
    };
    // What is missing may lie within what was given.
    let within = |given: &PathBuf| path.starts_with(given);
    let data = &config.data;
    let option = if data.paths.iter().any(within) {
        Some("--data")
    } else if data.validation.iter().any(within) {
        Some("--val-data")
    } else if data.split.iter().any(within) {
        Some("--split")
    } else if data.validation_split.iter().any(within) {
        Some("--val-split")
    } else if data.sets.iter().any(|set| {
        let all = set.paths.iter().chain(&set.validation);
        let mut all = all.chain(&set.split).chain(&set.validation_split);
        all.any(within)
    }) {
        None
    } else {
        return error;
    };
    let run = run.to_owned();
    CliError::Moved { path, run, option }.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, Parser};
    use deepfusion_model::Preset;

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
        // What it has already is no contradiction, and what can apply is used.
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
            (&["--with", "hce"], "hce", "learned without it"),
            (
                &["--without", "smoothness"],
                "smoothness",
                "learned with it",
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
        // An option that is added has its place in one of the tables.
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
            assert!(known, "{option}: what becomes of it with --resume?");
        }
    }

    /// A name is compared as it is, whatever folder the command is given in.
    #[test]
    fn the_embedded_network_that_a_run_began_from_is_no_contradiction() {
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
    fn what_a_run_has_may_have_moved() {
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
        // Data sets have places of their own, in the file.
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
    fn the_error_of_a_recording_that_is_gone_names_its_option() {
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
        // Another file is another matter.
        assert!(!explained("/etc/x").0.contains("runs/a"));
    }
}
