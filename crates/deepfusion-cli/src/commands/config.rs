//! `deepfusion config`: every key of the configuration.

use crate::cli::{ConfigSource, ShowArgs};
use crate::failure::Result;
use crate::output;

/// `deepfusion config show`.
pub(super) fn show(args: &ShowArgs) -> Result<()> {
    let mut config = match &args.of {
        ConfigSource::Preset(preset) => preset.config_on(args.device.compute()),
        ConfigSource::Run(run) => run.read_settings()?,
    };
    for assignment in &args.set {
        config.set(assignment)?;
    }
    config.validate()?;
    output::print(&config.to_commented_toml()?)
}
