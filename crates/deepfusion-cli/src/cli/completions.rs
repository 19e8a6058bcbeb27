use std::path::PathBuf;

use clap::{Args, ValueEnum};

/// `deepfusion completions`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    deepfusion completions bash > ~/.local/share/bash-completion/completions/deepfusion\n  \
    deepfusion completions zsh > ~/.zfunc/_deepfusion\n  \
    deepfusion completions man --out ~/.local/share/man/man1")]
pub(crate) struct CompletionsArgs {
    /// Shell, or `man` for man pages.
    #[arg(value_enum, value_name = "SHELL")]
    pub kind: CompletionsKind,
    /// Folder for the man pages, one per command.
    #[arg(long, value_name = "DIR", required_if_eq("kind", "man"))]
    pub out: Option<PathBuf>,
}

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum CompletionsKind {
    /// Bash.
    Bash,
    /// Elvish.
    Elvish,
    /// Fish.
    Fish,
    /// PowerShell.
    Powershell,
    /// Zsh.
    Zsh,
    /// Man pages.
    Man,
}
