//! What to do about the system's own reasons.

use std::io::ErrorKind;

/// What to do about a reason of the system's, whichever file or stream it is about; none where the reason alone does not say it. For errors that
/// hold a [`std::io::Error`] and know nothing better of their own. Where another crate's error may hold one, its own variant says so
/// (`image::ImageError::IoError`).
///
/// ```
/// use deepfusion_hint::system_hint;
/// use std::io::ErrorKind;
///
/// assert!(system_hint(ErrorKind::StorageFull).is_some_and(|hint| hint.contains("disk is full")));
/// assert_eq!(system_hint(ErrorKind::TimedOut), None);
/// ```
#[must_use]
pub fn system_hint(kind: ErrorKind) -> Option<&'static str> {
    Some(match kind {
        ErrorKind::NotFound => "check the spelling, and that the disk is mounted",
        ErrorKind::PermissionDenied => {
            "check the permissions of the file and its folder, or choose another place"
        }
        ErrorKind::ReadOnlyFilesystem => "choose a place that can be written to",
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "the disk is full: free some space and run again"
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_that_says_what_to_do_has_a_hint() {
        for (kind, said) in [
            (ErrorKind::NotFound, "spelling"),
            (ErrorKind::PermissionDenied, "permissions"),
            (ErrorKind::ReadOnlyFilesystem, "written to"),
            (ErrorKind::StorageFull, "disk is full"),
            (ErrorKind::QuotaExceeded, "disk is full"),
        ] {
            let hint = system_hint(kind);
            assert!(hint.is_some_and(|hint| hint.contains(said)), "{kind}");
        }
        assert_eq!(system_hint(ErrorKind::Other), None);
    }
}
