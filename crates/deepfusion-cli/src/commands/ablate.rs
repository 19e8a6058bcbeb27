//! `deepfusion ablate`: the on/off table of the paper's Table 3, row by row.

use std::path::{Path, PathBuf};
use std::time::Instant;

use deepfusion_data::OpenOptions;
use deepfusion_jobs::recordings::camera_word;
use deepfusion_jobs::training::ablation::{OpenRun, Plan, Row, Run, RunResult, table, text};
use deepfusion_model::{Preset, SettingProblem, TrainConfig, ViewMotion};
use deepfusion_runtime::ModelSource;

use super::recordings::{open_samples, print_warnings, warn_of_sample};
use super::{resume, train};
use crate::cli::{AblateArgs, EngineArgs};
use crate::devices::{self, ComputeDevice};
use crate::error::CliError;
use crate::failure::Result;
use crate::progress::{Progress, say};
use crate::{engine, interrupt, output};

/// `deepfusion ablate`.
pub(super) fn run(args: &AblateArgs) -> Result<()> {
    let (out, plan) = if args.resume {
        let out = args.out.clone().unwrap_or_default();
        let mut plan = Plan::read(&out)?;
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
    let configs = plan.row_configs()?;
    open_samples(&configs[0]).map_err(|error| {
        if args.resume {
            resume::where_recordings_are(error, &configs[0], &out)
        } else {
            error
        }
    })?;
    let (_, measured_on) = plan.open_eval_data()?;
    print_warnings(&OpenOptions::default(), &measured_on);
    plan.write(&out)?;

    let mut results = Vec::new();
    let runs = plan.seeds as usize * plan.rows.len();
    for seed in 0..plan.seeds {
        for (row, config) in plan.rows.iter().zip(&configs) {
            let place = results.len() + 1;
            say(&format!(
                "run {place} of {runs}: {}, seed {seed}",
                row.name()
            ));
            results.push(match plan.run(&out, *row, config, seed)? {
                Run::Done(result) => *result,
                Run::Open(run) => made(*run, &plan, &out, args.device)?,
            });
            plan.write_tables(&out, &results)?;
        }
    }
    let table = table(&plan.rows, &results);
    if args.json {
        output::print_json(&table)
    } else {
        output::print(&format!("{}{}\n", text(&table), out.display()))
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
            let (assignment, reason) =
                (assignment.clone(), SettingProblem::DecidedElsewhere(reason));
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
        rows: Row::named(&args.rows)?,
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

/// Trains and measures one run, or as much of it as is not done yet.
fn made(run: OpenRun, plan: &Plan, out: &Path, device: ComputeDevice) -> Result<RunResult> {
    let mut trainer = run.trainer(
        &devices::open(device)?,
        &mut print_warnings,
        &mut warn_of_sample,
    )?;
    let start = Instant::now();
    if trainer.step() < trainer.steps() {
        train::train(&mut trainer, None)?;
    }
    run.add_seconds(start.elapsed().as_secs_f64())?;
    let (step, steps) = (trainer.step(), trainer.steps());
    if step < steps || interrupt::asked() {
        let go_on = format!("deepfusion ablate --out {} --resume", out.display());
        return Err(CliError::Stopped { step, steps, go_on }.into());
    }
    drop(trainer);
    let checkpoint = ModelSource::named(&run.run_folder().join("last.safetensors"))?;
    let mut estimator = engine::load(&checkpoint, &EngineArgs::on(device))?;
    let mut progress = Progress::new("evaluating");
    Ok(run.measure(plan, &mut estimator, &mut |done, total| {
        progress.set(done, total);
    })?)
}
