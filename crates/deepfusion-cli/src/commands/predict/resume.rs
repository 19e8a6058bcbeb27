//! What of a job is there already, and whether it may stay.

use std::collections::HashSet;

use deepfusion_fs::Partial;
use serde::de::IgnoredAny;

use super::Job;
use super::inputs::Input;
use super::outputs::file_name;
use super::sidecar::{FileMark, Sidecar};
use crate::error::CliError;
use crate::failure::Result;

/// The sidecar of an image that is done; `None` where there is work to do.
///
/// Files that this job did not make, or made of an image that has changed since, are an error, or with `--overwrite` work
/// to do. `begun` says that a run of this job had the image in its manifest: files without a sidecar are then what it left
/// when it was killed. Done means that every output's length and checksum are those in the sidecar.
pub fn finished(job: &Job, input: &Input, begun: bool) -> Result<Option<Sidecar>> {
    let args = job.args;
    let path = Sidecar::path(&args.out, &input.name);
    let text = match std::fs::read(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            if !(begun || args.overwrite) {
                refuse_files(job, input)?;
            }
            return Ok(None);
        }
        Err(e) => return Err(deepfusion_data::Error::file(&path, e).into()),
    };
    if text.iter().all(|byte| *byte == 0) {
        // What a power cut leaves of a file: nothing of anybody's is lost with it.
        return Ok(None);
    }
    let why = match serde_json::from_slice::<Sidecar>(&text) {
        // Cut off or overwritten by other bytes, and ours.
        Err(_) if begun && serde_json::from_slice::<IgnoredAny>(&text).is_err() => return Ok(None),
        Err(_) => "and does not say how it was made".to_owned(),
        Ok(sidecar) if sidecar.image != input.path => {
            format!("made from {}", sidecar.image.display())
        }
        Ok(sidecar) => match job.made_with.difference(&sidecar.made_with) {
            Some(what) => format!("made with {what}"),
            None if FileMark::of(&input.path).is_ok_and(|mark| mark != sidecar.image_file) => {
                format!("and {} has changed since", input.path.display())
            }
            None if sidecar.is_complete(&args.out) => return Ok(Some(sidecar)),
            // Ours, but a file of it is gone or is not what was written.
            None => return Ok(None),
        },
    };
    if args.overwrite {
        return Ok(None);
    }
    Err(CliError::Stale { path, why }.into())
}

/// Without a sidecar, nothing of the image's names may be there.
fn refuse_files(job: &Job, input: &Input) -> Result<(), CliError> {
    for save in &job.outputs.save {
        let path = job.args.out.join(file_name(&input.name, *save));
        if path.exists() {
            return Err(CliError::Exists {
                path,
                remedy: "allow it with --overwrite, or choose another folder",
            });
        }
    }
    Ok(())
}

/// Removes the half-written files that a killed run of this shard left.
pub fn remove_partial_files(job: &Job, mine: &[&Input]) -> Result<()> {
    let out = &job.args.out;
    let files_of = |input: &&Input| {
        let sidecar = format!("{}.json", input.name);
        let outputs = job
            .outputs
            .save
            .iter()
            .map(|save| file_name(&input.name, *save));
        outputs.chain([sidecar]).collect::<Vec<_>>()
    };
    let files: HashSet<String> = mine.iter().flat_map(files_of).collect();
    let failed = |e| deepfusion_data::Error::file(out, e);
    for entry in std::fs::read_dir(out).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if Partial::target_of(&path).is_some_and(|file| files.contains(file)) {
            std::fs::remove_file(&path).map_err(|e| deepfusion_data::Error::file(&path, e))?;
        }
    }
    Ok(())
}
