use crate::loader::Ahead;
use crate::{
    BatchFactors, Error, Jitter, Motion, SampleFactors, SampleSet, Sampler, TrainConfig, losses,
    sampler::stream,
};
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_data::{Source, resize_rgb, to_chw};
use deepfusion_geometry::Se3;
use deepfusion_nn::InputSize;
use rand::Rng;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};

/// A batch of B samples with F frames each: the target, then its sources, then, with stereo, the other camera's view.
#[derive(Debug, Clone)]
pub struct SnippetBatch {
    /// Clean images by frame, each B×3×H×W; the losses use these.
    pub clean: Vec<Tensor<4>>,
    /// Jittered images by frame; the networks use these.
    pub network: Vec<Tensor<4>>,
    /// K, B×3×3, in pixels of these images.
    pub intrinsics: Tensor<3>,
    /// K⁻¹, B×3×3.
    pub inverse_intrinsics: Tensor<3>,
    /// Length of the camera's translation by source in time, each B, in metres.
    pub distance_m: Vec<Tensor<1>>,
    /// Weights of these lengths in the speed loss by source, each B ([`crate::losses::distance_weight`]); `None` where all are 1.
    pub distance_weight: Vec<Option<Tensor<1>>>,
    /// The camera's `source_from_target` by source, B each: measured by the vehicle's sensors; for the other camera, from the calibration.
    pub measured: Vec<Motion>,
    /// Which samples are of drives whose turns were measured, B, 1 or 0; `None` where all are. For the others the rotation in `measured` is
    /// meaningless.
    pub turns_known: Option<Tensor<1>>,
    /// Which samples have the other camera's view, B, 1 or 0; `None` where no sample lacks a view that the run uses. The others have a copy
    /// of their target in its place, which no loss may use.
    pub other_camera: Option<Tensor<1>>,
    /// Offsets of the sources in time.
    pub offsets: Vec<i32>,
    /// Drive and frame of each target.
    pub names: Vec<String>,
    /// The scale factors of each sample's data set; `None` if the run has no sets.
    pub factors: Option<BatchFactors>,
}

impl SnippetBatch {
    /// Number of samples, B.
    #[must_use]
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Whether there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }
}

/// A batch as plain values, made on the loader's thread.
struct RawBatch {
    size: InputSize,
    clean: Vec<Vec<f32>>,
    network: Vec<Vec<f32>>,
    intrinsics: Vec<f32>,
    inverse_intrinsics: Vec<f32>,
    distance_m: Vec<Vec<f32>>,
    distance_weight: Vec<Vec<f32>>,
    rotation: Vec<Vec<f32>>,
    translation: Vec<Vec<f32>>,
    turns_known: Vec<f32>,
    other_camera: Vec<f32>,
    offsets: Vec<i32>,
    names: Vec<String>,
    /// The scale factors of each sample; empty if they are the same for all.
    factors: Vec<SampleFactors>,
}

/// Resized images, H×W×3 bytes, by data set, frame and size.
#[derive(Default)]
struct ImageCache {
    images: HashMap<(usize, usize, InputSize), Arc<Vec<u8>>>,
    /// Size of all images in the cache.
    bytes: usize,
}

/// Everything needed to make a batch.
struct Maker {
    config: TrainConfig,
    set: SampleSet,
    /// Whether samples are mirrored and jittered.
    augment: bool,
    /// How many batches in a row have the same size: those that several workers learn from in one step.
    workers: usize,
    cache: Mutex<ImageCache>,
}

/// Makes batches in order, ahead of the trainer, on its own thread.
pub struct BatchLoader {
    batches: Ahead<RawBatch>,
    /// The pose network's own metres per unit.
    unit_m: f64,
}

impl std::fmt::Debug for BatchLoader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BatchLoader").finish_non_exhaustive()
    }
}

impl BatchLoader {
    /// Batches number `first`, `first + 1`, … of the sampler, mirrored and jittered as the configuration says. The content of a batch
    /// depends only on the seed and its number.
    #[must_use]
    pub fn training(config: &TrainConfig, set: SampleSet, first: usize) -> Self {
        Self::training_batches(config, set, first.., 1)
    }

    /// As [`Self::training`], for the batches of these numbers. Every `workers` batches make one step and have the same size.
    pub(crate) fn training_batches(
        config: &TrainConfig,
        set: SampleSet,
        numbers: impl Iterator<Item = usize> + Send + 'static,
        workers: usize,
    ) -> Self {
        let sampler = Sampler::new(set.samples.len(), config.batch, config.seed);
        let batches = numbers.map(move |i| (i, sampler.batch(i)));
        Self::start(config, set, Some(workers), batches)
    }

    /// All samples once, in order, clean.
    #[must_use]
    pub fn validation(config: &TrainConfig, set: SampleSet) -> Self {
        let indices: Vec<usize> = (0..set.samples.len()).collect();
        let batches: Vec<Vec<usize>> = indices.chunks(config.batch).map(<[_]>::to_vec).collect();
        Self::start(config, set, None, batches.into_iter().enumerate())
    }

    fn start(
        config: &TrainConfig,
        set: SampleSet,
        workers: Option<usize>,
        batches: impl Iterator<Item = (usize, Vec<usize>)> + Send + 'static,
    ) -> Self {
        let maker = Maker {
            config: config.clone(),
            set,
            augment: workers.is_some(),
            workers: workers.unwrap_or(1),
            cache: Mutex::default(),
        };
        Self {
            batches: Ahead::start(
                config.data.loader_threads_here(),
                batches,
                move |number, samples: &Vec<usize>| maker.make(number, samples),
            ),
            unit_m: config.pose_net.metres_per_unit,
        }
    }

    /// The next batch on `device`; `None` after the last.
    ///
    /// # Errors
    /// [`Error::Data`] if an image cannot be read or its size differs from its camera's;
    /// [`Error::Threads`] if the loader could not start; [`Error::Loader`] if its thread has died.
    pub fn next(&self, device: &Device) -> Option<Result<SnippetBatch, Error>> {
        let raw = match self.batches.next()? {
            Ok(raw) => raw,
            Err(error) => return Some(Err(error)),
        };
        let n = raw.names.len();
        let InputSize { width, height } = raw.size;
        let images = |frames: Vec<Vec<f32>>| {
            let tensor = |v| Tensor::from_data(TensorData::new(v, [n, 3, height, width]), device);
            frames.into_iter().map(tensor).collect()
        };
        let matrices = |v| Tensor::<3>::from_data(TensorData::new(v, [n, 3, 3]), device);
        let vectors = |v| Tensor::<1>::from_data(TensorData::new(v, [n]), device);
        Some(Ok(SnippetBatch {
            clean: images(raw.clean),
            network: images(raw.network),
            intrinsics: matrices(raw.intrinsics),
            inverse_intrinsics: matrices(raw.inverse_intrinsics),
            distance_m: raw.distance_m.into_iter().map(vectors).collect(),
            distance_weight: raw
                .distance_weight
                .into_iter()
                .map(|weights| weights.iter().any(|w| *w < 1.0).then(|| vectors(weights)))
                .collect(),
            measured: raw
                .rotation
                .into_iter()
                .zip(raw.translation)
                .map(|(r, t)| Motion {
                    rotation: matrices(r),
                    translation: Tensor::from_data(TensorData::new(t, [n, 3]), device),
                })
                .collect(),
            turns_known: raw
                .turns_known
                .contains(&0.0)
                .then(|| vectors(raw.turns_known)),
            other_camera: raw
                .other_camera
                .contains(&0.0)
                .then(|| vectors(raw.other_camera)),
            offsets: raw.offsets,
            names: raw.names,
            factors: (!raw.factors.is_empty())
                .then(|| BatchFactors::new(&raw.factors, self.unit_m, device)),
        }))
    }
}

/// One sample's part of a batch.
struct Item {
    clean: Vec<Vec<f32>>,
    network: Vec<Vec<f32>>,
    intrinsics: [f32; 9],
    inverse_intrinsics: [f32; 9],
    /// Distance, rotation and translation by source, the other camera's last.
    motion: Vec<(f32, [f32; 9], [f32; 3])>,
    /// Weights of the distances, by source.
    weights: Vec<f32>,
    /// Whether the vehicle's turns were measured.
    turns_known: bool,
    /// Whether the sample has the other camera's view, where the run has stereo.
    other_camera: bool,
}

impl Maker {
    fn make(&self, number: usize, samples: &[usize]) -> Result<RawBatch, Error> {
        let size = if self.augment {
            self.config.size_of_video_batch(number / self.workers)
        } else {
            self.config.size
        };
        let items = samples
            .par_iter()
            .enumerate()
            .map(|(slot, sample)| self.item(*sample, size, number * samples.len() + slot))
            .collect::<Result<Vec<Item>, Error>>()?;
        let views = self.config.frames.len() + usize::from(self.config.stereo);
        let frames = 1 + views;
        let images = |of: fn(&Item) -> &Vec<Vec<f32>>| {
            (0..frames)
                .map(|f| {
                    items
                        .iter()
                        .flat_map(|item| of(item)[f].iter().copied())
                        .collect()
                })
                .collect()
        };
        let sources = 0..self.config.frames.len();
        Ok(RawBatch {
            size,
            clean: images(|item| &item.clean),
            network: images(|item| &item.network),
            intrinsics: items.iter().flat_map(|i| i.intrinsics).collect(),
            inverse_intrinsics: items.iter().flat_map(|i| i.inverse_intrinsics).collect(),
            distance_m: sources
                .clone()
                .map(|s| items.iter().map(|i| i.motion[s].0).collect())
                .collect(),
            distance_weight: sources
                .map(|s| items.iter().map(|i| i.weights[s]).collect())
                .collect(),
            rotation: (0..views)
                .map(|s| items.iter().flat_map(|i| i.motion[s].1).collect())
                .collect(),
            translation: (0..views)
                .map(|s| items.iter().flat_map(|i| i.motion[s].2).collect())
                .collect(),
            turns_known: items.iter().map(|i| f32::from(i.turns_known)).collect(),
            other_camera: items.iter().map(|i| f32::from(i.other_camera)).collect(),
            offsets: self.config.frames.clone(),
            names: samples.iter().map(|s| self.set.name(*s)).collect(),
            factors: if !self.config.has_factors() {
                Vec::new()
            } else {
                samples.iter().map(|s| self.factors(*s, size)).collect()
            },
        })
    }

    fn factors(&self, sample: usize, size: InputSize) -> SampleFactors {
        let sample = &self.set.samples[sample];
        let camera = self.set.datasets[sample.dataset].intrinsics(sample.snippet.target);
        let set = self.set.set_of[sample.dataset];
        self.config.sample_factors(set, &camera, size)
    }

    fn item(&self, sample: usize, size: InputSize, draw: usize) -> Result<Item, Error> {
        let sample = &self.set.samples[sample];
        let dataset = &self.set.datasets[sample.dataset];
        let (width, height) = (size.width as u32, size.height as u32);
        let mut rng = stream(self.config.seed, 1, draw);
        let flip = rng.random::<bool>() && self.augment && self.config.augmentation.flip;
        let jitter = self
            .augment
            .then(|| Jitter::draw(&self.config.augmentation, &mut rng))
            .flatten();

        let sources = &sample.snippet.sources;
        let target = (sample.dataset, sample.snippet.target);
        let mut clean = Vec::new();
        // All samples of a batch have the same number of views: the target replaces a missing one.
        let other_camera = sample.stereo.is_some() || !self.config.stereo;
        let in_place = (!other_camera).then_some(target);
        let sources_seen = sample.sources().chain(in_place);
        for (dataset, frame) in std::iter::once(target).chain(sources_seen) {
            clean.push(self.image(dataset, frame, size, flip)?);
        }
        let network = clean
            .iter()
            .map(|image| {
                let mut image = image.clone();
                if let Some(jitter) = &jitter {
                    jitter.apply(&mut image);
                }
                image
            })
            .collect();

        let mut k = dataset
            .intrinsics(sample.snippet.target)
            .resized(width, height);
        if flip {
            k = k.flipped();
        }
        // Without a yaw rate nothing reads this: `SampleSet` refuses configurations that would, and `auto` looks at `turns_known`.
        let measured = sources.iter().map(|source| {
            let motion = source.motion.source_from_target;
            (
                source.motion.distance_m,
                motion.unwrap_or_else(Se3::identity),
            )
        });
        let calibrated = sample.stereo.iter().map(|view| {
            let motion = view.source_from_target;
            (motion.translation().norm(), motion)
        });
        let motion = measured
            .chain(calibrated)
            .chain(in_place.map(|_| (0.0, Se3::identity())))
            .map(|(distance_m, motion)| {
                let motion = if flip { motion.mirrored_x() } else { motion };
                (
                    distance_m as f32,
                    row_major(&motion.rotation()),
                    motion.translation().map(|v| v as f32).into(),
                )
            })
            .collect();
        let weight = |source: &Source| {
            let motion = &source.motion;
            losses::distance_weight(motion.distance_m, motion.distance_sigma_m) as f32
        };
        Ok(Item {
            weights: sources.iter().map(weight).collect(),
            turns_known: sources
                .iter()
                .all(|source| source.motion.source_from_target.is_some()),
            other_camera,
            clean,
            network,
            intrinsics: row_major(&k.matrix()),
            inverse_intrinsics: row_major(&k.inverse_matrix()),
            motion,
        })
    }

    /// The image at this size, 3×H×W in [0, 1].
    fn image(
        &self,
        dataset: usize,
        frame: usize,
        size: InputSize,
        flip: bool,
    ) -> Result<Vec<f32>, Error> {
        let key = (dataset, frame, size);
        let cached = self.lock().images.get(&key).cloned();
        let bytes = match cached {
            Some(bytes) => bytes,
            None => {
                let image = self.set.datasets[dataset].load_image(frame)?;
                let small = resize_rgb(&image, size.width as u32, size.height as u32);
                let bytes = Arc::new(small.into_raw());
                let mut cache = self.lock();
                if cache.bytes + bytes.len() <= self.config.data.cache_bytes()
                    && cache.images.insert(key, Arc::clone(&bytes)).is_none()
                {
                    cache.bytes += bytes.len();
                }
                bytes
            }
        };
        let (w, h) = (size.width as u32, size.height as u32);
        let image = deepfusion_data::RgbImage::from_raw(w, h, bytes.to_vec()).unwrap_or_default();
        let mut values = to_chw(&image);
        if flip {
            values
                .chunks_exact_mut(size.width)
                .for_each(<[f32]>::reverse);
        }
        Ok(values)
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, ImageCache> {
        // A thread that panicked while holding the lock left the cache consistent: an entry is inserted by a single call.
        self.cache
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

fn row_major(m: &nalgebra::Matrix3<f64>) -> [f32; 9] {
    std::array::from_fn(|i| m[(i / 3, i % 3)] as f32)
}
