//! The examples work on simulated drives. `cargo test` builds them; with `--test examples` it does not, and these tests print that
//! and pass.

use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

use deepfusion::data::{Dataset, OpenOptions, save_png};
use deepfusion::sim::{BagSettings, SimConfig, Simulation, write_bag, write_kitti};

type Result<T = ()> = std::result::Result<T, Box<dyn Error>>;

/// Output of an example; `None` if it is not built.
fn run(example: &str, arguments: &[&Path]) -> Result<Option<String>> {
    // target/debug/deps/examples-0123 is beside target/debug/examples.
    let mut folder = std::env::current_exe()?;
    folder.pop();
    folder.pop();
    let program = folder.join("examples").join(example);
    let program = program.with_extension(std::env::consts::EXE_EXTENSION);
    if !program.exists() {
        eprintln!("{example} is not built: `cargo test --workspace` builds it");
        return Ok(None);
    }
    let output = Command::new(program).args(arguments).output()?;
    let text = String::from_utf8(output.stdout)?;
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{example}: {text}{errors}");
    Ok(Some(text))
}

fn street(frames: usize) -> Result<Simulation> {
    Ok(Simulation::new(&SimConfig {
        frames,
        width: 320,
        height: 96,
        scan_every: 0,
        ..SimConfig::default()
    })?)
}

fn drive(at: &Path, frames: usize) -> Result<PathBuf> {
    Ok(write_kitti(&street(frames)?, at, &mut |_, _| {
        ControlFlow::Continue(())
    })?)
}

#[test]
fn an_image_becomes_metres() -> Result {
    let folder = tempfile::tempdir()?;
    let photo = folder.path().join("street.png");
    save_png(&street(1)?.frame(0).rgb, &photo)?;
    if let Some(text) = run("image_to_metres", &[&photo, Path::new("tiny")])? {
        assert!(text.contains("320x96: nearest"), "{text}");
        assert!(folder.path().join("street.depth.png").exists());
    }
    Ok(())
}

#[test]
fn a_drive_becomes_a_run() -> Result {
    let folder = tempfile::tempdir()?;
    let drive = drive(&folder.path().join("street"), 20)?;
    let out = folder.path().join("run");
    if let Some(text) = run("train_on_a_drive", &[&drive, &out, Path::new("1")])? {
        assert!(text.contains("step 1: loss"), "{text}");
        assert!(out.join("last.safetensors").exists());
    }
    Ok(())
}

#[test]
fn the_streams_of_a_bag_are_listed() -> Result {
    let folder = tempfile::tempdir()?;
    let settings = BagSettings::default();
    let bag = write_bag(&street(3)?, folder.path(), &settings, &mut |_, _| {
        ControlFlow::Continue(())
    })?;
    if let Some(text) = run("bag_streams", &[&bag])? {
        assert!(text.contains("CompressedImage"), "{text}");
        assert!(text.contains("begins at"), "{text}");
    }
    Ok(())
}

#[test]
fn an_own_layout_is_a_dataset() -> Result {
    let folder = tempfile::tempdir()?;
    let drive = drive(&folder.path().join("street"), 4)?;
    let own = folder.path().join("own");
    std::fs::create_dir(&own)?;
    let dataset = &Dataset::open(&drive, &OpenOptions::default())?[0];
    for (i, frame) in dataset.frames().iter().enumerate() {
        std::fs::copy(frame.image.path(), own.join(format!("{}.png", 100 * i)))?;
    }
    if let Some(text) = run("own_layout", &[&own, Path::new("8.5")])? {
        assert!(text.contains("4 frames, 3 pairs"), "{text}");
    }
    Ok(())
}
