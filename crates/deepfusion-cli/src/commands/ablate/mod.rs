//! `deepfusion ablate`: the on/off table of the paper's Table 3, row by row.

mod rows;
mod table;

use std::path::{Path, PathBuf};
use std::time::Instant;

use burn::tensor::Device;
use deepfusion_data::{Cameras, GtKind};
use deepfusion_eval::{GroundTruth, Protocol, Report};
use deepfusion_hint::count_of;
use deepfusion_jobs::evaluation::{
    Truth, baseline_from_datasets, default_crop, evaluate_datasets, predict,
};
use deepfusion_jobs::recordings::{camera_word, training_recordings};
use deepfusion_model::{CheckpointKind, Preset, RunFolder, TrainConfig, ViewMotion};
use deepfusion_runtime::ModelSource;
use deepfusion_train::Trainer;
use serde::{Deserialize, Deserializer, Serialize};

use self::rows::Row;
use self::table::RunResult;
use super::recordings::{open_datasets, open_samples};
use super::{device, resume, train};
use crate::cli::{AblateArgs, ComputeDevice, EngineArgs};
use crate::error::CliError;
use crate::failure::{Context, Result};
use crate::progress::{Progress, say};
use crate::{engine, interrupt, output};

/// What the table is made of; stored beside it, so that it can be gone on with.
#[derive(Debug, Serialize, Deserialize)]
struct Plan {
    /// Optimiser steps of every run.
    budget: usize,
    /// Seeds 0 to this less one.
    seeds: u64,
    /// The rows.
    rows: Vec<Row>,
    /// Recordings to measure on; empty: those trained on.
    eval_data: Vec<PathBuf>,
    /// What all rows share.
    #[serde(deserialize_with = "settings")]
    config: TrainConfig,
}

/// A configuration; one that an earlier run wrote may also hold that run's findings.
fn settings<'de, D: Deserializer<'de>>(from: D) -> Result<TrainConfig, D::Error> {
    let read = TrainConfig::from_run_table(toml::Table::deserialize(from)?);
    Ok(read.map_err(serde::de::Error::custom)?.0)
}

const PLAN: &str = "ablate.toml";

/// `deepfusion ablate`.
pub(super) fn run(args: &AblateArgs) -> Result<()> {
    let (out, plan) = if args.resume {
        let out = args.out.clone().unwrap_or_default();
        let mut plan = read_plan(&out)?;
        plan.seeds = plan.seeds.max(args.seeds.unwrap_or(0) as u64);
        if !args.data.is_empty() {
            plan.config.data.paths.clone_from(&args.data);
            plan.config.make_absolute();
        }
        (out, plan)
    } else {
        let plan = new_plan(args)?;
        (output::run_folder(args.out.as_deref(), "ablate")?, plan)
    };
    // Every row is looked at before the first trains for hours.
    let configs = plan.rows.iter().map(|row| row.config(&plan.config));
    let configs = configs.collect::<Result<Vec<_>, _>>()?;
    open_samples(&configs[0]).map_err(|error| {
        if args.resume {
            resume::where_recordings_are(error, &configs[0], &out)
        } else {
            error
        }
    })?;
    open_eval_data(&plan)?;
    write(&out.join(PLAN), &toml::to_string_pretty(&plan)?)?;

    let mut results = Vec::new();
    let runs = plan.seeds as usize * plan.rows.len();
    for seed in 0..plan.seeds {
        for (row, config) in plan.rows.iter().zip(&configs) {
            let folder = out
                .join("rows")
                .join(row.name())
                .join(format!("seed-{seed}"));
            let place = results.len() + 1;
            say(&format!(
                "run {place} of {runs}: {}, seed {seed}",
                row.name()
            ));
            let config = TrainConfig {
                seed,
                steps: Some(plan.budget),
                ..config.clone()
            };
            let result = match one_run(&folder, *row, config, &plan, args.device)? {
                Outcome::Done(result) => result,
                Outcome::Stopped { step, steps } => {
                    let go_on = format!("deepfusion ablate --out {} --resume", out.display());
                    return Err(CliError::Stopped { step, steps, go_on }.into());
                }
            };
            results.push(*result);
            write_tables(&out, &plan, &results)?;
        }
    }
    let table = table::table(&plan.rows, &results);
    if args.json {
        output::print_json(&table)
    } else {
        output::print(&format!("{}{}\n", table::text(&table), out.display()))
    }
}

fn new_plan(args: &AblateArgs) -> Result<Plan> {
    let mut config = match &args.config {
        Some(path) => TrainConfig::read_over_preset(path, args.device.compute())?,
        None => {
            let preset = args.preset.unwrap_or(Preset::Light);
            let mut config = preset.config_on(args.device.compute());
            // A measured motion in the warp would teach the rows without the speed loss, too; and masks of dynamic pixels
            // are no part of the flow loss.
            config.view_motion = ViewMotion::PoseNet;
            config.loss.moving.enabled = false;
            config
        }
    };
    for term in &args.with {
        config.with(term)?;
    }
    for term in &args.without {
        config.without(term)?;
    }
    config.view_motion = args.view_motion.unwrap_or(config.view_motion);
    if let Some(size) = args.size {
        config.size.width = size.width as usize;
        config.size.height = size.height as usize;
    }
    config.batch = args.batch.unwrap_or(config.batch);
    for assignment in &args.set {
        if let Some(reason) = decided_by_the_table(assignment) {
            let (assignment, reason) = (assignment.clone(), reason.into());
            return Err(deepfusion_model::Error::Setting { assignment, reason }.into());
        }
        config.set(assignment)?;
    }
    config.data.paths.clone_from(&args.data);
    config.data.camera = camera_word(args.camera).into();
    // Every row begins anew.
    (config.init, config.init_sha256) = (None, None);
    // It may be resumed from any folder.
    config.make_absolute();
    let absolute = |path: &PathBuf| std::path::absolute(path).unwrap_or_else(|_| path.clone());
    Ok(Plan {
        budget: args.budget.unwrap_or(0).max(1),
        seeds: args.seeds.unwrap_or(1).max(1) as u64,
        rows: chosen(&args.rows)?,
        eval_data: args.eval_data.iter().map(absolute).collect(),
        config,
    })
}

/// Why a key cannot be set for all rows, where it cannot.
fn decided_by_the_table(assignment: &str) -> Option<&'static str> {
    let key = assignment.split('=').next().unwrap_or_default().trim();
    match key {
        "steps" | "epochs" | "min_steps" => Some("--budget says how long every run learns"),
        "seed" => Some("--seeds says how often a row is run, and with which seeds"),
        "init" | "init_sha256" => Some("every run begins from nothing"),
        "data.paths" => Some("the recordings are those of --data"),
        "data.camera" => Some("the cameras are those of --camera"),
        _ => None,
    }
}

/// The rows of these names; those of the paper's table where none is named.
fn chosen(names: &[String]) -> Result<Vec<Row>> {
    if names.is_empty() {
        return Ok(Row::table_3());
    }
    let all = Row::all();
    let find = |name: &String| {
        let row = all.iter().find(|row| row.name() == *name).copied();
        row.ok_or_else(|| {
            let known: Vec<String> = all.iter().map(|row| row.name()).collect();
            deepfusion_model::Error::Config {
                field: "rows",
                expected: format!("one of {}", known.join(", ")),
                found: name.clone(),
            }
            .into()
        })
    };
    names.iter().map(find).collect()
}

fn read_plan(out: &Path) -> Result<Plan> {
    let path = out.join(PLAN);
    let text =
        std::fs::read_to_string(&path).map_err(|e| deepfusion_data::Error::file(&path, e))?;
    Ok(
        toml::from_str(&text).map_err(|e| deepfusion_model::Error::ConfigFile {
            path,
            reason: e.to_string(),
        })?,
    )
}

/// How a run ended.
enum Outcome {
    /// Trained and measured.
    Done(Box<RunResult>),
    /// Asked to stop; training or measuring goes on from the step it is at.
    Stopped { step: usize, steps: usize },
}

/// Trains and measures one run, or as much of it as is not done yet.
fn one_run(
    folder: &Path,
    row: Row,
    config: TrainConfig,
    plan: &Plan,
    device: ComputeDevice,
) -> Result<Outcome> {
    let done = folder.join("result.json");
    if done.exists() {
        let text =
            std::fs::read_to_string(&done).map_err(|e| deepfusion_data::Error::file(&done, e))?;
        let result = serde_json::from_str(&text).with_context(|| {
            format!(
                "{}: not a result of ablate; delete it to run this row again",
                done.display()
            )
        })?;
        return Ok(Outcome::Done(Box::new(result)));
    }
    let run = folder.join("run");
    let parts = config.depth_net.costs(config.size);
    let parameters = parts.iter().map(|part| part.parameters).sum();
    let mut trainer = open_run(&run, config, &device::open(device)?)?;
    let start = Instant::now();
    if trainer.step() < trainer.steps() {
        train::train(&mut trainer, None)?;
    }
    let seconds = spent(folder, start.elapsed().as_secs_f64())?;
    let (step, steps) = (trainer.step(), trainer.steps());
    if step < steps || interrupt::asked() {
        return Ok(Outcome::Stopped { step, steps });
    }
    drop(trainer);
    let result = RunResult {
        row,
        seed: RunFolder::open(&run)?.0.read_config()?.seed,
        train_seconds: seconds,
        parameters: Some(parameters),
        report: measure(&run, plan, device)?,
    };
    write(&done, &serde_json::to_string_pretty(&result)?)?;
    Ok(Outcome::Done(Box::new(result)))
}

/// The run where its last checkpoint stands, or a new one.
fn open_run(run: &Path, config: TrainConfig, device: &Device) -> Result<Trainer> {
    let sets = open_samples(&config)?;
    if let Ok((folder, _)) = RunFolder::open(run) {
        if folder.checkpoint_path(CheckpointKind::Last).exists() {
            let stored = folder.read_config()?;
            return Ok(Trainer::resume(stored, folder, sets, device)?);
        }
        // It ended before its first checkpoint: nothing is lost with it.
        std::fs::remove_dir_all(run).map_err(|e| deepfusion_data::Error::file(run, e))?;
    }
    Ok(Trainer::create(
        config,
        RunFolder::create(run)?,
        sets,
        device,
        Ok,
    )?)
}

/// Seconds of training so far, these included; kept beside the run for the next time.
fn spent(folder: &Path, seconds: f64) -> Result<f64> {
    let path = folder.join("seconds");
    let before = std::fs::read_to_string(&path).ok();
    let before: f64 = before.and_then(|t| t.trim().parse().ok()).unwrap_or(0.0);
    write(&path, &format!("{}\n", before + seconds))?;
    Ok(before + seconds)
}

/// The run's last checkpoint, measured like `eval` does: equal budgets are compared, and not choices of a checkpoint.
fn measure(run: &Path, plan: &Plan, device: ComputeDevice) -> Result<Report> {
    let checkpoint = ModelSource::named(&run.join("last.safetensors"))?;
    let mut estimator = engine::load(&checkpoint, &EngineArgs::on(device))?;
    let (train_sets, eval_sets) = open_eval_data(plan)?;
    let protocol = Protocol {
        crop: default_crop(&eval_sets),
        gt: GroundTruth::Z,
        ..Protocol::default()
    };
    let mut progress = Progress::new("evaluating");
    let evaluated = evaluate_datasets::<crate::failure::Failure>(
        &eval_sets,
        &mut Truth::Scans(GtKind::Z),
        &protocol,
        Some(baseline_from_datasets(&train_sets, GtKind::Z)?),
        &mut |dataset, frame| {
            let image = dataset.load_image(frame)?;
            let camera = dataset.intrinsics(frame);
            Ok(predict(&mut estimator, &image, &camera, true)?)
        },
        &mut |done, total| progress.set(done, total),
    )?;
    Ok(evaluated.report)
}

type Datasets = Vec<deepfusion_data::Dataset>;

/// The recordings trained on, for the mean-depth baseline, and those measured on.
fn open_eval_data(plan: &Plan) -> Result<(Datasets, Datasets)> {
    let trained_on = || -> Result<Datasets> {
        let recordings = training_recordings(&plan.config)?;
        Ok(recordings.into_iter().map(|(_, dataset)| dataset).collect())
    };
    let eval = match plan.eval_data.as_slice() {
        [] => trained_on()?,
        paths => open_datasets(paths, None, Cameras::default())?,
    };
    let train = trained_on()?;
    Ok((train, eval))
}

fn write_tables(out: &Path, plan: &Plan, results: &[RunResult]) -> Result<()> {
    let table = table::table(&plan.rows, results);
    let mut text = table::text(&table);
    let place = if plan.eval_data.is_empty() {
        "measured on the recordings trained on"
    } else {
        "measured on other recordings than those trained on"
    };
    text.push_str(&format!(
        "\n{} a run, {place}; mean ± standard deviation over seeds; \
        the seven metrics unscaled, abs_rel_scaled after median scaling; parameters of the depth network\n",
        count_of(plan.budget, "step")
    ));
    if let Some(mean_depth_baseline) = results
        .iter()
        .find_map(|r| r.report.mean_depth_baseline.as_ref())
    {
        text.push_str(&format!(
            "mean-depth baseline: abs_rel {:.3} unscaled, {:.3} median-scaled\n",
            mean_depth_baseline.unscaled.abs_rel, mean_depth_baseline.median_scaled.abs_rel
        ));
    }
    write(&out.join("table.txt"), &text)?;
    write(&out.join("table.csv"), &table::csv(&table))?;
    write(&out.join("table.md"), &table::markdown(&table))?;
    write(&out.join("table.tex"), &table::latex(&table))
}

/// Writes a text file whole or not at all.
fn write(path: &Path, text: &str) -> Result<()> {
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent).map_err(|e| deepfusion_data::Error::file(parent, e))?;
    }
    output::write(path, text)
}
