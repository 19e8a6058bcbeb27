use std::path::Path;

use deepfusion_perception::PerceptionConfig;

use crate::{Error, Result};

/// Settings of the perception from a TOML file over `base`, with rows of parked cars unless the file switches them off. Settings that are
/// not in the file keep their defaults.
///
/// # Errors
/// [`Error::PerceptionFile`], [`Error::PerceptionSettings`]; a file that cannot be read.
pub fn perception_settings(
    path: Option<&Path>,
    base: PerceptionConfig,
) -> Result<PerceptionConfig> {
    let base = base.with_parking_rows();
    let Some(path) = path else { return Ok(base) };
    let text = std::fs::read_to_string(path).map_err(|e| deepfusion_data::Error::file(path, e))?;
    let wrong = |error: toml::de::Error| Error::PerceptionFile {
        path: path.to_owned(),
        problem: error.into(),
    };
    let mut table = toml::Table::try_from(&base)?;
    table.extend(text.parse::<toml::Table>().map_err(wrong)?);
    let config: PerceptionConfig = table.try_into().map_err(wrong)?;
    config
        .validate()
        .map_err(|source| Error::PerceptionSettings {
            path: path.to_owned(),
            source,
        })?;
    Ok(config)
}
