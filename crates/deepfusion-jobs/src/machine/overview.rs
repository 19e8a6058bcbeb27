//! All that this machine has for the program.

use serde::Serialize;

use super::{InstructionSet, Memory, Tool, free_disk_mb, instruction_sets};
use crate::devices::Backend;

/// All that this machine has for the program.
#[derive(Debug, Serialize)]
pub struct Machine {
    /// The program's version.
    pub version: &'static str,
    /// How many threads the processor runs at once.
    pub cores: usize,
    /// Instruction sets that the kernels make use of.
    pub simd: Vec<InstructionSet>,
    /// What can compute in this build.
    pub devices: Vec<Backend>,
    /// All of its memory, MB, where that is known.
    pub memory_total_mb: Option<u64>,
    /// What of it programs can still have, MB.
    pub memory_free_mb: Option<u64>,
    /// What decodes videos.
    pub ffmpeg: Tool,
    /// What looks into videos.
    pub ffprobe: Tool,
    /// What runs networks as ONNX files.
    pub onnx_runtime: Tool,
    /// Free space of the current folder's disk, MB.
    pub disk_free_mb: Option<u64>,
}

impl Machine {
    /// Looks at this machine as it is now.
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
    fn what_computes_is_listed_by_name() {
        let machine = serde_json::to_value(Machine::inspect()).unwrap();
        assert_eq!(machine["devices"][0], "cpu");
        let simd = machine["simd"].as_array().unwrap();
        assert!(simd.iter().all(serde_json::Value::is_string), "{machine}");
    }
}
