//! `deepfusion config`: what can be configured.

use crate::cli::ShowArgs;
use crate::failure::Result;
use crate::output;

/// `deepfusion config show`.
pub(super) fn show(args: &ShowArgs) -> Result<()> {
    let mut config = args.preset.config_on(args.device.compute());
    for assignment in &args.set {
        config.set(assignment)?;
    }
    config.validate()?;
    output::print(&config.to_commented_toml()?)
}
