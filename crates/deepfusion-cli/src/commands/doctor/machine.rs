//! What this machine offers to the program: `deepfusion doctor` without a recording.

use std::fmt::Write as _;

use deepfusion_hint::count_of;
use deepfusion_jobs::machine::{InstructionSet, Machine};

use crate::devices::Backend;
use crate::failure::Result;
use crate::output;

/// Prints the machine's properties.
pub(super) fn run(json: bool) -> Result<()> {
    let machine = Machine::inspect();
    if json {
        output::print_json(&machine)
    } else {
        output::print(&text(&machine))
    }
}

fn text(machine: &Machine) -> String {
    let mut text = format!("deepfusion {}\n", machine.version);
    let mut line = |name: &str, what: String| {
        let _ = writeln!(text, "{name:14}{what}");
    };
    let gigabytes = |mb: Option<u64>| match mb {
        Some(mb) => format!("{:.1} GB", mb as f64 / 1024.0),
        None => "unknown".into(),
    };
    let simd: Vec<&str> = machine
        .simd
        .iter()
        .copied()
        .map(InstructionSet::name)
        .collect();
    let simd = if simd.is_empty() {
        "no vector instructions that this program uses".into()
    } else {
        simd.join(", ")
    };
    let threads = count_of(machine.cores, "thread");
    line("processor", format!("{threads}; {simd}"));
    let (free, total) = (
        gigabytes(machine.memory_free_mb),
        gigabytes(machine.memory_total_mb),
    );
    line("memory", format!("{free} free of {total}"));
    // The values of `--device`.
    let devices: Vec<&str> = machine.devices.iter().copied().map(Backend::name).collect();
    line("devices", devices.join(", "));
    if devices.len() == 1 {
        line(
            "",
            "for a GPU, build with --features vulkan, wgpu, cuda or metal".into(),
        );
    }
    for (name, tool, hint) in [
        (
            "ffmpeg",
            &machine.ffmpeg,
            "needed for videos, but not for folders of images",
        ),
        ("ffprobe", &machine.ffprobe, "comes with ffmpeg"),
        (
            "ONNX Runtime",
            &machine.onnx_runtime,
            "needed only for `--engine ort`",
        ),
    ] {
        if tool.is_found() {
            line(name, tool.to_string());
        } else {
            line(name, format!("not usable: {tool} ({hint})"));
        }
    }
    line(
        "disk",
        format!("{} free here", gigabytes(machine.disk_free_mb)),
    );
    text
}
