//! What to do about errors of the operating system.

use std::io::ErrorKind;

/// What to do about an error of the operating system, whichever file or stream it concerns. For errors that contain a [`std::io::Error`]
/// and have no better hint of their own. If another crate's error may contain one, match its variant for it (`image::ImageError::IoError`).
///
/// ```
/// use deepfusion_hint::system_hint;
/// use std::io::ErrorKind;
///
/// assert!(system_hint(ErrorKind::StorageFull).contains("disk is full"));
/// assert!(system_hint(ErrorKind::TimedOut).contains("network"));
/// ```
#[must_use]
pub fn system_hint(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::AlreadyExists => "choose another path, or remove it first",
        ErrorKind::NotFound => "check the spelling, and that the disk is mounted",
        ErrorKind::PermissionDenied => {
            "check the permissions of the file and its folder, or choose another place"
        }
        ErrorKind::ReadOnlyFilesystem => "choose a place that can be written to",
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "the disk is full: free some space and run again"
        }
        _ => "check the disk or the network that the file is on",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_kinds_of_errors_have_their_own_hints() {
        for (kind, expected) in [
            (ErrorKind::AlreadyExists, "remove it first"),
            (ErrorKind::NotFound, "spelling"),
            (ErrorKind::PermissionDenied, "permissions"),
            (ErrorKind::ReadOnlyFilesystem, "written to"),
            (ErrorKind::StorageFull, "disk is full"),
            (ErrorKind::QuotaExceeded, "disk is full"),
            (ErrorKind::TimedOut, "check the disk"),
        ] {
            let hint = system_hint(kind);
            assert!(hint.contains(expected), "{kind}");
        }
    }
}
