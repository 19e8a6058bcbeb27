//! `deepfusion doctor --device`: whether a device computes what the processor does.

use std::process::{Command, Stdio};

use deepfusion_train::device_check::{
    NeededBy, OperationCheck, TOLERANCE, check_operation, operations,
};
use serde::{Deserialize, Serialize};

use crate::devices::{self, Backend, ComputeDevice};
use crate::error::CliError;
use crate::failure::{Context, Result};
use crate::output;

/// What was found.
#[derive(Debug, Serialize)]
struct Report {
    device: String,
    tolerance: f64,
    /// Whether the ResNet presets' depth is the processor's.
    predict: bool,
    /// Whether they learn from video as on the processor.
    train: bool,
    operations: Vec<Row>,
}

/// An operation; errors over the largest value, `null` where that is infinite or NaN.
#[derive(Debug, Serialize)]
struct Row {
    operation: &'static str,
    right: bool,
    forward: Option<f64>,
    backward: Option<f64>,
    failure: Option<String>,
}

/// One operation as its own process prints it.
#[derive(Debug, Serialize, Deserialize)]
struct Printed {
    forward: f64,
    backward: Option<f64>,
    failure: Option<String>,
}

/// Compares, a line as each operation is done.
pub(super) fn run(chosen: ComputeDevice, json: bool) -> Result<()> {
    let device = devices::open(chosen)?;
    if !json {
        output::print(&format!(
            "{chosen} beside the processor: errors over the largest value, at most {TOLERANCE}\n\n\
             {:40} {:>9} {:>9}\n",
            "", "forward", "backward"
        ))?;
    }
    let mut checks = Vec::new();
    for (operation, needed_by) in operations() {
        // A driver may end its process, and with it all that was found so far.
        let check = match chosen.backend {
            Backend::Cpu => check_operation(operation, &device),
            _ => Some(in_its_own_process(operation, needed_by, chosen)?),
        };
        let Some(check) = check else { continue };
        if !json {
            output::print(&line(&check))?;
        }
        checks.push(check);
    }
    if json {
        output::print_json(&report(chosen, &checks))?;
    }
    let wrong = checks.iter().filter(|check| !check.is_right()).count();
    if wrong == 0 {
        return Ok(());
    }
    Err(CliError::DeviceDiffers {
        device: chosen.to_string(),
        wrong,
        of: checks.len(),
        remedy: remedy(&checks),
    }
    .into())
}

/// What the process of one operation does.
pub(super) fn one(chosen: ComputeDevice, operation: &str) -> Result<()> {
    let device = devices::open(chosen)?;
    let check = check_operation(operation, &device);
    // JSON knows no infinity.
    output::print_json(&check.map(|check| Printed {
        forward: check.forward.min(f64::MAX),
        backward: check.backward.map(|error| error.min(f64::MAX)),
        failure: check.failure,
    }))
}

/// Has this program check one operation.
fn in_its_own_process(
    operation: &'static str,
    needed_by: NeededBy,
    chosen: ComputeDevice,
) -> Result<OperationCheck> {
    let program = std::env::current_exe().context("cannot find this program's file")?;
    let done = Command::new(program)
        .args(["doctor", "--device", &chosen.to_string()])
        .args(["--operation", operation])
        .stdin(Stdio::null())
        .output()
        .context("cannot start this program again")?;
    let check = OperationCheck {
        operation,
        needed_by,
        forward: f64::INFINITY,
        backward: None,
        failure: None,
    };
    Ok(match serde_json::from_slice::<Printed>(&done.stdout) {
        Ok(printed) => OperationCheck {
            forward: printed.forward,
            backward: printed.backward,
            failure: printed.failure,
            ..check
        },
        Err(_) => OperationCheck {
            failure: Some(format!("its process ended ({})", done.status)),
            ..check
        },
    })
}

fn line(check: &OperationCheck) -> String {
    let mark = if check.is_right() { "" } else { "  differs" };
    let number = |error: f64| match error {
        0.0 => format!("{:>9}", "0"),
        _ => format!("{error:9.1e}"),
    };
    let backward = check.backward.map_or_else(|| format!("{:>9}", "-"), number);
    match &check.failure {
        Some(why) => {
            let first = why.lines().next().unwrap_or_default();
            format!("{:40} failed: {first}\n", check.operation)
        }
        None => format!(
            "{:40} {} {backward}{mark}\n",
            check.operation,
            number(check.forward)
        ),
    }
}

fn report(chosen: ComputeDevice, checks: &[OperationCheck]) -> Report {
    let rows = checks.iter().map(|check| Row {
        operation: check.operation,
        right: check.is_right(),
        forward: Some(check.forward).filter(|error| *error < f64::MAX),
        backward: check.backward.filter(|error| *error < f64::MAX),
        failure: check.failure.clone(),
    });
    Report {
        device: chosen.to_string(),
        tolerance: TOLERANCE,
        predict: predicts(checks),
        train: trains(checks),
        operations: rows.collect(),
    }
}

/// The operations that something needs.
fn of(checks: &[OperationCheck], needs: NeededBy) -> impl Iterator<Item = &OperationCheck> {
    checks.iter().filter(move |check| check.needed_by == needs)
}

fn predicts(checks: &[OperationCheck]) -> bool {
    of(checks, NeededBy::Network).all(OperationCheck::forward_is_right)
}

fn trains(checks: &[OperationCheck]) -> bool {
    [NeededBy::Network, NeededBy::Views, NeededBy::Learning]
        .into_iter()
        .all(|needs| of(checks, needs).all(OperationCheck::is_right))
}

/// What to do without on this device.
fn remedy(checks: &[OperationCheck]) -> String {
    if !predicts(checks) {
        return "use `--device cpu`: depth would not be what was trained; another backend or a newer driver may be right".into();
    }
    if !trains(checks) {
        return "predict on it, and train with `--device cpu`: its gradients or losses are not to be relied on".into();
    }
    let without = [
        (NeededBy::Flow, "`--without flow`"),
        (NeededBy::Affine, "`--without affine`"),
        (NeededBy::Depth, "no data set with `learn = \"depth\"`"),
        (NeededBy::LiteMono, "no lite-mono preset"),
        (NeededBy::RMsfm, "no r-msfm preset"),
        (NeededBy::DispNet, "not the preset sfmlearner"),
    ];
    let wrong = without
        .iter()
        .filter(|(needs, _)| !of(checks, *needs).all(OperationCheck::is_right));
    let wrong: Vec<&str> = wrong.map(|(_, remedy)| *remedy).collect();
    format!("train on it with {}", wrong.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checks(wrong: &[(NeededBy, bool)]) -> Vec<OperationCheck> {
        let all = [
            NeededBy::Network,
            NeededBy::LiteMono,
            NeededBy::RMsfm,
            NeededBy::DispNet,
            NeededBy::Views,
            NeededBy::Depth,
            NeededBy::Flow,
            NeededBy::Affine,
            NeededBy::Learning,
        ];
        let check = |needed_by| {
            let found = wrong.iter().find(|(needs, _)| *needs == needed_by);
            OperationCheck {
                operation: "any",
                needed_by,
                forward: if found.is_some_and(|(_, forward)| *forward) {
                    0.1
                } else {
                    0.0
                },
                backward: Some(if found.is_some() { 0.1 } else { 0.0 }),
                failure: None,
            }
        };
        all.map(check).to_vec()
    }

    #[test]
    fn what_to_do_without_follows_from_what_differs() {
        let of = |wrong: &[(NeededBy, bool)]| remedy(&checks(wrong));
        assert!(of(&[(NeededBy::Network, true)]).contains("--device cpu"));
        let gradients = checks(&[(NeededBy::Network, false)]);
        assert!(predicts(&gradients) && !trains(&gradients));
        assert!(remedy(&gradients).starts_with("predict on it"));
        assert!(of(&[(NeededBy::Views, true)]).starts_with("predict on it"));
        let parts = of(&[(NeededBy::Flow, true), (NeededBy::Affine, false)]);
        assert_eq!(
            parts,
            "train on it with `--without flow`, `--without affine`"
        );
    }
}
