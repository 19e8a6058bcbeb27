//! Names of live frames, and making room for them.

use std::path::Path;

use crate::{Error, Result};

/// What the names of frames begin with.
const PREFIX: &str = "live-";
/// Smallest number of digits in a frame's number.
const DIGITS: usize = 10;

/// The name of the frame with this number in the stream.
pub(super) fn frame_name(number: u64) -> String {
    format!("{PREFIX}{number:0DIGITS$}")
}

/// Name of the video of all frames.
pub const VIDEO: &str = "live_video.mp4";

/// Whether a file is an output of a live frame, or the video of all.
fn is_of_a_frame(file: &str) -> bool {
    if file == VIDEO {
        return true;
    }
    let Some(rest) = file.strip_prefix(PREFIX) else {
        return false;
    };
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    digits >= DIGITS && rest[digits..].starts_with(['.', '_'])
}

/// Creates the folder. Frames of an earlier run would be mixed with those of this one: they are an error, or removed with `overwrite`.
///
/// # Errors
/// [`Error::LiveFrameExists`]; a folder that cannot be created or read.
pub fn make_room(folder: &Path, overwrite: bool) -> Result<()> {
    let failed = |e| deepfusion_data::Error::file(folder, e);
    std::fs::create_dir_all(folder).map_err(failed)?;
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if !path
            .file_name()
            .and_then(|n| n.to_str())
            .is_some_and(is_of_a_frame)
        {
            continue;
        }
        if !overwrite {
            return Err(Error::LiveFrameExists { path });
        }
        std::fs::remove_file(&path).map_err(|e| deepfusion_data::Error::file(&path, e))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_outputs_of_frames_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let frames = [
            frame_name(3) + "_targets.json",
            frame_name(4) + ".ply",
            frame_name(123_456_789_012) + ".json",
        ];
        let others = [
            "live-notes.txt",
            "live-0000000003",
            "live-12.json",
            "0000000003.json",
        ];
        for file in frames.iter().map(String::as_str).chain(others) {
            std::fs::write(at(file), "x").unwrap();
        }
        assert!(make_room(folder.path(), false).is_err());
        assert!(
            frames.iter().all(|f| at(f).exists()),
            "no other file is removed"
        );
        make_room(folder.path(), true).unwrap();
        assert!(frames.iter().all(|f| !at(f).exists()));
        assert!(others.iter().all(|f| at(f).exists()));
        make_room(folder.path(), false).unwrap();
    }
}
