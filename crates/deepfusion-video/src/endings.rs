//! Which files are videos, judged by their names.

use std::path::Path;

/// Endings of file names that are taken as videos, in lower case.
pub const VIDEO_ENDINGS: [&str; 7] = ["mp4", "mkv", "mov", "avi", "hevc", "m4v", "webm"];

/// Whether a file is named like a video.
#[must_use]
pub fn is_video(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str());
    ending.is_some_and(|e| VIDEO_ENDINGS.contains(&e.to_ascii_lowercase().as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endings_of_either_case_are_known() {
        for (name, video) in [
            ("a/drive.MP4", true),
            ("drive.webm", true),
            ("drive.mp4.txt", false),
            ("mp4", false),
        ] {
            assert_eq!(is_video(Path::new(name)), video, "{name}");
        }
    }
}
