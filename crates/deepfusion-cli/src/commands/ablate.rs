//! `deepfusion ablate`: the on/off table of the paper's Table 3, row by row.

use std::path::Path;
use std::time::Instant;

use deepfusion_data::{GtKind, OpenOptions};
use deepfusion_jobs::evaluation::has_truth;
use deepfusion_jobs::training::RunLock;
use deepfusion_jobs::training::ablation::{
    OpenRun, Plan, PlanRequest, Run, RunResult, TableDecides, table, text,
};
use deepfusion_model::{Error as ModelError, SettingProblem, TrainConfig};
use deepfusion_runtime::ModelSource;

use super::recordings::{open_samples, print_warnings, warn_of_sample};
use super::{resume, train};
use crate::cli::{AblateArgs, EngineArgs};
use crate::devices::{self, ComputeDevice};
use crate::error::CliError;
use crate::failure::{Failure, Result};
use crate::progress::{Progress, say};
use crate::{engine, interrupt, output};

/// `deepfusion ablate`.
pub(super) fn run(args: &AblateArgs) -> Result<()> {
    let (out, plan) = if args.resume {
        let out = args.out.clone().unwrap_or_default();
        let mut plan = Plan::read(&out)?;
        plan.continue_with(args.seeds.unwrap_or(0) as u64, &args.data);
        (out, plan)
    } else {
        let plan = request(args)?.plan().map_err(in_options)?;
        (output::run_folder(args.out.as_deref(), "ablate")?, plan)
    };
    // Another process would remove a row that has no checkpoint yet.
    let _lock = RunLock::take(&out)?;
    let configs = plan.row_configs()?;
    open_samples(&configs[0]).map_err(|error| {
        if args.resume {
            resume::where_recordings_are(error, &configs[0], &out)
        } else {
            error
        }
    })?;
    let (_, measured_on) = plan.open_eval_data()?;
    if !has_truth(&measured_on, GtKind::Z) {
        return Err(CliError::NoTruth.into());
    }
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
                Run::Open(run) => train_and_evaluate(*run, &plan, &out, args.device)?,
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

fn request(args: &AblateArgs) -> Result<PlanRequest> {
    train::check_terms(&args.with, &args.without)?;
    let file = match &args.config {
        Some(path) => Some(TrainConfig::read_over_preset(path, args.device.compute())?),
        None => None,
    };
    Ok(PlanRequest {
        file: file.map(Box::new),
        preset: args.preset,
        compute: args.device.compute(),
        with: args.with.clone(),
        without: args.without.clone(),
        view_motion: args.view_motion,
        size: args.size.map(Into::into),
        batch: args.batch,
        assignments: args.set.clone(),
        data: args.data.clone(),
        camera: args.camera,
        eval_data: args.eval_data.clone(),
        rows: args.rows.clone(),
        budget: args.budget.unwrap_or(0),
        seeds: args.seeds.unwrap_or(1) as u64,
    })
}

/// Names the option for a key that the table decides.
fn in_options(error: deepfusion_jobs::Error) -> Failure {
    let deepfusion_jobs::Error::Model(ModelError::Setting { assignment, .. }) = &error else {
        return error.into();
    };
    let Some(decides) = TableDecides::about(assignment) else {
        return error.into();
    };
    let reason = SettingProblem::DecidedElsewhere(match decides {
        TableDecides::Length => "--budget sets how long every run is trained",
        TableDecides::Seed => "--seeds sets how often a row is run, and with which seeds",
        TableDecides::Recordings => "--data gives the recordings",
        TableDecides::Cameras => "--camera chooses the cameras",
        other => other.reason(),
    });
    let assignment = assignment.clone();
    ModelError::Setting { assignment, reason }.into()
}

/// Trains and evaluates one run, or continues it.
fn train_and_evaluate(
    run: OpenRun,
    plan: &Plan,
    out: &Path,
    device: ComputeDevice,
) -> Result<RunResult> {
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
