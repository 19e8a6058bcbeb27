//! Where the frames of a video are kept, once decoded, that no settings name a folder for.

use crate::{Error, Result};
use deepfusion_fs::PartialFolder;
use deepfusion_video::frames_folder;
use std::io;
use std::path::{Path, PathBuf};

/// The video's own folder, or, where nothing can be written there (a card, a share), one in the user's cache folder. That is found out before
/// hours of work.
///
/// # Errors
/// [`Error::NoPlaceForFrames`] where neither can be written.
pub(crate) fn folder_for_frames(video: &Path, user_cache: Option<PathBuf>) -> Result<PathBuf> {
    let beside = video.parent().unwrap_or(Path::new("."));
    let name = video.file_name().unwrap_or_default().to_string_lossy();
    let keeps = |folder: &Path| can_keep(&frames_folder(folder, video, &name));
    let Err(source) = keeps(beside) else {
        return Ok(beside.to_owned());
    };
    let elsewhere = user_cache.map(|cache| cache.join("deepfusion/frames"));
    let elsewhere = elsewhere.filter(|folder| keeps(folder).is_ok());
    elsewhere.ok_or_else(|| Error::NoPlaceForFrames {
        video: video.to_owned(),
        source,
    })
}

/// Whether frames are there, or a folder for them can be made.
fn can_keep(frames: &Path) -> io::Result<()> {
    if frames.is_dir() {
        return Ok(());
    }
    PartialFolder::beside(frames).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;
    use std::fs;

    #[test]
    fn frames_go_to_the_users_cache_where_the_videos_folder_cannot_be_written() {
        let root = tempfile::tempdir().unwrap();
        let cache = root.path().join("cache");
        let there = root.path().join("drive.mp4");
        let found = folder_for_frames(&there, Some(cache.clone())).unwrap();
        assert_eq!(found, root.path());
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);

        // Nobody, not even the administrator, can write into a file.
        let card = root.path().join("card");
        fs::write(&card, "").unwrap();
        let video = card.join("drive.mp4");
        let found = folder_for_frames(&video, Some(cache.clone())).unwrap();
        assert_eq!(found, cache.join("deepfusion/frames"));
        assert!(!cache.exists(), "it was only tried");

        let error = folder_for_frames(&video, Some(card)).unwrap_err();
        assert!(matches!(error, Error::NoPlaceForFrames { .. }), "{error}");
        let hint = error.hint().unwrap();
        assert!(hint.contains("cache = "), "{hint}");
    }

    #[test]
    fn frames_that_are_there_are_used() {
        let root = tempfile::tempdir().unwrap();
        let frames = root.path().join("drive.mp4.frames");
        fs::create_dir(&frames).unwrap();
        let found = folder_for_frames(&root.path().join("drive.mp4"), None);
        assert_eq!(found.unwrap(), root.path());
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1);
    }
}
