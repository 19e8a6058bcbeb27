use std::path::{Path, PathBuf};

use deepfusion_jobs::importing::ForeignNetwork;

use crate::failure::Result;
use crate::output;
use crate::progress::say;

/// `deepfusion weights import`.
pub(crate) fn run(files: &[PathBuf], out: &Path) -> Result<()> {
    let network = ForeignNetwork::read(files)?;
    let path = network.write(&output::run_folder(Some(out), "weights")?)?;
    say("imported; the scale of imported weights is not metric until they are trained with speeds");
    output::print(&format!("{}\n", path.display()))
}
