//! What to do about the system's own reasons.

use std::io::ErrorKind;

/// What to do about a reason of the system's, whichever file or stream it is about: for errors that hold a [`std::io::Error`] and
/// know nothing better of their own. Where another crate's error may hold one, its own variant says so (`image::ImageError::IoError`).
///
/// ```
/// use deepfusion_hint::system_hint;
/// use std::io::ErrorKind;
///
/// assert!(system_hint(ErrorKind::StorageFull).contains("disk is full"));
/// ```
#[must_use]
pub fn system_hint(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::NotFound => "check the spelling, and that the disk is mounted",
        ErrorKind::PermissionDenied => "check the permissions of the file and its folder",
        ErrorKind::ReadOnlyFilesystem => "choose a place that can be written to",
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "the disk is full: free some space and run again"
        }
        _ => "the system gave this reason: look at the disk or the network that the file is on",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_of_the_system_has_a_hint_of_its_kind() {
        for (kind, said) in [
            (ErrorKind::NotFound, "spelling"),
            (ErrorKind::PermissionDenied, "permissions"),
            (ErrorKind::ReadOnlyFilesystem, "written to"),
            (ErrorKind::StorageFull, "disk is full"),
            (ErrorKind::QuotaExceeded, "disk is full"),
            (ErrorKind::TimedOut, "the system gave this reason"),
            (ErrorKind::Other, "the system gave this reason"),
        ] {
            assert!(system_hint(kind).contains(said), "{kind}");
        }
    }
}
