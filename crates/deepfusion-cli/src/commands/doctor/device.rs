//! `deepfusion doctor --device`: whether a device computes what the processor does.

use std::io::{self, Write};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use deepfusion_train::device_check::{
    DeviceCheck, NeededBy, OperationCheck, TOLERANCE, check_operation, operations,
};
use serde::{Deserialize, Serialize};

use super::patient_lines::PatientLines;
use crate::devices::{self, Backend, ComputeDevice};
use crate::error::CliError;
use crate::failure::{Context, Result};
use crate::output;

/// The longest that an operation may take, its kernels' compilation included. An H100 took less than a minute for all of them.
const LIMIT: Duration = Duration::from_secs(300);

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

/// One operation as another process prints it.
#[derive(Debug, Serialize, Deserialize)]
struct Answer {
    operation: String,
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
    let mut found = DeviceCheck::default();
    let done = |check: OperationCheck| {
        if !json {
            output::print(&line(&check))?;
        }
        found.operations.push(check);
        Ok(())
    };
    if chosen.backend == Backend::Cpu {
        let names = operations().map(|(operation, _)| operation);
        names
            .filter_map(|operation| check_operation(operation, &device))
            .try_for_each(done)?;
    } else {
        in_processes(chosen, done)?;
    }
    if json {
        output::print_json(&report(chosen, &found))?;
    }
    let wrong = found.wrong();
    if wrong == 0 {
        return Ok(());
    }
    Err(CliError::DeviceDiffers {
        device: chosen.to_string(),
        wrong,
        of: found.operations.len(),
        remedy: remedy(&found),
    }
    .into())
}

/// What a process does that a driver may end: each operation from this one on, printed as soon as it is done. One that fails is the last,
/// since it may have left the device unusable.
pub(super) fn print_from(chosen: ComputeDevice, first: &str) -> Result<()> {
    let device = devices::open(chosen)?;
    let rest = operations().skip_while(|(operation, _)| *operation != first);
    for (operation, _) in rest {
        let Some(check) = check_operation(operation, &device) else {
            continue;
        };
        let failed = check.failure.is_some();
        // JSON knows no infinity.
        let answer = Answer {
            operation: operation.into(),
            forward: check.forward.min(f64::MAX),
            backward: check.backward.map(|error| error.min(f64::MAX)),
            failure: check.failure,
        };
        let text = serde_json::to_string(&answer).context("cannot write a line of JSON")?;
        // Whoever asked may be gone.
        if writeln!(io::stdout(), "{text}").is_err() || failed {
            break;
        }
    }
    Ok(())
}

/// Has a process of this program check the operations, so that a driver which ends its process, or hangs, does not take along what was
/// found; another process continues with the next operation.
fn in_processes(
    chosen: ComputeDevice,
    mut done: impl FnMut(OperationCheck) -> Result<()>,
) -> Result<()> {
    let program = std::env::current_exe().context("cannot find this program's file")?;
    let all: Vec<_> = operations().collect();
    let mut rest = &all[..];
    while let Some((first, _)) = rest.first() {
        let mut process = Command::new(&program)
            .args(["doctor", "--device", &chosen.to_string()])
            .args(["--operations-from", first])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .context("cannot start this program again")?;
        let (mut failed, mut hangs) = (false, false);
        if let Some(printed) = process.stdout.take() {
            let mut lines = PatientLines::of(printed, LIMIT);
            rest = answered(&mut lines, rest, |check| {
                failed = check.failure.is_some();
                done(check)
            })?;
            hangs = lines.gave_up();
        }
        let why = ended(&mut process, hangs)?;
        if let ([(operation, needed_by), others @ ..], false) = (rest, failed) {
            rest = others;
            done(OperationCheck {
                operation,
                needed_by: *needed_by,
                forward: f64::INFINITY,
                backward: None,
                failure: Some(why),
            })?;
        }
    }
    Ok(())
}

/// How a process ended; one that hangs is killed.
fn ended(process: &mut Child, hangs: bool) -> Result<String> {
    if hangs {
        // It may have ended by itself just now.
        let _ = process.kill();
    }
    let status = process.wait().context("cannot wait for this program")?;
    Ok(if hangs {
        format!("it did not answer within {} s", LIMIT.as_secs())
    } else {
        format!("its process ended ({status})")
    })
}

/// Passes on what a process answered of these operations, one after the other, and gives those of which it said nothing. What a driver
/// prints is no answer.
fn answered<'a>(
    printed: impl Iterator<Item = String>,
    asked: &'a [(&'static str, NeededBy)],
    mut done: impl FnMut(OperationCheck) -> Result<()>,
) -> Result<&'a [(&'static str, NeededBy)]> {
    let mut rest = asked;
    for line in printed {
        let start = line.find("{\"operation\"").unwrap_or(line.len());
        let Ok(answer) = serde_json::from_str::<Answer>(&line[start..]) else {
            continue;
        };
        let [(operation, needed_by), others @ ..] = rest else {
            break;
        };
        if answer.operation != *operation {
            break;
        }
        rest = others;
        done(OperationCheck {
            operation,
            needed_by: *needed_by,
            forward: answer.forward,
            backward: answer.backward,
            failure: answer.failure,
        })?;
    }
    Ok(rest)
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

fn report(chosen: ComputeDevice, found: &DeviceCheck) -> Report {
    let rows = found.operations.iter().map(|check| Row {
        operation: check.operation,
        right: check.is_right(),
        forward: Some(check.forward).filter(|error| *error < f64::MAX),
        backward: check.backward.filter(|error| *error < f64::MAX),
        failure: check.failure.clone(),
    });
    Report {
        device: chosen.to_string(),
        tolerance: TOLERANCE,
        predict: found.predicts(),
        train: found.trains(),
        operations: rows.collect(),
    }
}

/// What to do without on this device.
fn remedy(found: &DeviceCheck) -> String {
    if !found.predicts() {
        return "use `--device cpu`: depth would not be what was trained; another backend or a newer driver may be right".into();
    }
    if !found.trains() {
        return "predict on it, and train with `--device cpu`: its gradients or losses are not to be relied on".into();
    }
    let without = [
        (NeededBy::Flow, "`--without flow`"),
        (NeededBy::Affine, "`--without affine`"),
        (NeededBy::MixedPrecision, "`--set precision=f32`"),
        (NeededBy::Depth, "no data set with `learn = \"depth\"`"),
        (NeededBy::LiteMono, "no lite-mono preset"),
        (NeededBy::RMsfm, "no r-msfm preset"),
        (NeededBy::DispNet, "not the preset sfmlearner"),
    ];
    let wrong = without.iter().filter(|(needs, _)| !found.is_right(*needs));
    let wrong: Vec<&str> = wrong.map(|(_, remedy)| *remedy).collect();
    format!("train on it with {}", wrong.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(wrong: &[(NeededBy, bool)]) -> DeviceCheck {
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
            NeededBy::MixedPrecision,
        ];
        let check = |needed_by| {
            let wrong = wrong.iter().find(|(needs, _)| *needs == needed_by);
            OperationCheck {
                operation: "any",
                needed_by,
                forward: if wrong.is_some_and(|(_, forward)| *forward) {
                    0.1
                } else {
                    0.0
                },
                backward: Some(if wrong.is_some() { 0.1 } else { 0.0 }),
                failure: None,
            }
        };
        DeviceCheck {
            operations: all.map(check).to_vec(),
        }
    }

    #[test]
    fn answers_belong_to_the_operations_they_name() {
        let asked = ["a", "b", "c"].map(|name| (name, NeededBy::Network));
        let answer = |name: &str| {
            format!(
                "{{\"operation\":\"{name}\",\"forward\":0.5,\"backward\":null,\"failure\":null}}"
            )
        };
        let read = |printed: String| {
            let mut found = Vec::new();
            let rest = answered(printed.lines().map(str::to_owned), &asked, |check| {
                found.push(check.operation);
                Ok(())
            });
            (found, rest.unwrap().len())
        };
        let lines = |names: &[&str]| {
            let lines: Vec<_> = names.iter().map(|name| answer(name)).collect();
            lines.join("\n")
        };
        assert_eq!(read(lines(&["a", "b", "c"])), (vec!["a", "b", "c"], 0));
        assert_eq!(read(lines(&["a"])), (vec!["a"], 2));
        // More than was asked for, and another order.
        assert_eq!(read(lines(&["a", "b", "c", "d"])), (vec!["a", "b", "c"], 0));
        assert_eq!(read(lines(&["a", "c"])), (vec!["a"], 2));
        // A driver's words between them and before one.
        let among = format!("driver 1\n{}\nloading… {}", answer("a"), answer("b"));
        assert_eq!(read(among), (vec!["a", "b"], 1));
        assert_eq!(read(answer("a")[..20].to_string()), (vec![], 3));
    }

    #[test]
    fn what_to_do_without_follows_from_what_differs() {
        let of = |wrong: &[(NeededBy, bool)]| remedy(&found(wrong));
        assert!(of(&[(NeededBy::Network, true)]).contains("--device cpu"));
        assert!(of(&[(NeededBy::Network, false)]).starts_with("predict on it"));
        assert!(of(&[(NeededBy::Views, true)]).starts_with("predict on it"));
        let parts = of(&[(NeededBy::Flow, true), (NeededBy::Affine, false)]);
        assert_eq!(
            parts,
            "train on it with `--without flow`, `--without affine`"
        );
        let mixed = of(&[(NeededBy::MixedPrecision, true)]);
        assert_eq!(mixed, "train on it with `--set precision=f32`");
    }
}
