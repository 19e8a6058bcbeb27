//! Chooses the folder for a video's decoded frames if the settings do not name one.

use crate::{Error, Result};
use deepfusion_video::{frames_folder, holds_frames_of};
use std::io;
use std::path::{Path, PathBuf};

/// The video's own folder, or one in the user's cache folder if the former is not writable (a memory card, a network share). This is
/// checked before hours of work, without writing anything, since inspecting a recording may never need its frames.
///
/// # Errors
/// [`Error::NoPlaceForFrames`] if neither is writable.
pub(crate) fn folder_for_frames(video: &Path, user_cache: Option<PathBuf>) -> Result<PathBuf> {
    let beside = video.parent().unwrap_or(Path::new("."));
    let name = video.file_name().unwrap_or_default().to_string_lossy();
    let keeps = |folder: &Path| can_keep(&frames_folder(folder, video, &name), video);
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

/// Whether the frames of the current version of a video exist, or a folder for them can be created.
fn can_keep(frames: &Path, video: &Path) -> io::Result<()> {
    if holds_frames_of(frames, video) {
        return Ok(());
    }
    // Resolve a link: users may link the folder to a disk with more space.
    let real = frames.canonicalize();
    can_be_made(real.as_deref().unwrap_or(frames))
}

/// Whether a folder can be created, with its missing parents, according to the system's permissions, without trying it.
#[cfg(unix)]
fn can_be_made(folder: &Path) -> io::Result<()> {
    use nix::unistd::{AccessFlags, access};
    use std::io::ErrorKind;

    for around in folder.ancestors().skip(1) {
        // The parent of a plain file name.
        let around = if around.as_os_str().is_empty() {
            Path::new(".")
        } else {
            around
        };
        match std::fs::metadata(around) {
            Ok(there) if there.is_dir() => {
                let both = AccessFlags::W_OK | AccessFlags::X_OK;
                return access(around, both).map_err(io::Error::from);
            }
            Ok(_) => return Err(ErrorKind::NotADirectory.into()),
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
    }
    Err(ErrorKind::NotFound.into())
}

/// Whether a folder can be created, with its missing parents, by trying it.
#[cfg(not(unix))]
fn can_be_made(folder: &Path) -> io::Result<()> {
    deepfusion_fs::PartialFolder::beside(folder).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;
    use std::fs;

    #[test]
    fn frames_are_kept_in_the_users_cache_if_the_videos_folder_is_not_writable() {
        let root = tempfile::tempdir().unwrap();
        let cache = root.path().join("cache");
        let video = root.path().join("drive.mp4");
        let found = folder_for_frames(&video, Some(cache.clone())).unwrap();
        assert_eq!(found, root.path());
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);

        // Nobody, not even root, can create a folder inside a file.
        let card = root.path().join("card");
        fs::write(&card, "").unwrap();
        let video = card.join("drive.mp4");
        let found = folder_for_frames(&video, Some(cache.clone())).unwrap();
        assert_eq!(found, cache.join("deepfusion/frames"));
        assert!(!cache.exists(), "nothing is created");

        let error = folder_for_frames(&video, Some(card)).unwrap_err();
        assert!(matches!(error, Error::NoPlaceForFrames { .. }), "{error}");
        let hint = error.hint().unwrap();
        assert!(hint.contains("cache = "), "{hint}");
    }

    /// The folder must not change, or programs that watch it, to copy or index it, would start needlessly.
    #[cfg(unix)]
    #[test]
    fn choosing_a_folder_writes_nothing() {
        let root = tempfile::tempdir().unwrap();
        let folder = fs::File::open(root.path()).unwrap();
        let long_ago = std::time::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000_000);
        folder.set_modified(long_ago).unwrap();
        folder_for_frames(&root.path().join("drive.mp4"), None).unwrap();
        let now = fs::metadata(root.path()).unwrap().modified().unwrap();
        assert_eq!(now, long_ago);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_a_folder_for_frames_is_followed() {
        use std::os::unix::fs::{PermissionsExt, symlink};

        let root = tempfile::tempdir().unwrap();
        let disk = root.path().join("disk");
        let frames = root.path().join("drive.mp4.frames");
        fs::create_dir_all(disk.join("frames")).unwrap();
        symlink(disk.join("frames"), &frames).unwrap();
        let keeps = || can_keep(&frames, &root.path().join("drive.mp4")).is_ok();
        assert!(keeps());
        let allow = |mode| fs::set_permissions(&disk, fs::Permissions::from_mode(mode)).unwrap();
        allow(0o555);
        // Root can.
        let can = fs::create_dir(disk.join("tried")).is_ok();
        assert_eq!(keeps(), can);
        allow(0o755);
    }
}
