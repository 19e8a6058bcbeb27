//! What shows a network's layers: the training framework, in a build that has it.

#[cfg(feature = "train")]
mod imp {
    use crate::failure::Result;
    use deepfusion_model::StoredNetwork;

    use crate::devices::{self, ComputeDevice};

    pub(crate) use deepfusion_train::Inspector;

    pub(crate) fn open(network: &StoredNetwork, device: ComputeDevice) -> Result<Inspector> {
        Ok(Inspector::new(network, &devices::open(device)?)?)
    }
}

#[cfg(not(feature = "train"))]
mod imp {
    use crate::failure::Result;
    use deepfusion_model::{InputSize, StoredNetwork};
    use deepfusion_runtime::LayerMaps;

    use crate::devices::ComputeDevice;
    use crate::error::CliError;

    /// There is none.
    pub(crate) enum Inspector {}

    impl Inspector {
        pub(crate) fn inspect(&self, _: &[f32], _: InputSize) -> Vec<LayerMaps> {
            match *self {}
        }
    }

    pub(crate) fn open(_: &StoredNetwork, _: ComputeDevice) -> Result<Inspector> {
        Err(CliError::BuiltWithoutTraining {
            what: "--save features",
        }
        .into())
    }
}

pub(super) use imp::{Inspector, open};
