//! Where to compute: `device="cuda:1"`.

use deepfusion::Hint;
use deepfusion::jobs::Error;
use deepfusion::jobs::devices::{self, Backend, ComputeDevice};
use deepfusion::train::Device;
use pyo3::prelude::*;

use crate::error::Failure;

/// The names of the backends that this package was built with.
#[pyfunction]
#[pyo3(name = "devices")]
pub(crate) fn built() -> Vec<&'static str> {
    let built = Backend::ALL.into_iter().filter(|one| one.is_built());
    built.map(Backend::name).collect()
}

/// The name of the device that "auto" chooses here.
#[pyfunction]
pub(crate) fn fastest() -> String {
    devices::fastest().to_string()
}

/// Raises if a name is not a device of this package. Does not check whether the machine has the device.
#[pyfunction]
pub(crate) fn check_device(device: &str) -> PyResult<()> {
    // The device is chosen where the work runs.
    if device == "auto" {
        return Ok(());
    }
    let backend = named(device)?.backend;
    if backend.is_built() {
        return Ok(());
    }
    let device = backend.name();
    Err(failure(Error::NoBackend { device }).into())
}

/// Parses a device's name.
pub(crate) fn named(word: &str) -> Result<ComputeDevice, Failure> {
    ComputeDevice::chosen(word).map_err(|why| Failure {
        message: format!("device: {word:?}: {why}"),
        hint: why.hint(),
    })
}

/// Opens a device.
pub(crate) fn open(device: ComputeDevice) -> Result<Device, Failure> {
    devices::open(device).map_err(failure)
}

/// An error of the library, with a hint for Python.
pub(crate) fn failure(error: Error) -> Failure {
    let hint = match &error {
        Error::NoBackend { device } => Some(format!(
            "build the package with it, in a checkout: pip install ./python --config-settings=build-args=\"--features {device}\"; or use device=\"cpu\""
        )),
        Error::NoSuchDevice {
            backend,
            count: 1..,
            ..
        } => Some(format!(
            "devices are counted from 0; device=\"{backend}\" uses the one that the backend prefers"
        )),
        Error::OnlyFused { .. } => Some("use precision=\"f32\" or device=\"cpu\"".into()),
        other => other.hint(),
    };
    Failure {
        message: error.to_string(),
        hint,
    }
}
