//! Shows a network's layers, with the training framework if the build has it.

use crate::failure::Result;
use deepfusion_jobs::bulk::ShowLayers;
use deepfusion_model::StoredNetwork;

use crate::devices::ComputeDevice;

#[cfg(feature = "train")]
pub(super) fn open(network: &StoredNetwork, device: ComputeDevice) -> Result<ShowLayers> {
    use deepfusion_model::InputSize;
    use deepfusion_train::Inspector;

    let inspector = Inspector::new(network, &crate::devices::open(device)?)?;
    Ok(Box::new(move |image: &[f32], size: InputSize| {
        inspector.inspect(image, size)
    }))
}

#[cfg(not(feature = "train"))]
pub(super) fn open(_: &StoredNetwork, _: ComputeDevice) -> Result<ShowLayers> {
    Err(crate::error::CliError::BuiltWithoutTraining {
        what: "--save features",
    }
    .into())
}
