//! What this machine has for the program: `deepfusion doctor` without a recording.

use std::fmt::Write as _;
use std::process::{Command, Stdio};

use serde::Serialize;

use crate::devices::Backend;
use crate::failure::Result;
use crate::output;

/// What was found.
#[derive(Debug, Serialize)]
struct Machine {
    version: &'static str,
    cores: usize,
    /// Instruction sets that the kernels make use of.
    simd: Vec<&'static str>,
    /// Names for `--device` that this build has.
    devices: Vec<&'static str>,
    memory_total_mb: Option<u64>,
    memory_free_mb: Option<u64>,
    ffmpeg: Tool,
    ffprobe: Tool,
    onnx_runtime: Tool,
    /// In the current folder, where `runs/` is written.
    disk_free_mb: Option<u64>,
}

/// A program or library from outside.
#[derive(Debug, Serialize)]
struct Tool {
    found: bool,
    /// Its version, and a library's file; or why it cannot be used.
    what: String,
}

/// Prints it.
pub(super) fn run(json: bool) -> Result<()> {
    let machine = Machine::inspect();
    if json {
        output::print_json(&machine)
    } else {
        output::print(&machine.text())
    }
}

impl Machine {
    fn inspect() -> Self {
        let (memory_total_mb, memory_free_mb) = memory_mb();
        Self {
            version: env!("CARGO_PKG_VERSION"),
            cores: std::thread::available_parallelism().map_or(1, Into::into),
            simd: simd(),
            devices: devices(),
            memory_total_mb,
            memory_free_mb,
            ffmpeg: program("ffmpeg"),
            ffprobe: program("ffprobe"),
            onnx_runtime: onnx_runtime(),
            disk_free_mb: disk_free_mb(),
        }
    }

    fn text(&self) -> String {
        let mut text = format!("deepfusion {}\n", self.version);
        let mut line = |name: &str, what: String| {
            let _ = writeln!(text, "{name:14}{what}");
        };
        let gigabytes = |mb: Option<u64>| match mb {
            Some(mb) => format!("{:.1} GB", mb as f64 / 1024.0),
            None => "unknown".into(),
        };
        let simd = if self.simd.is_empty() {
            "no vector instructions that are made use of".into()
        } else {
            self.simd.join(", ")
        };
        line("processor", format!("{} threads; {simd}", self.cores));
        let (free, total) = (
            gigabytes(self.memory_free_mb),
            gigabytes(self.memory_total_mb),
        );
        line("memory", format!("{free} free of {total}"));
        line("devices", self.devices.join(", "));
        if self.devices.len() == 1 {
            line(
                "",
                "for a GPU, build with --features vulkan, wgpu, cuda or metal".into(),
            );
        }
        for (name, tool, remedy) in [
            (
                "ffmpeg",
                &self.ffmpeg,
                "videos need it; folders of images do not",
            ),
            ("ffprobe", &self.ffprobe, "comes with ffmpeg"),
            (
                "ONNX Runtime",
                &self.onnx_runtime,
                "`--engine ort` alone needs it",
            ),
        ] {
            if tool.found {
                line(name, tool.what.clone())
            } else {
                line(name, format!("not usable: {} ({remedy})", tool.what))
            }
        }
        line(
            "disk",
            format!("{} free here", gigabytes(self.disk_free_mb)),
        );
        text
    }
}

fn simd() -> Vec<&'static str> {
    #[cfg(target_arch = "x86_64")]
    {
        let has = [
            ("avx2", std::is_x86_feature_detected!("avx2")),
            ("fma", std::is_x86_feature_detected!("fma")),
            ("avx512f", std::is_x86_feature_detected!("avx512f")),
            ("avx512bf16", std::is_x86_feature_detected!("avx512bf16")),
            ("amx-bf16", cpu_flags().contains(" amx_bf16")),
        ];
        has.into_iter()
            .filter(|(_, has)| *has)
            .map(|(name, _)| name)
            .collect()
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        if cfg!(target_feature = "neon") {
            vec!["neon"]
        } else {
            Vec::new()
        }
    }
}

/// The processor's flags as Linux lists them; empty elsewhere.
#[cfg(target_arch = "x86_64")]
fn cpu_flags() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let flags = text.lines().find(|line| line.starts_with("flags"));
    flags.unwrap_or_default().to_owned()
}

/// What `--device` takes in this build.
fn devices() -> Vec<&'static str> {
    let built = Backend::ALL.into_iter().filter(|one| one.is_built());
    built.map(Backend::name).collect()
}

/// Whole and available memory, MB, as Linux reports it.
fn memory_mb() -> (Option<u64>, Option<u64>) {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let of = |key: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(key))?;
        let kilobytes: u64 = line.split_whitespace().next()?.parse().ok()?;
        Some(kilobytes / 1024)
    };
    (of("MemTotal:"), of("MemAvailable:"))
}

/// A program's first line for `-version`.
fn program(name: &str) -> Tool {
    let output = Command::new(name)
        .arg("-version")
        .stdin(Stdio::null())
        .output();
    match output {
        Ok(output) if output.status.success() => Tool {
            found: true,
            what: String::from_utf8_lossy(&output.stdout)
                .lines()
                .next()
                .unwrap_or_default()
                .to_owned(),
        },
        Ok(output) => Tool {
            found: false,
            what: format!("`{name} -version` fails ({})", output.status),
        },
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Tool {
            found: false,
            what: "not on the PATH".into(),
        },
        Err(error) => Tool {
            found: false,
            what: error.to_string(),
        },
    }
}

/// The library as `--engine ort` finds it.
fn onnx_runtime() -> Tool {
    match deepfusion_onnx::runtime::find(None) {
        Ok(library) => Tool {
            found: true,
            what: format!("{} at {}", library.version, library.path.display()),
        },
        Err(error) => Tool {
            found: false,
            what: error.to_string(),
        },
    }
}

/// Free space of the current folder's disk, MB, as `df` reports it.
fn disk_free_mb() -> Option<u64> {
    let output = Command::new("df").args(["-Pk", "."]).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let kilobytes: u64 = text
        .lines()
        .nth(1)?
        .split_whitespace()
        .nth(3)?
        .parse()
        .ok()?;
    Some(kilobytes / 1024)
}
