use crate::Error;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

/// [`deepfusion_fs::write_atomically`] with this crate's errors: `path` never holds half a file, and once this returns the
/// file is there to stay.
///
/// # Errors
/// What `write` returns, or [`Error::File`] / [`Error::NoSuchPath`] (the folder does not exist) naming
/// `path`. What was written of it is gone.
pub fn write_atomically<E: From<Error>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    deepfusion_fs::write_atomically(path, |e| E::from(Error::file(path, e)), write)
}

/// [`deepfusion_fs::write_unsynced`] with this crate's errors: whole or not there as long as the power lasts.
///
/// # Errors
/// As [`write_atomically`].
pub fn write_unsynced<E: From<Error>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<(), E> {
    deepfusion_fs::write_unsynced(path, |e| E::from(Error::file(path, e)), write)
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;
    use std::io::Write as _;

    #[test]
    fn a_missing_folder_is_named() {
        let path = Path::new("no/such/folder/a.txt");
        for error in [
            write_atomically::<Error>(path, |_| Ok(())),
            write_unsynced::<Error>(path, |_| Ok(())),
        ] {
            let message = error.unwrap_err().to_string();
            assert!(message.contains("no/such/folder/a.txt"), "{message}");
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error_with_a_hint() {
        // /dev/full takes no byte; a rename onto it is not reached.
        let mut out = BufWriter::new(File::options().write(true).open("/dev/full").unwrap());
        out.write_all(b"x").unwrap();
        let error = Error::file(Path::new("depth.npz"), out.flush().unwrap_err());
        assert!(error.hint().unwrap().contains("full"), "{error}");
    }
}
