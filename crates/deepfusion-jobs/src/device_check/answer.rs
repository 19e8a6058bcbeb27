//! The results that a process which checks a device prints, as lines of JSON.

use deepfusion_train::Device;
use deepfusion_train::device_check::{
    NeededBy, OperationCheck, OperationFailure, check_operation, operations,
};
use serde::{Deserialize, Serialize};

use crate::Result;

/// The result of one operation, as another process prints it.
#[derive(Debug, Serialize, Deserialize)]
struct OperationAnswer {
    operation: String,
    forward: f64,
    backward: Option<f64>,
    failure: Option<String>,
}

/// Checks operations, starting at `first`, each when the iterator reaches it. One that fails is the last, since it may have left the device
/// unusable.
pub fn checks_from(device: &Device, first: &str) -> impl Iterator<Item = OperationCheck> {
    let mut rest = operations().skip_while(move |(operation, _)| *operation != first);
    let mut failed = false;
    std::iter::from_fn(move || {
        if failed {
            return None;
        }
        let check = rest.find_map(|(operation, _)| check_operation(operation, device))?;
        failed = check.failure.is_some();
        Some(check)
    })
}

/// The result of an operation, as a line for the calling process.
///
/// # Errors
/// [`crate::Error::Json`].
pub fn answer_line(check: &OperationCheck) -> Result<String> {
    // JSON has no infinity.
    let answer = OperationAnswer {
        operation: check.operation.into(),
        forward: check.forward.min(f64::MAX),
        backward: check.backward.map(|error| error.min(f64::MAX)),
        failure: check.failure.as_ref().map(ToString::to_string),
    };
    Ok(serde_json::to_string(&answer)?)
}

/// Passes on a process's results for these operations, one after another, and returns those without a result. Other lines, such as a
/// driver's messages, are skipped.
pub(super) fn answered<'a, E>(
    printed: impl Iterator<Item = String>,
    asked: &'a [(&'static str, NeededBy)],
    mut done: impl FnMut(OperationCheck) -> Result<(), E>,
) -> Result<&'a [(&'static str, NeededBy)], E> {
    let mut rest = asked;
    for line in printed {
        let start = line.find("{\"operation\"").unwrap_or(line.len());
        let Ok(answer) = serde_json::from_str::<OperationAnswer>(&line[start..]) else {
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
            failure: answer.failure.map(OperationFailure::Panicked),
        })?;
    }
    Ok(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

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
                Ok::<(), crate::Error>(())
            });
            (found, rest.unwrap().len())
        };
        let lines = |names: &[&str]| {
            let lines: Vec<_> = names.iter().map(|name| answer(name)).collect();
            lines.join("\n")
        };
        assert_eq!(read(lines(&["a", "b", "c"])), (vec!["a", "b", "c"], 0));
        assert_eq!(read(lines(&["a"])), (vec!["a"], 2));
        // More results than requested, and results in another order.
        assert_eq!(read(lines(&["a", "b", "c", "d"])), (vec!["a", "b", "c"], 0));
        assert_eq!(read(lines(&["a", "c"])), (vec!["a"], 2));
        // A driver's messages between the results and before one.
        let among = format!("driver 1\n{}\nloading… {}", answer("a"), answer("b"));
        assert_eq!(read(among), (vec!["a", "b"], 1));
        assert_eq!(read(answer("a")[..20].to_string()), (vec![], 3));
    }

    #[test]
    fn infinite_errors_and_failures_are_read_back() {
        let failed = OperationCheck {
            operation: "warp",
            needed_by: NeededBy::Views,
            forward: f64::INFINITY,
            backward: Some(0.25),
            failure: Some(OperationFailure::Panicked("out of memory".into())),
        };
        let line = answer_line(&failed).unwrap();
        let asked = [("warp", NeededBy::Views)];
        let mut found = Vec::new();
        let rest = answered(std::iter::once(line), &asked, |check| {
            found.push(check);
            Ok::<(), crate::Error>(())
        });
        assert!(rest.unwrap().is_empty());
        let expected = OperationCheck {
            forward: f64::MAX,
            ..failed
        };
        assert_eq!(found, [expected]);
    }
}
