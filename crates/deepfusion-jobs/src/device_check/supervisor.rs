//! Runs processes that check a device, one after another.

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use deepfusion_train::Device;
use deepfusion_train::device_check::{
    DeviceCheck, NeededBy, OperationCheck, OperationFailure, check_operation, operations,
};

use super::answer::answered;
use super::patient_lines::PatientLines;
use crate::devices::{Backend, ComputeDevice};
use crate::{Error, Result};

/// The longest time for an operation, including the compilation of its kernels. An H100 took less than a minute for all of them.
const LIMIT: Duration = Duration::from_secs(300);

/// Computes every operation on an open device and on the processor; `report` receives each as soon as it is done. The processor is compared
/// with itself in this process. For any other device, `program` is called with an operation's name. It returns the command of a process
/// that prints each of [`checks_from`](super::checks_from) from that operation on, as its [`answer_line`](super::answer_line).
///
/// # Errors
/// [`Error::CheckNotStarted`] and [`Error::CheckNotEnded`], and the callbacks' errors. A running process is then ended.
pub fn check_device<E: From<Error>>(
    chosen: ComputeDevice,
    device: &Device,
    mut program: impl FnMut(&str) -> Result<Command, E>,
    mut report: impl FnMut(&OperationCheck) -> Result<(), E>,
) -> Result<DeviceCheck, E> {
    let mut found = DeviceCheck::default();
    let mut pass_on = |check: OperationCheck| -> Result<(), E> {
        report(&check)?;
        found.operations.push(check);
        Ok(())
    };
    if chosen.backend == Backend::Cpu {
        for (operation, _) in operations() {
            if let Some(check) = check_operation(operation, device) {
                pass_on(check)?;
            }
        }
    } else {
        let all: Vec<_> = operations().collect();
        supervise(&all, LIMIT, &mut program, &mut pass_on)?;
    }
    Ok(found)
}

/// Lets processes check these operations, so that results survive a driver that crashes its process or hangs; another process continues
/// with the next operation.
fn supervise<E: From<Error>>(
    asked: &[(&'static str, NeededBy)],
    limit: Duration,
    program: &mut impl FnMut(&str) -> Result<Command, E>,
    report: &mut impl FnMut(OperationCheck) -> Result<(), E>,
) -> Result<(), E> {
    let mut rest = asked;
    while let Some(&(first, _)) = rest.first() {
        let mut process = Process::start(program(first)?)?;
        let (mut failed, mut hangs) = (false, false);
        if let Some(printed) = process.child.stdout.take() {
            let mut lines = PatientLines::of(printed, limit);
            rest = answered(&mut lines, rest, |check| {
                failed = check.failure.is_some();
                report(check)
            })?;
            hangs = lines.gave_up();
        }
        let why = if hangs {
            process.kill()?;
            OperationFailure::Silent(limit)
        } else {
            process.ended()?
        };
        if let ([(operation, needed_by), others @ ..], false) = (rest, failed) {
            rest = others;
            report(OperationCheck {
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

/// A process that is killed when this is dropped.
struct Process {
    child: Child,
}

impl Process {
    /// Starts a command, to read its stdout.
    fn start(mut command: Command) -> Result<Self> {
        command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        match command.spawn() {
            Ok(child) => Ok(Self { child }),
            Err(source) => Err(Error::CheckNotStarted { source }),
        }
    }

    /// Waits until it ends by itself.
    fn ended(&mut self) -> Result<OperationFailure> {
        match self.child.wait() {
            Ok(status) => Ok(OperationFailure::ProcessEnded(status)),
            Err(source) => Err(Error::CheckNotEnded { source }),
        }
    }

    /// Kills it.
    fn kill(&mut self) -> Result<()> {
        // It may have just ended by itself.
        let _ = self.child.kill();
        self.ended().map(drop)
    }
}

/// Killing a process that has already ended has no effect.
impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.kill();
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use crate::device_check::answer_line;

    const ASKED: [(&str, NeededBy); 3] = [
        ("a", NeededBy::Network),
        ("b", NeededBy::Flow),
        ("c", NeededBy::Learning),
    ];

    /// A shell command that prints an operation's result.
    fn answer(operation: &'static str, failure: Option<&str>) -> String {
        let check = OperationCheck {
            operation,
            needed_by: NeededBy::Network,
            forward: 0.5,
            backward: None,
            failure: failure.map(|why| OperationFailure::Panicked(why.into())),
        };
        format!("echo '{}'", answer_line(&check).unwrap())
    }

    fn shell(script: &str) -> Command {
        let mut shell = Command::new("sh");
        shell.arg("-c").arg(script);
        shell
    }

    /// The operations that processes started with, and the result of each operation.
    type Seen = (Vec<String>, Vec<(&'static str, Option<OperationFailure>)>);

    /// What happens with processes that run a shell script, given the operation that they start with.
    fn seen(
        asked: &[(&'static str, NeededBy)],
        limit: Duration,
        script: impl Fn(&str) -> String,
    ) -> Seen {
        let (mut started, mut checked) = (Vec::new(), Vec::new());
        let mut program = |first: &str| -> Result<Command> {
            started.push(first.to_owned());
            Ok(shell(&script(first)))
        };
        let mut report = |check: OperationCheck| -> Result<()> {
            checked.push((check.operation, check.failure));
            Ok(())
        };
        supervise(asked, limit, &mut program, &mut report).unwrap();
        (started, checked)
    }

    const PATIENT: Duration = Duration::from_secs(60);

    #[test]
    fn a_new_process_continues_after_an_operation_that_crashed_one() {
        let (started, checked) = seen(&ASKED, PATIENT, |first| match first {
            "a" => format!("{}; exit 3", answer("a", None)),
            _ => answer("c", None),
        });
        assert_eq!(started, ["a", "c"]);
        let [(_, None), (_, Some(ended)), (_, None)] = checked.as_slice() else {
            panic!("{checked:?}")
        };
        assert_eq!(ended.to_string(), "its process ended (exit status: 3)");
    }

    #[test]
    fn a_new_process_continues_after_a_reported_failure() {
        let (started, checked) = seen(&ASKED, PATIENT, |first| match first {
            "a" => answer("a", Some("out of memory")),
            _ => format!("{}; {}", answer("b", None), answer("c", None)),
        });
        assert_eq!(started, ["a", "b"]);
        let why = OperationFailure::Panicked("out of memory".into());
        assert_eq!(checked, [("a", Some(why)), ("b", None), ("c", None)]);
    }

    #[test]
    fn a_process_that_hangs_is_killed() {
        let limit = Duration::from_millis(50);
        let (_, checked) = seen(&ASKED[..1], limit, |_| "exec sleep 600".into());
        assert_eq!(checked, [("a", Some(OperationFailure::Silent(limit)))]);
    }

    #[test]
    fn a_cancelled_check_ends_its_process() {
        let folder = tempfile::tempdir().unwrap();
        let number = folder.path().join("process");
        let mut program = |_: &str| -> Result<Command> {
            let (number, answer) = (number.display(), answer("a", None));
            Ok(shell(&format!(
                "echo $$ > '{number}'; {answer}; exec sleep 600"
            )))
        };
        let mut report = |_: OperationCheck| -> Result<()> { Err(Error::NoCamera) };
        let stopped = supervise(&ASKED, PATIENT, &mut program, &mut report);
        assert!(matches!(stopped, Err(Error::NoCamera)), "{stopped:?}");
        let number = std::fs::read_to_string(&number).unwrap();
        let lives = |number: &str| {
            let mut signal = shell(&format!("kill -0 {}", number.trim()));
            signal.stderr(Stdio::null()).status().unwrap().success()
        };
        assert!(lives(&std::process::id().to_string()));
        assert!(!lives(&number), "{number}");
    }

    #[test]
    fn a_missing_program_is_an_error() {
        let mut program = |_: &str| -> Result<Command> { Ok(Command::new("/no/such/program")) };
        let mut report = |_: OperationCheck| -> Result<()> { Ok(()) };
        let failed = supervise(&ASKED, PATIENT, &mut program, &mut report);
        assert!(
            matches!(failed, Err(Error::CheckNotStarted { .. })),
            "{failed:?}"
        );
    }
}
