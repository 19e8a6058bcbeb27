//! What this machine has for the program: `deepfusion doctor` without a recording.

use std::fmt::{Display, Write as _};

use deepfusion_jobs::machine::{
    InstructionSet, Memory, free_disk_mb, instruction_sets, version_of,
};
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

impl Tool {
    fn of<E: Display>(found: Result<String, E>) -> Self {
        match found {
            Ok(what) => Self { found: true, what },
            Err(why) => Self {
                found: false,
                what: why.to_string(),
            },
        }
    }
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
        let memory = Memory::now();
        let simd = instruction_sets().into_iter().map(InstructionSet::name);
        Self {
            version: env!("CARGO_PKG_VERSION"),
            cores: std::thread::available_parallelism().map_or(1, Into::into),
            simd: simd.collect(),
            devices: devices(),
            memory_total_mb: memory.total_mb,
            memory_free_mb: memory.free_mb,
            ffmpeg: Tool::of(version_of("ffmpeg")),
            ffprobe: Tool::of(version_of("ffprobe")),
            onnx_runtime: onnx_runtime(),
            disk_free_mb: free_disk_mb(),
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

/// What `--device` takes in this build.
fn devices() -> Vec<&'static str> {
    let built = Backend::ALL.into_iter().filter(|one| one.is_built());
    built.map(Backend::name).collect()
}

/// The library as `--engine ort` finds it.
fn onnx_runtime() -> Tool {
    let found = deepfusion_onnx::runtime::find(None);
    Tool::of(found.map(|library| format!("{} at {}", library.version, library.path.display())))
}
