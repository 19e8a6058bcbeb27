//! The Python module `deepfusion._native`. `deepfusion/__init__.py` is what people import; `_native.pyi` has the types.

mod adapt;
mod arrays;
mod bulk;
mod camera;
mod command;
mod dataset;
mod device;
mod error;
mod image;
mod interrupt;
mod measure;
mod model;
mod opening;
mod perceive;
mod prediction;
mod train;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::adapt::{adapt, undo_adaptation};
    #[pymodule_export]
    use super::bulk::Predictions;
    #[pymodule_export]
    use super::command::command;
    #[pymodule_export]
    use super::dataset::{Dataset, Frame, drives};
    #[pymodule_export]
    use super::device::{built, check_device, fastest};
    #[pymodule_export]
    use super::error::DeepFusionError;
    #[pymodule_export]
    use super::measure::{Evaluation, doctor, simulate};
    #[pymodule_export]
    use super::model::{Model, load, networks};
    #[pymodule_export]
    use super::perceive::Perception;
    #[pymodule_export]
    use super::prediction::Prediction;
    #[pymodule_export]
    use super::train::train;

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // NumPy's functions are looked up once, at the first array. Doing that here keeps Ctrl-C from interrupting it.
        drop(numpy::PyArray1::<f32>::zeros(module.py(), 0, false));
        deepfusion_cli::loaded_here();
        super::error::set_default_hint(module.py())?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
