use crate::depth_set::ViewRef;
use crate::fit_depth::fit_depth;
use crate::loader::Ahead;
use crate::losses::DepthTruth;
use crate::sampler::stream;
use crate::window::Window;
use crate::{BatchFactors, DepthSet, DepthView, Error, Jitter, SampleFactors, TrainConfig};
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_data::{resize_rgb, to_chw};
use deepfusion_nn::InputSize;
use rand::Rng;
use rayon::prelude::*;

/// Beyond this share of the largest depth that the networks can express, a pixel only has to be far: a sigmoid never reaches its limit.
const FAR_SHARE: f64 = 0.9;

/// A batch of B images whose depth is known.
#[derive(Debug, Clone)]
pub struct DepthBatch {
    /// Clean images, B×3×H×W.
    pub clean: Tensor<4>,
    /// Jittered images, B×3×H×W; the networks use these.
    pub network: Tensor<4>,
    /// Their depth.
    pub truth: DepthTruth,
    /// The scale factors of each.
    pub factors: BatchFactors,
    /// Drive and frame, or set and view, of each.
    pub names: Vec<String>,
}

/// A batch as plain values, made on the loader's thread.
struct RawBatch {
    size: InputSize,
    clean: Vec<f32>,
    network: Vec<f32>,
    log_depth: Vec<f32>,
    known: Vec<f32>,
    far: Vec<f32>,
    factors: Vec<SampleFactors>,
    names: Vec<String>,
}

/// Makes batches of images with depth, ahead of the trainer.
pub struct DepthLoader {
    batches: Ahead<RawBatch>,
    /// The pose network's own metres per unit.
    unit_m: f64,
}

impl DepthLoader {
    /// Batches number `first`, `first + 1`, … The content of a batch depends only on the seed and its number.
    #[must_use]
    pub fn training(config: &TrainConfig, set: DepthSet, first: usize) -> Self {
        Self::training_batches(config, set, first.., 1)
    }

    /// As [`Self::training`], for the batches of these numbers. Every `workers` batches make one step and have the same size.
    pub(crate) fn training_batches(
        config: &TrainConfig,
        set: DepthSet,
        numbers: impl Iterator<Item = usize> + Send + 'static,
        workers: usize,
    ) -> Self {
        let (seed, size) = (config.seed, config.depth_batch());
        let picker = set.clone();
        let plans = numbers.map(move |number| {
            let draws = number * size..(number + 1) * size;
            (number, picker.pick(seed, draws))
        });
        Self::start(config, set, Some(workers), plans)
    }

    /// All views once, in order, clean.
    #[must_use]
    pub fn validation(config: &TrainConfig, set: DepthSet) -> Self {
        let picks = set.all();
        let plans: Vec<Vec<ViewRef>> = picks
            .chunks(config.depth_batch())
            .map(<[_]>::to_vec)
            .collect();
        Self::start(config, set, None, plans.into_iter().enumerate())
    }

    fn start(
        config: &TrainConfig,
        set: DepthSet,
        workers: Option<usize>,
        plans: impl Iterator<Item = (usize, Vec<ViewRef>)> + Send + 'static,
    ) -> Self {
        let own = config.clone();
        let make = move |number: usize, picks: &Vec<ViewRef>| {
            let mut own = own.clone();
            if let Some(workers) = workers {
                own.size = own.size_of_depth_batch(number / workers);
            }
            let first = number * picks.len();
            let items = picks
                .par_iter()
                .enumerate()
                .map(|(slot, pick)| {
                    item(
                        &own,
                        &set.view(*pick, own.size)?,
                        first + slot,
                        workers.is_some(),
                    )
                })
                .collect::<Result<Vec<Item>, Error>>()?;
            Ok(RawBatch::of(items, own.size))
        };
        Self {
            batches: Ahead::start(config.data.loader_threads_here(), plans, make),
            unit_m: config.pose_net.metres_per_unit.max(f64::MIN_POSITIVE),
        }
    }

    /// The next batch on `device`; `None` after the last.
    ///
    /// # Errors
    /// [`Error::Data`] if an image or a depth cannot be read; [`Error::Threads`] if the loader could not start;
    /// [`Error::Loader`] if its thread has died.
    pub fn next(&self, device: &Device) -> Option<Result<DepthBatch, Error>> {
        let raw = match self.batches.next()? {
            Ok(raw) => raw,
            Err(error) => return Some(Err(error)),
        };
        let n = raw.names.len();
        let InputSize { width, height } = raw.size;
        let tensor = |values, channels| {
            let shape = [n, channels, height, width];
            Tensor::<4>::from_data(TensorData::new(values, shape), device)
        };
        Some(Ok(DepthBatch {
            clean: tensor(raw.clean, 3),
            network: tensor(raw.network, 3),
            truth: DepthTruth {
                log_depth: tensor(raw.log_depth, 1),
                known: tensor(raw.known, 1),
                far: tensor(raw.far, 1),
            },
            factors: BatchFactors::new(&raw.factors, self.unit_m, device),
            names: raw.names,
        }))
    }
}

impl DepthBatch {
    /// Number of images, B.
    #[must_use]
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Whether there is no image.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }
}

impl RawBatch {
    fn of(items: Vec<Item>, size: InputSize) -> Self {
        let all = |plane: fn(&Item) -> &Vec<f32>| {
            items.iter().flat_map(move |i| plane(i).iter().copied())
        };
        Self {
            size,
            clean: all(|i| &i.clean).collect(),
            network: all(|i| &i.network).collect(),
            log_depth: all(|i| &i.log_depth).collect(),
            known: all(|i| &i.known).collect(),
            far: all(|i| &i.far).collect(),
            factors: items.iter().map(|i| i.factors).collect(),
            names: items.into_iter().map(|i| i.name).collect(),
        }
    }
}

/// One view's part of a batch.
struct Item {
    clean: Vec<f32>,
    network: Vec<f32>,
    log_depth: Vec<f32>,
    known: Vec<f32>,
    far: Vec<f32>,
    factors: SampleFactors,
    name: String,
}

/// A view as network input: randomly cropped, resized, mirrored, jittered.
fn item(config: &TrainConfig, view: &DepthView, draw: usize, augment: bool) -> Result<Item, Error> {
    let mut rng = stream(config.seed, 3, draw);
    let flip = rng.random::<bool>() && augment && config.augmentation.flip;
    let jitter = augment
        .then(|| Jitter::draw(&config.augmentation, &mut rng))
        .flatten();
    let (width, height) = (config.size.width, config.size.height);
    let window = if augment {
        Window::draw(&view.camera, config, &mut rng)
    } else {
        Window::centred(&view.camera, config)
    };
    let (image, depth) = (window.of_image(&view.image), window.of_depth(&view.depth));
    let mut clean = to_chw(&resize_rgb(&image, width as u32, height as u32));
    let mut depth = fit_depth(&depth, width, height, view.sky);
    if flip {
        clean.chunks_exact_mut(width).for_each(<[f32]>::reverse);
        depth.chunks_exact_mut(width).for_each(<[f32]>::reverse);
    }
    let mut network = clean.clone();
    if let Some(jitter) = &jitter {
        jitter.apply(&mut network);
    }
    let factors = config.sample_factors(view.set, &window.of_camera(&view.camera), config.size);
    let nearest = (factors.range.min_m * factors.focal) as f32;
    let farthest = (FAR_SHARE * factors.range.max_m * factors.focal) as f32;
    let is_far = |d: f32| d >= farthest || (d == 0.0 && view.sky);
    let flags = |of: &dyn Fn(f32) -> bool| depth.iter().map(|d| f32::from(of(*d))).collect();
    let (known, far) = (flags(&|d| d > 0.0 && !is_far(d)), flags(&is_far));
    let log = |d: &f32| {
        if is_far(*d) {
            farthest.ln()
        } else {
            d.max(nearest).ln()
        }
    };
    Ok(Item {
        log_depth: depth.iter().map(log).collect(),
        known,
        far,
        clean,
        network,
        factors,
        name: view.name.clone(),
    })
}
