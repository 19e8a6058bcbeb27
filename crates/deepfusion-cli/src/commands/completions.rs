//! `deepfusion completions`: completion scripts for shells, and pages for `man`.

use std::path::Path;

use clap::CommandFactory;
use clap::error::ErrorKind;
use clap_complete::{Shell, generate};
use clap_mangen::Man;

use crate::cli::{Cli, CompletionsArgs, CompletionsKind};
use crate::failure::Result;
use crate::output;

/// `deepfusion completions`.
pub(super) fn run(args: &CompletionsArgs) -> Result<()> {
    let shell = match args.kind {
        CompletionsKind::Bash => Shell::Bash,
        CompletionsKind::Elvish => Shell::Elvish,
        CompletionsKind::Fish => Shell::Fish,
        CompletionsKind::Powershell => Shell::PowerShell,
        CompletionsKind::Zsh => Shell::Zsh,
        CompletionsKind::Man => {
            // `--out` is required with `man`.
            return args.out.as_deref().map_or(Ok(()), manual);
        }
    };
    if args.out.is_some() {
        let message = "--out is only for the manual's pages; a shell's script is printed on stdout";
        Cli::command()
            .error(ErrorKind::ArgumentConflict, message)
            .exit();
    }
    let mut script = Vec::new();
    generate(shell, &mut Cli::command(), "deepfusion", &mut script);
    output::print(&String::from_utf8_lossy(&script))
}

/// A page for the program and one for each command, `deepfusion-data-inspect.1`.
fn manual(out: &Path) -> Result<()> {
    std::fs::create_dir_all(out).map_err(|e| deepfusion_data::Error::file(out, e))?;
    let mut program = Cli::command();
    program.build();
    let mut left = vec![(String::from("deepfusion"), program)];
    while let Some((name, command)) = left.pop() {
        for inner in command.get_subcommands().filter(|c| c.get_name() != "help") {
            left.push((format!("{name}-{}", inner.get_name()), inner.clone()));
        }
        let path = out.join(format!("{name}.1"));
        let page = Man::new(command).title(name);
        let mut text = Vec::new();
        page.render(&mut text)?;
        output::write(&path, text)?;
    }
    Ok(())
}
