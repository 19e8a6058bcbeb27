//! Trained networks.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use deepfusion::eval::{IntervalFactors, PostProcess};
use deepfusion::jobs::ModelFacts;
use deepfusion::jobs::devices::ComputeDevice;
use deepfusion::jobs::engine::EngineSettings;
use deepfusion::jobs::evaluation::augmentation;
use deepfusion::runtime::{Augmentation, DepthEstimator, ModelSource, Precision, embedded_names};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::bulk::{BulkRequest, Predictions};
use crate::camera::{AskedCamera, AssumedCamera, GivenCamera};
use crate::device;
use crate::error::{Failure, raise, warn};
use crate::image::Source;
use crate::interrupt::abandonable;
use crate::opening::absolute;
use crate::prediction::Prediction;

/// The names of the networks inside the package.
#[pyfunction]
pub(crate) fn networks() -> Vec<&'static str> {
    embedded_names()
}

/// A trained network by its path or name.
#[pyfunction]
pub(crate) fn load(
    py: Python<'_>,
    model: PathBuf,
    precision: &str,
    data_set: Option<String>,
    device: String,
) -> PyResult<Model> {
    let mut loaded = LoadArguments {
        model: model.clone(),
        precision: precision.to_owned(),
        data_set: data_set.clone(),
        device: device.clone(),
    };
    let precision = match precision {
        "f32" => Precision::F32,
        "bf16" => Precision::Bf16,
        "int8" => Precision::Int8,
        other => {
            let message =
                format!("precision: expected \"f32\", \"bf16\" or \"int8\", found {other:?}");
            return Err(PyValueError::new_err(message));
        }
    };
    let open = move || -> Result<_, Failure> {
        let place = device::named(&device)?;
        let source = ModelSource::named(&model)?;
        let network = source.load(data_set.as_deref())?;
        let engine = EngineSettings {
            precision,
            ..EngineSettings::on(place)
        };
        let estimator = engine.load(network).map_err(device::failure)?;
        let factors = Arc::new(source.interval_factors()?);
        // An unreadable calibration is an error only for code that needs it.
        let stale = source.stale_calibrations().unwrap_or_default();
        if source.folder().is_some() || model.is_file() {
            // Not an embedded network's name: absolute, so that it is found from any folder.
            loaded.model = absolute(model);
        }
        Ok((Model::new(estimator, place, factors, loaded), stale))
    };
    // Reading large weights and packing them or moving them to a GPU can take a while.
    let (model, stale) = abandonable(py, open)??;
    for stale in stale {
        warn(py, &stale.to_string())?;
    }
    Ok(model)
}

/// A trained network.
#[pyclass(frozen, module = "deepfusion")]
pub(crate) struct Model {
    estimator: Mutex<DepthEstimator>,
    device: ComputeDevice,
    /// Factors that calibrate the predicted sigma.
    factors: Arc<IntervalFactors>,
    assumed: Arc<AssumedCamera>,
    loaded: LoadArguments,
}

/// The arguments that load the network again, also in another process.
#[derive(Clone)]
struct LoadArguments {
    model: PathBuf,
    precision: String,
    data_set: Option<String>,
    device: String,
}

impl Model {
    fn new(
        estimator: DepthEstimator,
        device: ComputeDevice,
        factors: Arc<IntervalFactors>,
        loaded: LoadArguments,
    ) -> Self {
        Self {
            estimator: Mutex::new(estimator),
            device,
            factors,
            assumed: Arc::default(),
            loaded,
        }
    }

    /// Uses the estimator, even after a panic in another thread: it keeps no state from image to image.
    fn with<R>(&self, work: impl FnOnce(&mut DepthEstimator) -> R) -> R {
        work(
            &mut self
                .estimator
                .lock()
                .unwrap_or_else(PoisonError::into_inner),
        )
    }
}

#[pymethods]
impl Model {
    /// Predicts the depth of an H x W x 3 array (uint8, RGB; NumPy's, or another library's on the CPU by DLPack), a PIL image, a
    /// file, or a frame of a recording. The camera is `intrinsics` (fx, fy, cx, cy, or the 3 x 3 matrix), or is given by
    /// `hfov_deg`, the horizontal field of view in degrees. Without either, a frame has its own camera, and a file, or what PIL
    /// opened from one, its EXIF data. If there is none, the training camera's lens is assumed, Python warns once, and the metres
    /// are only as right as that assumption.
    ///
    /// `focal_correction` corrects depth for a focal length other than the training camera's; `stretch` shows the network the whole
    /// image where it would be cropped to the training images' aspect ratio. `post_process` averages two or four predictions of the
    /// image (the image and the mirrored one; a smaller input and a larger one; both): this usually lowers the error on real
    /// streets, and takes two to five times as long. Several sizes are for networks trained at several sizes, such as `street`.
    #[expect(clippy::too_many_arguments, reason = "by name in Python")]
    #[pyo3(signature = (image, intrinsics=None, *, hfov_deg=None, focal_correction=true, stretch=false, post_process=None))]
    fn predict(
        &self,
        py: Python<'_>,
        image: &Bound<'_, PyAny>,
        intrinsics: Option<GivenCamera>,
        hfov_deg: Option<f64>,
        focal_correction: bool,
        stretch: bool,
        post_process: Option<&str>,
    ) -> PyResult<Prediction> {
        let asked = AskedCamera::new(intrinsics, hfov_deg)?;
        let augmentation = augmentation_named(post_process)?;
        let source = Source::of(image)?;
        let work = || -> Result<_, Failure> {
            let (image, camera) = source.read(asked)?;
            // Inside the pool, so that its many small parallel parts start at once. The lock is taken outside: a thread of the pool that
            // waits for its parts takes up other work meanwhile, and if that were another prediction, it would wait for the lock forever.
            let prediction = self.with(|estimator| {
                deepfusion_cli::in_pool(|| {
                    let preparer = estimator.augmented(augmentation)?;
                    let camera = camera.as_ref();
                    let seen = preparer.prepare(&image, camera, focal_correction, !stretch);
                    estimator.infer(&seen)
                })
            })?;
            Ok((prediction, image, camera))
        };
        // The lock is taken without the GIL: the thread that holds it may be waiting for the GIL.
        let (prediction, image, camera) = py.detach(work)?;
        if camera.is_none() {
            self.assumed.warn(py)?;
        }
        let factors = Arc::clone(&self.factors);
        Ok(Prediction::new(prediction, image, camera, factors))
    }

    /// Predicts images of one camera, or frames, in their order, as `predict` does. While the network works on one image, the next
    /// ones are read and prepared on other threads, as in `deepfusion predict`. What is wrong with an image is raised when its turn
    /// comes; calling `next` again continues with the images after it. `ahead` is how many may be on their way at once, by default
    /// a few per thread; one thread at a time takes the predictions.
    #[pyo3(signature = (images, intrinsics=None, *, hfov_deg=None, focal_correction=true, stretch=false, post_process=None, ahead=None))]
    #[expect(clippy::too_many_arguments, reason = "by name in Python")]
    fn predict_many(
        &self,
        py: Python<'_>,
        images: &Bound<'_, PyAny>,
        intrinsics: Option<GivenCamera>,
        hfov_deg: Option<f64>,
        focal_correction: bool,
        stretch: bool,
        post_process: Option<&str>,
        ahead: Option<usize>,
    ) -> PyResult<Predictions> {
        if ahead == Some(0) {
            return Err(PyValueError::new_err("ahead: expected at least 1, found 0"));
        }
        let request = BulkRequest {
            images: images.try_iter()?.unbind(),
            camera: AskedCamera::new(intrinsics, hfov_deg)?,
            ahead,
            assumed: Arc::clone(&self.assumed),
            focal_correction,
            crop: !stretch,
            augmentation: augmentation_named(post_process)?,
            factors: Arc::clone(&self.factors),
        };
        let own = py.detach(|| self.with(|estimator| estimator.another()));
        Predictions::begin(request, own.map_err(raise)?)
    }

    /// The same network for another thread; it shares the weights.
    fn another(&self, py: Python<'_>) -> PyResult<Self> {
        let another = py.detach(|| self.with(|estimator| estimator.another()));
        let (factors, loaded) = (Arc::clone(&self.factors), self.loaded.clone());
        let another = Self::new(another.map_err(raise)?, self.device, factors, loaded);
        Ok(Self {
            assumed: Arc::clone(&self.assumed),
            ..another
        })
    }

    /// Width and height that it was trained with.
    #[getter]
    fn size(&self, py: Python<'_>) -> (usize, usize) {
        let size = py.detach(|| self.with(|estimator| estimator.config().size));
        (size.width, size.height)
    }

    /// Steps that it was trained for.
    #[getter]
    fn step(&self, py: Python<'_>) -> usize {
        py.detach(|| self.with(|estimator| estimator.step))
    }

    /// The engine that runs it: "fused" on a processor ("fused-bf16", "fused-int8"), "burn" on a GPU.
    #[getter]
    fn engine(&self, py: Python<'_>) -> &'static str {
        py.detach(|| self.with(|estimator| estimator.engine()))
    }

    /// The device that it runs on, such as "cpu" or "cuda:1".
    #[getter]
    fn device(&self) -> String {
        self.device.to_string()
    }

    /// Unpickling loads it again: the weights stay where they are.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let again = py.import("deepfusion._native")?.getattr("load")?;
        let LoadArguments {
            model,
            precision,
            data_set,
            device,
        } = self.loaded.clone();
        Ok((again, (model, precision, data_set, device)))
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let (width, height) = self.size(py);
        let name = self.loaded.model.display().to_string();
        format!("Model({name:?}, {width} x {height}, {})", self.device)
    }
}

/// The function that loads a model, and its arguments.
type Reduced<'py> = (Bound<'py, PyAny>, (PathBuf, String, Option<String>, String));

/// Test-time augmentation by its name on the command line.
fn augmentation_named(name: Option<&str>) -> PyResult<Augmentation> {
    let Some(name) = name else {
        return Ok(Augmentation::NONE);
    };
    let mut all = PostProcess::ALL.into_iter();
    match all.find(|how| how.name() == name) {
        Some(how) => Ok(augmentation(Some(how))),
        None => Err(PyValueError::new_err(format!(
            "post_process: expected None, {}, found {name:?}",
            PostProcess::ALL
                .map(|how| format!("{:?}", how.name()))
                .join(" or ")
        ))),
    }
}
