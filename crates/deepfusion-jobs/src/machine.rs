//! What this machine has: vector instructions, memory, disk, and external programs. A megabyte is 2²⁰ bytes.

mod overview;
mod tool;

use std::io;
use std::process::{Command, ExitStatus, Stdio};

use serde::{Serialize, Serializer};

pub use self::overview::Machine;
pub use self::tool::{NoTool, Tool};

/// An instruction set that the kernels use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum InstructionSet {
    /// x86: vectors of 256 bits.
    Avx2,
    /// x86: fused multiply-add.
    Fma,
    /// x86: vectors of 512 bits.
    Avx512f,
    /// x86: dot products in bf16.
    Avx512Bf16,
    /// x86: matrix products in bf16.
    AmxBf16,
    /// ARM: vectors of 128 bits.
    Neon,
}

impl InstructionSet {
    /// The name that processor makers use, in lower case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Avx2 => "avx2",
            Self::Fma => "fma",
            Self::Avx512f => "avx512f",
            Self::Avx512Bf16 => "avx512bf16",
            Self::AmxBf16 => "amx-bf16",
            Self::Neon => "neon",
        }
    }
}

/// The name, as printed.
impl Serialize for InstructionSet {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// The instruction sets of this processor. AMX is only detected on Linux.
#[must_use]
pub fn instruction_sets() -> Vec<InstructionSet> {
    #[cfg(target_arch = "x86_64")]
    {
        let of_system = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let has = [
            (InstructionSet::Avx2, std::is_x86_feature_detected!("avx2")),
            (InstructionSet::Fma, std::is_x86_feature_detected!("fma")),
            (
                InstructionSet::Avx512f,
                std::is_x86_feature_detected!("avx512f"),
            ),
            (
                InstructionSet::Avx512Bf16,
                std::is_x86_feature_detected!("avx512bf16"),
            ),
            (InstructionSet::AmxBf16, has_flag(&of_system, "amx_bf16")),
        ];
        let has = has.into_iter().filter(|(_, has)| *has);
        has.map(|(set, _)| set).collect()
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        if cfg!(target_feature = "neon") {
            vec![InstructionSet::Neon]
        } else {
            Vec::new()
        }
    }
}

/// Whether Linux lists a flag of the processor in `/proc/cpuinfo`.
#[cfg(target_arch = "x86_64")]
fn has_flag(cpuinfo: &str, flag: &str) -> bool {
    let flags = cpuinfo.lines().find(|line| line.starts_with("flags"));
    let mut flags = flags.unwrap_or_default().split_whitespace();
    flags.any(|known| known == flag)
}

/// The machine's memory in MB, as Linux reports it; `None` elsewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    /// Total memory.
    pub total_mb: Option<u64>,
    /// Memory still available to programs.
    pub free_mb: Option<u64>,
}

impl Memory {
    /// The current figures.
    #[must_use]
    pub fn now() -> Self {
        Self::of(&std::fs::read_to_string("/proc/meminfo").unwrap_or_default())
    }

    fn of(meminfo: &str) -> Self {
        let megabytes = |key| kilobytes(meminfo, key).map(|kilobytes| kilobytes / 1024);
        Self {
            total_mb: megabytes("MemTotal:"),
            free_mb: megabytes("MemAvailable:"),
        }
    }
}

/// The peak memory of this process in MB, if the system reports it (Linux).
#[must_use]
pub fn peak_rss_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    kilobytes(&status, "VmHWM:").map(|kilobytes| kilobytes as f64 / 1024.0)
}

/// The number after a key in a file of `/proc`.
fn kilobytes(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Free space on the current folder's disk in MB, as `df` reports it; `None` without `df`.
#[must_use]
pub fn free_disk_mb() -> Option<u64> {
    let output = Command::new("df").args(["-Pk", "."]).output().ok()?;
    free_by_df(&String::from_utf8(output.stdout).ok()?)
}

/// The fourth column of the second line, in POSIX's output format.
fn free_by_df(printed: &str) -> Option<u64> {
    let line = printed.lines().nth(1)?;
    let kilobytes: u64 = line.split_whitespace().nth(3)?.parse().ok()?;
    Some(kilobytes / 1024)
}

/// Why an external program cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NoProgram {
    /// No program with this name is on the PATH.
    #[error("not on the PATH")]
    NotFound,
    /// It fails even to print its version.
    #[error("`{program} -version` fails ({status})")]
    Fails {
        /// Name of the program.
        program: String,
        /// Its exit status.
        status: ExitStatus,
    },
    /// The system cannot start it.
    #[error(transparent)]
    System(io::Error),
}

/// The first line that one of ffmpeg's programs prints for `-version`.
///
/// # Errors
/// [`NoProgram`].
pub fn version_of(program: &str) -> Result<String, NoProgram> {
    let output = Command::new(program)
        .arg("-version")
        .stdin(Stdio::null())
        .output()
        .map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => NoProgram::NotFound,
            _ => NoProgram::System(error),
        })?;
    if !output.status.success() {
        return Err(NoProgram::Fails {
            program: program.to_owned(),
            status: output.status,
        });
    }
    let printed = String::from_utf8_lossy(&output.stdout);
    Ok(printed.lines().next().unwrap_or_default().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_what_linux_lists() {
        let text = "MemTotal:       16384000 kB\nMemFree:          204800 kB\nMemAvailable:    8192500 kB\n";
        let memory = Memory::of(text);
        assert_eq!(memory.total_mb, Some(16_000));
        assert_eq!(memory.free_mb, Some(8_000));
        let unknown = Memory::of("");
        assert_eq!((unknown.total_mb, unknown.free_mb), (None, None));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn peak_memory_is_positive_and_at_most_the_total() {
        let peak = peak_rss_mb().unwrap();
        let total = Memory::now().total_mb.unwrap();
        assert!(peak > 1.0 && peak < total as f64, "{peak} of {total}");
    }

    #[test]
    fn free_space_is_in_the_fourth_column() {
        let printed = "Filesystem 1024-blocks Used Available Capacity Mounted on\n/dev/sda1 1000000 480000 520192 48% /\n";
        assert_eq!(free_by_df(printed), Some(508));
        assert_eq!(free_by_df("df: no such folder\n"), None);
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn a_flag_is_a_whole_word() {
        let cpuinfo = "processor : 0\nflags\t\t: fpu sse2 amx_bf16 amx_tile\n";
        assert!(has_flag(cpuinfo, "amx_bf16"));
        assert!(!has_flag(cpuinfo, "amx"));
        assert!(!has_flag("", "fpu"));
    }

    #[test]
    fn a_missing_program_is_not_found() {
        let why = version_of("no-such-program-anywhere").unwrap_err();
        assert!(matches!(why, NoProgram::NotFound), "{why}");
        assert_eq!(why.to_string(), "not on the PATH");
    }
}
