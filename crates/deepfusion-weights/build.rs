//! Lists the networks in `weights/` for the program to embed.

#[path = "src/scan.rs"]
mod scan;

use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    let folder = |name: &str| PathBuf::from(std::env::var_os(name).unwrap_or_default());
    let weights = folder("CARGO_MANIFEST_DIR").join("weights");
    // A folder is watched with everything in it, at any depth.
    println!("cargo::rerun-if-changed={}", weights.display());
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=src/scan.rs");
    let out = folder("OUT_DIR").join("embedded.rs");
    let written = scan::scan(&weights).and_then(|pairs| {
        let list = scan::list(&pairs)?;
        std::fs::write(&out, list).map_err(|source| scan::ScanError::Io { path: out, source })
    });
    match written {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            println!("cargo::error={reason}");
            ExitCode::FAILURE
        }
    }
}
