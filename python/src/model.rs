//! Trained networks and what they say of an image.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use deepfusion::data::Dataset;
use deepfusion::eval::{IntervalFactors, PostProcess};
use deepfusion::geometry::cloud::PointCloud;
use deepfusion::geometry::{DepthMap, Intrinsics};
use deepfusion::images::{RgbImage, exif_block_camera, load_photo};
use deepfusion::jobs::ModelFacts;
use deepfusion::jobs::devices::ComputeDevice;
use deepfusion::jobs::engine::EngineSettings;
use deepfusion::jobs::evaluation::augmentation;
use deepfusion::jobs::intervals::sigma;
use deepfusion::runtime::{Augmentation, DepthEstimator, ModelSource, Precision, embedded_names};
use numpy::ndarray::{Array2, Array3};
use numpy::{
    IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;

use crate::bulk::{BulkRequest, Predictions};
use crate::camera::{AskedCamera, GivenCamera};
use crate::dataset::Frame;
use crate::device;
use crate::error::{Failure, raise, warn, with_hint};
use crate::interrupt::abandonable;
use crate::opening::absolute;
use crate::perceive::depth_map;

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
        // What cannot be read is an error of whoever needs it.
        let stale = source.stale_calibrations().unwrap_or_default();
        if source.folder().is_some() || model.is_file() {
            // No embedded network's name: found from any folder.
            loaded.model = absolute(model);
        }
        Ok((Model::new(estimator, place, factors, loaded), stale))
    };
    // Large weights are read, and packed or moved to a GPU: that can take a while.
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
    /// By which what it says of its own error is stretched.
    factors: Arc<IntervalFactors>,
    assumed: Arc<AssumedCamera>,
    loaded: LoadArguments,
}

/// Whether Python was warned that the camera of an image is not known.
#[derive(Default)]
pub(crate) struct AssumedCamera(AtomicBool);

impl AssumedCamera {
    /// Once for all images of a network.
    pub(crate) fn warn(&self, py: Python<'_>) -> PyResult<()> {
        if self.0.swap(true, Ordering::Relaxed) {
            return Ok(());
        }
        warn(
            py,
            "nothing says the camera of an image: the lens of the training camera is assumed, and the metres are as right as that; \
             give intrinsics, or hfov_deg",
        )
    }
}

/// What loads a network again, in another process as well.
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

    /// Whatever thread held it before: an estimator keeps nothing from image to image.
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
    /// Depth of an H x W x 3 array (uint8, RGB; NumPy's, or another's on the processor by DLPack), a PIL image, a file, or a frame of a
    /// recording. The camera is `intrinsics` (fx, fy, cx, cy, or the 3 x 3 matrix), or the one that sees `hfov_deg` degrees from left to right;
    /// without either a frame has its own, and EXIF is asked, of a file or of what PIL opened from one. Then the lens of the training camera is
    /// assumed, of which Python is warned once, and the metres are as right as that.
    ///
    /// `focal_correction` multiplies depth for a focal length other than the one trained with; `stretch` shows the network the whole
    /// image where it would be cut to the aspect ratio trained with. `post_process` takes the mean of two predictions of the image or of four
    /// (the image and the mirrored one; a smaller input and a larger one; both): it usually errs less on real streets, and takes two to
    /// five times as long. Several sizes are for networks that learned at several, as `street` did.
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
            // Inside the pool, so that its many small parallel parts begin at once. The lock is taken outside: a thread of the pool that
            // waits for its parts takes up other work meanwhile, and another prediction would then wait for the lock below it, for ever.
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
        // The lock is taken without the interpreter's: another thread that holds it may be waiting for that.
        let (prediction, image, camera) = py.detach(work)?;
        if camera.is_none() {
            self.assumed.warn(py)?;
        }
        let factors = Arc::clone(&self.factors);
        Ok(Prediction::new(prediction, image, camera, factors))
    }

    /// The predictions of images of one camera, or of frames, in their order, as `predict` gives them. While the network looks at one, the next
    /// are read and prepared on other threads, as `deepfusion predict` does it. What is wrong with an image is raised at its turn;
    /// going on with `next` gives those behind it. `ahead` is how many may be on their way at once, by default some for each thread; one thread
    /// takes them at a time.
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

    /// The same network for another thread: it shares the weights.
    fn another(&self, py: Python<'_>) -> PyResult<Self> {
        let another = py.detach(|| self.with(|estimator| estimator.another()));
        let (factors, loaded) = (Arc::clone(&self.factors), self.loaded.clone());
        let another = Self::new(another.map_err(raise)?, self.device, factors, loaded);
        Ok(Self {
            assumed: Arc::clone(&self.assumed),
            ..another
        })
    }

    /// Width and height trained with.
    #[getter]
    fn size(&self, py: Python<'_>) -> (usize, usize) {
        let size = py.detach(|| self.with(|estimator| estimator.config().size));
        (size.width, size.height)
    }

    /// Steps it was trained for.
    #[getter]
    fn step(&self, py: Python<'_>) -> usize {
        py.detach(|| self.with(|estimator| estimator.step))
    }

    /// What runs it: "fused" on a processor ("fused-bf16", "fused-int8"), "burn" on a GPU.
    #[getter]
    fn engine(&self, py: Python<'_>) -> &'static str {
        py.detach(|| self.with(|estimator| estimator.engine()))
    }

    /// Where it runs: "cpu", "cuda:1".
    #[getter]
    fn device(&self) -> String {
        self.device.to_string()
    }

    /// Pickled, it is loaded again: the weights stay where they are.
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

/// What loads a model, and its arguments.
type Reduced<'py> = (Bound<'py, PyAny>, (PathBuf, String, Option<String>, String));

/// The predictions of each image by the name that the command line has for them.
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

/// Where an image is.
pub(crate) enum Source {
    /// Here, and the camera that the file says which they were read from.
    Pixels(RgbImage, Option<Intrinsics>),
    /// In a file.
    File(PathBuf),
    /// In a recording, which knows its camera.
    Frame(Arc<Dataset>, usize),
}

impl Source {
    /// From an array (NumPy's, or another's by DLPack), a PIL image, a path, or a frame.
    pub(crate) fn of(image: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(array) = image.extract::<PyReadonlyArray3<'_, u8>>() {
            return Ok(Self::Pixels(of_array(&array)?, None));
        }
        if let Ok(frame) = image.cast::<Frame>() {
            let (recording, index) = frame.get().source();
            return Ok(Self::Frame(recording, index));
        }
        if let Ok(path) = image.extract::<PathBuf>() {
            return Ok(Self::File(path));
        }
        let numpy = image.py().import("numpy")?;
        let mut exif = None;
        let array = if image.hasattr("__dlpack__")? {
            numpy.call_method1("from_dlpack", (image,))?
        } else if image.hasattr("convert")? {
            // PIL's way, which others have as well.
            exif = exif_of_file(image)?;
            of_pil(&upright(image)?)?
        } else {
            numpy.call_method1("asarray", (image,))?
        };
        match array.extract::<PyReadonlyArray3<'_, u8>>() {
            Ok(array) => {
                let pixels = of_array(&array)?;
                let camera = exif.and_then(|exif| exif_block_camera(&exif, pixels.dimensions()));
                Ok(Self::Pixels(pixels, camera.map(|camera| camera.intrinsics)))
            }
            Err(_) => Err(no_image(&array)?),
        }
    }

    /// The pixels, and the camera: the one asked for, else the recording's, or what EXIF says of the lens.
    pub(crate) fn read(
        self,
        asked: AskedCamera,
    ) -> Result<(RgbImage, Option<Intrinsics>), Failure> {
        let (image, own) = match self {
            Self::Pixels(image, camera) => (image, camera),
            Self::File(path) => {
                let photo = load_photo(&path)?;
                (photo.image, photo.intrinsics)
            }
            Self::Frame(recording, index) => {
                let camera = recording.intrinsics(index);
                (recording.load_image(index)?, Some(camera))
            }
        };
        let given = asked.of(image.dimensions())?;
        Ok((image, given.or(own)))
    }
}

/// What an array is that is no image, and what makes it one.
fn no_image(array: &Bound<'_, PyAny>) -> PyResult<PyErr> {
    let kind = array.getattr("dtype")?.str()?.to_string();
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let hint = match shape.as_slice() {
        [_, _, 3] if kind.starts_with("float") => {
            ": where it is from 0 to 1, (image * 255).astype(\"uint8\")"
        }
        [_, _] => ": of grey, np.stack([image] * 3, -1), of uint8",
        [_, _, _, 3] => ": predict_many takes several images",
        [3, _, _] => ": image.transpose(1, 2, 0), of uint8",
        _ => "",
    };
    Ok(PyTypeError::new_err(format!(
        "image: expected an H x W x 3 array of uint8, a PIL image, a path or a Frame, found {kind} {}{hint}",
        sizes(&shape)
    )))
}

fn sizes(shape: &[usize]) -> String {
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    if sizes.is_empty() {
        return "without a shape".into();
    }
    sizes.join(" x ")
}

/// The EXIF block of an image that PIL opened and nobody changed: of one that was cut, the focal length is no longer true.
fn exif_of_file(image: &Bound<'_, PyAny>) -> PyResult<Option<Vec<u8>>> {
    let Ok(pil) = image.py().import("PIL.ImageFile") else {
        return Ok(None);
    };
    if !image.is_instance(&pil.getattr("ImageFile")?)? {
        return Ok(None);
    }
    // A PNG may have it behind its pixels.
    image.call_method0("load")?;
    let block = image.getattr("info")?.call_method1("get", ("exif",))?;
    Ok(block.extract().ok())
}

/// A PIL image of a file whose EXIF says how the camera was held, turned as a file's own pixels are.
fn upright<'py>(image: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = image.py();
    if !image.hasattr("getexif")? {
        return Ok(image.clone());
    }
    py.import("PIL.ImageOps")?
        .call_method1("exif_transpose", (image,))
}

/// The pixels of a PIL image, H x W x 3. Its own conversion cuts 16-bit grey off at 255: here it becomes 8 bits as that of a file does.
fn of_pil<'py>(image: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = image.py();
    let numpy = py.import("numpy")?;
    // What only looks like PIL's need not have one.
    let mode = image.getattr("mode").ok();
    let mode: Option<String> = mode.and_then(|mode| mode.extract().ok());
    match mode.as_deref() {
        Some(mode) if mode.starts_with("I;16") => {
            let grey = numpy.call_method1("asarray", (image, "uint16"))?;
            let grey: PyReadonlyArray2<'_, u16> = grey.extract()?;
            let grey = grey.as_array();
            let size = (grey.nrows(), grey.ncols(), 3);
            let eight_bits = |value: u16| ((u32::from(value) + 128) / 257) as u8;
            let rgb =
                Array3::from_shape_fn(size, |(row, column, _)| eight_bits(grey[(row, column)]));
            Ok(rgb.into_pyarray(py).into_any())
        }
        Some(mode @ ("I" | "F")) => Err(PyTypeError::new_err(format!(
            "image: a PIL image of mode {mode:?} has no fixed range: give one of 8 bits, or an array of uint8"
        ))),
        _ => {
            let rgb = image.call_method1("convert", ("RGB",))?;
            numpy.call_method1("asarray", (rgb,))
        }
    }
}

fn of_array(array: &PyReadonlyArray3<'_, u8>) -> PyResult<RgbImage> {
    let [height, width, channels] = [0, 1, 2].map(|axis| array.shape()[axis]);
    let size = u32::try_from(width).ok().zip(u32::try_from(height).ok());
    let (Some((w, h)), 3, true) = (size, channels, width > 0 && height > 0) else {
        let hint = match (height, channels) {
            (_, 4) => ": image[..., :3] leaves the fourth channel out",
            (_, 1) => ": np.concatenate([image] * 3, -1) makes grey three channels",
            (3, _) => ": image.transpose(1, 2, 0)",
            _ => "",
        };
        let message = format!(
            "image: expected H x W x 3 of uint8, found uint8 {height} x {width} x {channels}{hint}"
        );
        return Err(PyValueError::new_err(message));
    };
    let bytes: Vec<u8> = match array.as_slice() {
        Ok(bytes) if array.is_c_contiguous() => bytes.to_vec(),
        // Rows or channels in another order, a part of a larger array.
        _ => array.as_array().iter().copied().collect(),
    };
    RgbImage::from_raw(w, h, bytes)
        .ok_or_else(|| PyValueError::new_err("image: its size is not that of its bytes"))
}

/// Positions and colours, N×3 each.
type Points<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<u8>>);

/// The metric depth of an image.
#[pyclass(frozen, module = "deepfusion")]
pub(crate) struct Prediction {
    /// Where it was made ahead of whoever asks.
    made: Mutex<Option<DepthMap>>,
    prediction: deepfusion::Prediction,
    image: RgbImage,
    camera: Option<Intrinsics>,
    factors: Arc<IntervalFactors>,
    /// Each made once: whoever asks again gets the same array.
    depth: PyOnceLock<Plane>,
    sigma: PyOnceLock<Option<Plane>>,
    confidence: PyOnceLock<Option<Plane>>,
    disparity: PyOnceLock<Plane>,
}

/// An array of H x W.
pub(crate) type Plane = Py<PyArray2<f32>>;

impl Prediction {
    pub(crate) fn new(
        prediction: deepfusion::Prediction,
        image: RgbImage,
        camera: Option<Intrinsics>,
        factors: Arc<IntervalFactors>,
    ) -> Self {
        Self {
            made: Mutex::new(None),
            prediction,
            image,
            camera,
            factors,
            depth: PyOnceLock::new(),
            sigma: PyOnceLock::new(),
            confidence: PyOnceLock::new(),
            disparity: PyOnceLock::new(),
        }
    }

    /// Depth, and its standard deviation as the command has it.
    fn stretched_sigma(&self) -> Option<(DepthMap, DepthMap)> {
        let depth = self.prediction.depth();
        let sigma = sigma(&self.prediction, &depth, &self.factors)?;
        Some((depth, sigma))
    }

    /// Whether anything says the camera.
    pub(crate) fn knows_camera(&self) -> bool {
        self.camera.is_some()
    }

    /// Whether the network saw the whole image.
    pub(crate) fn saw_all(&self) -> bool {
        let [width, height] = self.prediction.image_size;
        self.prediction.window == [0, 0, width, height]
    }

    /// With its depth made already.
    pub(crate) fn with_depth(self) -> Self {
        let made = Mutex::new(Some(self.prediction.depth()));
        Self { made, ..self }
    }
}

#[pymethods]
impl Prediction {
    /// H x W metres at the image's size; 0 outside of what the network looked at. One array, made once.
    #[getter]
    pub(crate) fn depth(&self, py: Python<'_>) -> PyResult<Plane> {
        let array = self.depth.get_or_try_init(py, || {
            let made = self
                .made
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .take();
            let depth = made.unwrap_or_else(|| py.detach(|| self.prediction.depth()));
            image_array(py, depth.height, depth.width, depth.data)
        })?;
        Ok(array.clone_ref(py))
    }

    /// Standard deviation of `depth` in metres, H x W, stretched by what was found for the network, as `deepfusion predict` writes it; None of
    /// a network that does not say. One array, made once.
    #[getter]
    fn sigma(&self, py: Python<'_>) -> PyResult<Option<Plane>> {
        once(py, &self.sigma, || {
            self.stretched_sigma().map(|(_, sigma)| sigma)
        })
    }

    /// How far each pixel of `depth` can be trusted, H x W, 0 to 1: exp(-the error of ln depth that is to be expected), 0.9 for 10 %;
    /// None of a network that does not say. Stretched as `sigma`. One array, made once.
    #[getter]
    fn confidence(&self, py: Python<'_>) -> PyResult<Option<Plane>> {
        once(py, &self.confidence, || {
            let (depth, sigma) = self.stretched_sigma()?;
            Some(deepfusion::Prediction::confidence_of(&depth, &sigma))
        })
    }

    /// 1/m, at the network's size. One array, made once.
    #[getter]
    pub(crate) fn disparity(&self, py: Python<'_>) -> PyResult<Plane> {
        let array = self.disparity.get_or_try_init(py, || {
            let p = &self.prediction;
            image_array(py, p.height, p.width, p.disparity.clone())
        })?;
        Ok(array.clone_ref(py))
    }

    /// fx, fy, cx, cy of the image, where they are known.
    #[getter]
    fn intrinsics(&self) -> Option<(f64, f64, f64, f64)> {
        self.camera.map(|k| (k.fx, k.fy, k.cx, k.cy))
    }

    /// `depth`'s: `torch.from_dlpack(prediction)` shares its memory.
    #[pyo3(signature = (**options))]
    fn __dlpack__<'py>(
        &self,
        py: Python<'py>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.depth(py)?
            .bind(py)
            .call_method("__dlpack__", (), options)
    }

    fn __dlpack_device__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.depth(py)?.bind(py).call_method0("__dlpack_device__")
    }

    /// `depth`: `np.asarray(prediction)` is that very array.
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let depth = self.depth(py)?.into_bound(py).into_any();
        let converted = match dtype {
            None => depth.clone(),
            Some(dtype) => {
                let shared = PyDict::new(py);
                shared.set_item("copy", false)?;
                depth.call_method("astype", (dtype,), Some(&shared))?
            }
        };
        match (copy, converted.is(&depth)) {
            (Some(true), true) => converted.call_method0("copy"),
            (Some(false), false) => Err(PyValueError::new_err(
                "depth is float32: another dtype needs a copy",
            )),
            _ => Ok(converted),
        }
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "a Prediction cannot be pickled: send its arrays, such as prediction.depth",
        ))
    }

    fn __repr__(&self) -> String {
        let [width, height] = self.prediction.image_size;
        let camera = if self.camera.is_some() {
            "known"
        } else {
            "assumed"
        };
        format!("Prediction({height} x {width}, camera {camera})")
    }

    /// Points N x 3 in metres (x right, y down, z ahead) and their colours N x 3, of `depth` as it stands there; needs `intrinsics`.
    #[pyo3(signature = (max_depth=80.0))]
    fn cloud<'py>(&self, py: Python<'py>, max_depth: f32) -> PyResult<Points<'py>> {
        let Some(camera) = self.camera else {
            return Err(with_hint(
                "a cloud needs the camera, and none is known of this image".into(),
                Some("predict(image, intrinsics=(fx, fy, cx, cy))".into()),
            ));
        };
        let depth = depth_map(&self.depth(py)?.bind(py).try_readonly()?);
        let make = || PointCloud::from_depth(&depth, &camera, Some(&self.image), max_depth);
        let cloud = py.detach(make).map_err(raise)?;
        let points = cloud.xyz.len();
        let rgb = cloud.rgb.unwrap_or_default();
        Ok((
            columns(py, points, cloud.xyz.into_flattened())?,
            columns(py, rgb.len(), rgb.into_flattened())?,
        ))
    }
}

/// The array of a map, made when it is first asked for.
fn once(
    py: Python<'_>,
    place: &PyOnceLock<Option<Plane>>,
    make: impl FnOnce() -> Option<DepthMap> + Send,
) -> PyResult<Option<Plane>> {
    let array = place.get_or_try_init(py, || {
        let map = py.detach(make);
        map.map(|map| image_array(py, map.height, map.width, map.data))
            .transpose()
    })?;
    Ok(array.as_ref().map(|array| array.clone_ref(py)))
}

/// N×3, without a copy.
fn columns<T: numpy::Element>(
    py: Python<'_>,
    rows: usize,
    values: Vec<T>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let array = Array2::from_shape_vec((rows, 3), values);
    let array = array.map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(array.into_pyarray(py))
}

/// H×W, without a copy.
pub(crate) fn image_array(
    py: Python<'_>,
    height: usize,
    width: usize,
    values: Vec<f32>,
) -> PyResult<Py<PyArray2<f32>>> {
    let array = Array2::from_shape_vec((height, width), values);
    let array = array.map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(array.into_pyarray(py).unbind())
}
