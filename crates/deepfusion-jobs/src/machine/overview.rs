//! An overview of what this machine has.

use serde::Serialize;

use super::{InstructionSet, Memory, Tool, free_disk_mb, instruction_sets};
use crate::devices::Backend;

/// An overview of what this machine has.
#[derive(Debug, Serialize)]
pub struct Machine {
    /// The program's version.
    pub version: &'static str,
    /// Number of threads that the processor runs at the same time.
    pub cores: usize,
    /// Instruction sets that the kernels use.
    pub simd: Vec<InstructionSet>,
    /// The backends of this build.
    pub devices: Vec<Backend>,
    /// Total memory in MB, if known.
    pub memory_total_mb: Option<u64>,
    /// Memory still available to programs, in MB, if known.
    pub memory_free_mb: Option<u64>,
    /// The program that decodes videos.
    pub ffmpeg: Tool,
    /// The program that reads properties of videos.
    pub ffprobe: Tool,
    /// The library that runs ONNX files.
    pub onnx_runtime: Tool,
    /// Free space on the current folder's disk, in MB.
    pub disk_free_mb: Option<u64>,
}

impl Machine {
    /// Inspects this machine.
    #[must_use]
    pub fn inspect() -> Self {
        let memory = Memory::now();
        Self {
            version: env!("CARGO_PKG_VERSION"),
            cores: std::thread::available_parallelism().map_or(1, Into::into),
            simd: instruction_sets(),
            devices: Backend::built().collect(),
            memory_total_mb: memory.total_mb,
            memory_free_mb: memory.free_mb,
            ffmpeg: Tool::program("ffmpeg"),
            ffprobe: Tool::program("ffprobe"),
            onnx_runtime: Tool::onnx_runtime(),
            disk_free_mb: free_disk_mb(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_and_instruction_sets_are_listed_by_name() {
        let machine = serde_json::to_value(Machine::inspect()).unwrap();
        assert_eq!(machine["devices"][0], "cpu");
        let simd = machine["simd"].as_array().unwrap();
        assert!(simd.iter().all(serde_json::Value::is_string), "{machine}");
    }
}
