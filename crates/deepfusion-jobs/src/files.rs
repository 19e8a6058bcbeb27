use std::path::Path;

use deepfusion_data::Error as DataError;

/// Writes a file, whole or not at all.
pub(crate) fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), DataError> {
    deepfusion_fs::write(path, bytes).map_err(|e| DataError::file(path, e))
}
