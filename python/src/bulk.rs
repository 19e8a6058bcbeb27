//! Many images: while the network works on one, the next are read and the previous one's depth is computed.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use deepfusion::DepthEstimator;
use deepfusion::data::RgbImage;
use deepfusion::eval::IntervalFactors;
use deepfusion::geometry::Intrinsics;
use deepfusion::jobs::bulk::pipeline::Threads;
use deepfusion::runtime::{Augmentation, PreparedImage, Preparer};
use pyo3::exceptions::{PyException, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::PyIterator;

use crate::camera::{AskedCamera, AssumedCamera};
use crate::error::{Failure, raise};
use crate::image::Source;
use crate::prediction::Prediction;

/// The images and the settings of their prediction.
pub(crate) struct BulkRequest {
    pub images: Py<PyIterator>,
    pub camera: AskedCamera,
    pub focal_correction: bool,
    pub crop: bool,
    pub augmentation: Augmentation,
    pub factors: Arc<IntervalFactors>,
    /// How many images may be in progress, if the caller sets it.
    pub ahead: Option<usize>,
    pub assumed: Arc<AssumedCamera>,
}

/// Sends an image's prediction to the iterator that waits for it.
type Answer = Sender<Result<Prediction, Failure>>;

/// An image that has been read, on its way to the network.
struct LoadedImage {
    image: RgbImage,
    camera: Option<Intrinsics>,
    prepared: PreparedImage,
    answer: Answer,
}

/// The state of an image in the iterator.
enum Waiting {
    For(Receiver<Result<Prediction, Failure>>),
    /// It is not an image, or its iterator raised.
    Wrong(PyErr),
}

/// The predictions of many images, in their order.
#[pyclass(module = "deepfusion")]
pub(crate) struct Predictions {
    request: BulkRequest,
    /// None once the images have ended.
    to_read: Option<Sender<(Source, Answer)>>,
    /// In the images' order. The lock is never contended: it only makes receivers, which belong to one thread, part of an object that Python
    /// may share.
    waiting: Mutex<VecDeque<Waiting>>,
    /// How many images may be in progress.
    ahead: usize,
}

impl Predictions {
    /// Starts the threads, which end when the iterator is dropped.
    pub(crate) fn begin(request: BulkRequest, estimator: DepthEstimator) -> PyResult<Self> {
        // For as many cores as rayon uses: a worker on a large machine may have only one.
        let readers =
            Threads::for_cores(deepfusion_cli::in_pool(rayon::current_num_threads)).before;
        let (to_read, images) = channel::<(Source, Answer)>();
        let (to_network, read) = sync_channel::<LoadedImage>(readers);
        let (to_finish, seen) = sync_channel(2);
        let images = Arc::new(Mutex::new(images));
        let preparer = estimator.augmented(request.augmentation).map_err(raise)?;
        let settings = (request.camera, request.focal_correction, request.crop);
        let factors = request.factors.clone();
        for _ in 0..readers {
            let (images, to_network) = (Arc::clone(&images), to_network.clone());
            spawn(move || read_images(&images, &to_network, preparer, settings))?;
        }
        spawn(move || predict_images(estimator, &factors, &read, &to_finish))?;
        spawn(move || {
            for (prediction, answer) in seen {
                let prediction: Prediction = prediction;
                let answer: Answer = answer;
                // Fails if the iterator was dropped.
                drop(answer.send(Ok(prediction.with_depth())));
            }
        })?;
        Ok(Self {
            ahead: request.ahead.unwrap_or(2 * readers + 4),
            request,
            to_read: Some(to_read),
            waiting: Mutex::default(),
        })
    }

    /// Sends images to the readers until enough are in progress.
    fn fill(&mut self, py: Python<'_>) -> PyResult<()> {
        let waiting = self.waiting.get_mut();
        let waiting = waiting.unwrap_or_else(PoisonError::into_inner);
        while let Some(to_read) = &self.to_read
            && waiting.len() < self.ahead
        {
            let Some(image) = self.request.images.bind(py).clone().next() else {
                self.to_read = None;
                break;
            };
            // An object that is not an image raises at its turn: the images before it are still in progress.
            let source = match image.and_then(|image| Source::of(&image)) {
                Ok(source) => source,
                // KeyboardInterrupt and SystemExit are raised at once.
                Err(error) if !error.is_instance_of::<PyException>(py) => return Err(error),
                Err(error) => {
                    waiting.push_back(Waiting::Wrong(error));
                    continue;
                }
            };
            let (answer, prediction) = channel();
            if to_read.send((source, answer)).is_err() {
                return Err(PyRuntimeError::new_err("the reading threads have ended"));
            }
            waiting.push_back(Waiting::For(prediction));
        }
        Ok(())
    }
}

#[pymethods]
impl Predictions {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(slf: &Bound<'_, Self>) -> PyResult<Option<Prediction>> {
        let next = slf.try_borrow_mut();
        let mut next = next.map_err(|_| {
            PyRuntimeError::new_err(
                "predictions: another thread waits for the next one; give each thread its own iterator, from model.another()",
            )
        })?;
        next.advance(slf.py())
    }
}

impl Predictions {
    fn advance(&mut self, py: Python<'_>) -> PyResult<Option<Prediction>> {
        self.fill(py)?;
        let waiting = self.waiting.get_mut();
        let waiting = waiting.unwrap_or_else(PoisonError::into_inner);
        let Some(next) = waiting.pop_front() else {
            return Ok(None);
        };
        let next = match next {
            Waiting::For(prediction) => prediction,
            Waiting::Wrong(error) => return Err(error),
        };
        let prediction = py.detach(move || next.recv());
        py.check_signals()?;
        match prediction {
            Ok(prediction) => {
                let prediction = prediction?;
                if !prediction.knows_camera() {
                    self.request.assumed.warn(py)?;
                }
                Ok(Some(prediction))
            }
            Err(_) => Err(PyRuntimeError::new_err("the network's thread has ended")),
        }
    }
}

fn spawn(work: impl FnOnce() + Send + 'static) -> PyResult<()> {
    thread::Builder::new().spawn(work)?;
    Ok(())
}

fn read_images(
    images: &Mutex<Receiver<(Source, Answer)>>,
    to_network: &SyncSender<LoadedImage>,
    preparer: Preparer,
    (asked, focal_correction, crop): (AskedCamera, bool, bool),
) {
    loop {
        let next = images.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok((source, answer)) = next else { return };
        match source.read(asked) {
            Err(failure) => drop(answer.send(Err(failure))),
            Ok((image, camera)) => {
                let prepared = preparer.prepare(&image, camera.as_ref(), focal_correction, crop);
                let read = LoadedImage {
                    image,
                    camera,
                    prepared,
                    answer,
                };
                if to_network.send(read).is_err() {
                    return;
                }
            }
        }
    }
}

fn predict_images(
    mut estimator: DepthEstimator,
    factors: &Arc<IntervalFactors>,
    read: &Receiver<LoadedImage>,
    to_finish: &SyncSender<(Prediction, Answer)>,
) {
    for LoadedImage {
        image,
        camera,
        prepared,
        answer,
    } in read
    {
        match deepfusion_cli::in_pool(|| estimator.infer(&prepared)) {
            Err(error) => drop(answer.send(Err(error.into()))),
            Ok(prediction) => {
                let prediction = Prediction::new(prediction, image, camera, Arc::clone(factors));
                if to_finish.send((prediction, answer)).is_err() {
                    return;
                }
            }
        }
    }
}
