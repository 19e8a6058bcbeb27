//! `deepfusion doctor --device`: whether a device's results match the processor's.

use std::io::{self, Write};
use std::process::Command;

use deepfusion_jobs::device_check::{DeviceCheckRecord, answer_line, check_device, checks_from};
use deepfusion_train::device_check::{DeviceUse, NeededBy, OperationCheck, TOLERANCE};

use crate::devices::{self, ComputeDevice};
use crate::error::CliError;
use crate::failure::{Context, Result};
use crate::output;

/// Compares the device with the processor, printing a line as each operation is done.
pub(super) fn run(chosen: ComputeDevice, json: bool) -> Result<()> {
    let device = devices::open(chosen)?;
    if !json {
        output::print(&format!(
            "{chosen} compared with the processor: largest difference over largest value, at most {TOLERANCE}\n\n\
             {:40} {:>9} {:>9}\n",
            "", "forward", "backward"
        ))?;
    }
    let report = |check: &OperationCheck| {
        if json {
            Ok(())
        } else {
            output::print(&line(check))
        }
    };
    let found = check_device(chosen, &device, |first| new_process(chosen, first), report)?;
    if json {
        output::print_json(&DeviceCheckRecord::of(chosen, &found))?;
    }
    let wrong = found.wrong();
    if wrong == 0 {
        return Ok(());
    }
    Err(CliError::DeviceDiffers {
        device: chosen.to_string(),
        wrong,
        of: found.operations.len(),
        hint: hint(&found.usable_for()),
    }
    .into())
}

/// This program as a new process, which checks the operations from `first` on and answers with [`print_from`].
fn new_process(chosen: ComputeDevice, first: &str) -> Result<Command> {
    let program = std::env::current_exe().context("cannot find this program's file")?;
    let mut command = Command::new(program);
    command
        .args(["doctor", "--device", &chosen.to_string()])
        .args(["--operations-from", first]);
    Ok(command)
}

/// Checks each operation from `first` on and prints it as soon as it is done: the part that runs in a process of its own, which a driver's
/// crash may end.
pub(super) fn print_from(chosen: ComputeDevice, first: &str) -> Result<()> {
    let device = devices::open(chosen)?;
    for check in checks_from(&device, first) {
        let text = answer_line(&check).context("cannot write a line of JSON")?;
        // The process that asked may have ended.
        if writeln!(io::stdout(), "{text}").is_err() {
            break;
        }
    }
    Ok(())
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
            let why = why.to_string();
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

/// What the device can still be used for.
fn hint(usable_for: &DeviceUse) -> String {
    match usable_for {
        DeviceUse::Nothing => {
            "use `--device cpu`, another backend or a newer driver: depth from this device would be wrong".into()
        }
        DeviceUse::Prediction => {
            "predict on it, and train with `--device cpu`: its gradients or losses are wrong".into()
        }
        DeviceUse::TrainingWithout(parts) => {
            let parts: Vec<&str> = parts.iter().copied().filter_map(without).collect();
            format!("train on it with {}", parts.join(", "))
        }
    }
}

/// The option that trains without an operation.
fn without(part: NeededBy) -> Option<&'static str> {
    Some(match part {
        NeededBy::Flow => "`--without flow`",
        NeededBy::Affine => "`--without affine`",
        NeededBy::MixedPrecision => "`--set precision=f32`",
        NeededBy::Depth => "no data set with `learn = \"depth\"`",
        NeededBy::LiteMono => "no lite-mono preset",
        NeededBy::RMsfm => "no r-msfm preset",
        NeededBy::DispNet => "not the preset sfmlearner",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hint_names_options() {
        assert!(hint(&DeviceUse::Nothing).contains("--device cpu"));
        assert!(hint(&DeviceUse::Prediction).starts_with("predict on it"));
        let of = |parts: &[NeededBy]| hint(&DeviceUse::TrainingWithout(parts.to_vec()));
        assert_eq!(
            of(&[NeededBy::Flow, NeededBy::Affine]),
            "train on it with `--without flow`, `--without affine`"
        );
        assert_eq!(
            of(&[NeededBy::MixedPrecision]),
            "train on it with `--set precision=f32`"
        );
    }

    #[test]
    fn a_failed_operation_is_a_line() {
        use deepfusion_train::device_check::OperationFailure;
        let failed = OperationCheck {
            operation: "warp",
            needed_by: NeededBy::Views,
            forward: f64::INFINITY,
            backward: None,
            failure: Some(OperationFailure::Panicked("out of memory\nat …".into())),
        };
        let text = line(&failed);
        assert!(text.starts_with("warp "), "{text}");
        assert!(text.ends_with(" failed: out of memory\n"), "{text}");
    }
}
