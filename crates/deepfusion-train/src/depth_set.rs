//! Images with known depth to learn from: frames of recordings, and simulated views.

use crate::fit_depth::fit_depth;
use crate::{Error, Sampler, SimulatedCamera, TrainConfig};
use deepfusion_data::{Dataset, GtKind, RgbImage};
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_nn::InputSize;
use deepfusion_sim::{Endless, EndlessConfig, Ingredient, MountedCamera, Scene};
use std::ops::Range;
use std::sync::Arc;

/// Offset of the seeds of validation worlds, so that training never sees them.
const VALIDATION_SEED: u64 = 0xDEE9_F051_0000_0000;

/// Focal length over width of the images: 26 mm on 36 mm of film.
const TYPICAL_FOCAL: f64 = 0.72;

/// A frame of a recording that has depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DepthFrame {
    /// Index in [`DepthSet::datasets`].
    pub dataset: usize,
    /// Index of the frame.
    pub frame: usize,
}

impl DepthFrame {
    /// The recording and the frame in it.
    pub(crate) fn place(&self) -> (usize, usize) {
        (self.dataset, self.frame)
    }

    /// The recording's frame.
    pub(crate) fn of<'a>(&self, datasets: &'a [Dataset]) -> &'a deepfusion_data::Frame {
        &datasets[self.dataset].frames()[self.frame]
    }
}

/// Views of simulated worlds.
#[derive(Clone)]
pub struct SimulatedViews {
    /// Name of the data set.
    pub name: String,
    /// Index in `data.sets`.
    pub set: usize,
    /// Number of views in one pass.
    pub views: usize,
    /// The renderer of the views.
    pub endless: Arc<Endless>,
}

impl std::fmt::Debug for SimulatedViews {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SimulatedViews")
            .field("name", &self.name)
            .field("views", &self.views)
            .finish_non_exhaustive()
    }
}

/// One image whose depth is known.
#[derive(Debug, Clone)]
pub struct DepthView {
    /// The image.
    pub image: RgbImage,
    /// Its depth (camera z, m), of the same size; 0: none.
    pub depth: DepthMap,
    /// Its camera.
    pub camera: Intrinsics,
    /// Whether a pixel without depth is sky, rather than unknown.
    pub sky: bool,
    /// Index in `data.sets`.
    pub set: usize,
    /// Drive and frame, or set and view.
    pub name: String,
}

/// Which view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ViewRef {
    /// A frame of a recording, by its index in [`DepthSet::frames`].
    Frame(usize),
    /// A view of [`DepthSet::simulated`], by its index there and its number.
    View(usize, u64),
}

/// All images with known depth that a run trains or validates on.
#[derive(Debug, Clone, Default)]
pub struct DepthSet {
    /// The recordings.
    pub datasets: Arc<Vec<Dataset>>,
    /// Index in `data.sets` of each recording.
    pub set_of: Arc<Vec<usize>>,
    /// Their frames with depth.
    pub frames: Vec<DepthFrame>,
    /// The simulated views.
    pub simulated: Vec<SimulatedViews>,
}

impl DepthSet {
    /// Splits into training and validation: of the recordings for which `learn` is true, the last `share` of each
    /// drive's frames with depth (exact depth of every pixel, or a scan) is held out; simulated views are made for both.
    ///
    /// # Errors
    /// [`Error::NoDepth`] for a drive that has none; [`Error::Simulator`].
    pub fn split(
        config: &TrainConfig,
        datasets: &Arc<Vec<Dataset>>,
        set_of: &Arc<Vec<usize>>,
        share: f64,
    ) -> Result<(Self, Self), Error> {
        let (mut train, mut held) = (Vec::new(), Vec::new());
        for (dataset, recording) in datasets.iter().enumerate() {
            if !config.learn(set_of[dataset]).from_depth() {
                continue;
            }
            let selected = recording.selected().iter().copied();
            let own: Vec<DepthFrame> = selected
                .filter(|frame| {
                    recording.has_dense_depth(*frame)
                        || recording.has_ground_truth(*frame, GtKind::Z)
                })
                .map(|frame| DepthFrame { dataset, frame })
                .collect();
            if own.is_empty() {
                return Err(Error::NoDepth {
                    drive: recording.name().to_owned(),
                });
            }
            let last = (own.len() as f64 * share).ceil() as usize;
            let (a, b) = own.split_at(own.len() - last.min(own.len() - 1));
            train.extend_from_slice(a);
            held.extend_from_slice(b);
        }
        let set = |frames, simulated| Self {
            datasets: Arc::clone(datasets),
            set_of: Arc::clone(set_of),
            frames,
            simulated,
        };
        let (views, validation_views) = simulated(config)?;
        Ok((set(train, views), set(held, validation_views)))
    }

    /// Views in a pass.
    #[must_use]
    pub fn len(&self) -> usize {
        self.frames.len() + self.simulated.iter().map(|s| s.views).sum::<usize>()
    }

    /// Views in a pass that were recorded, not simulated.
    #[must_use]
    pub fn recorded(&self) -> usize {
        self.frames.len()
    }

    /// Whether there are no views.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All views of a pass in order, for validation.
    pub(crate) fn all(&self) -> Vec<ViewRef> {
        let frames = (0..self.frames.len()).map(ViewRef::Frame);
        let views = self.simulated.iter().enumerate();
        let views =
            views.flat_map(|(i, s)| (0..s.views as u64).map(move |view| ViewRef::View(i, view)));
        frames.chain(views).collect()
    }

    /// The training views of these draws, counted from 0 over the whole run. In a pass every frame comes once and each simulated set as
    /// often as it has views, in a new order each pass. Simulated views come in the order of their numbers, since neighbours share a world.
    pub(crate) fn pick(&self, seed: u64, draws: Range<usize>) -> Vec<ViewRef> {
        let order = Sampler::new(self.len().max(1), 1, seed).samples_at(draws.clone());
        let picks = order.into_iter().zip(draws);
        picks.map(|(place, draw)| self.at(place, draw)).collect()
    }

    /// The view at a place of a pass. `draw` numbers the simulated views.
    fn at(&self, mut place: usize, draw: usize) -> ViewRef {
        if place < self.frames.len() {
            return ViewRef::Frame(place);
        }
        place -= self.frames.len();
        for (i, simulated) in self.simulated.iter().enumerate() {
            if place < simulated.views {
                return ViewRef::View(i, draw as u64);
            }
            place -= simulated.views;
        }
        ViewRef::Frame(0)
    }

    /// Loads or renders a view; a simulated one at the given size.
    ///
    /// # Errors
    /// [`Error::Data`] if an image or its depth cannot be read; [`Error::NoDepth`] if the frame has no depth any more.
    pub(crate) fn view(&self, pick: ViewRef, size: InputSize) -> Result<DepthView, Error> {
        match pick {
            ViewRef::Frame(index) => self.frame(self.frames[index]),
            ViewRef::View(index, number) => {
                let source = &self.simulated[index];
                let size = (size.width as u32, size.height as u32);
                let view = source.endless.view_sized(number, size);
                Ok(DepthView {
                    image: view.rgb,
                    depth: view.depth,
                    camera: view.intrinsics,
                    sky: true,
                    set: source.set,
                    name: format!("{}/{number}", source.name),
                })
            }
        }
    }

    fn frame(&self, DepthFrame { dataset, frame }: DepthFrame) -> Result<DepthView, Error> {
        let recording = &self.datasets[dataset];
        let dense = recording.dense_depth(frame)?;
        // The files of a simulated drive mark the sky with infinite depth; here it is 0.
        let sky = dense.is_some();
        let truth = match dense {
            Some(mut depth) => {
                let far = depth.data.iter_mut().filter(|d| d.is_infinite());
                far.for_each(|d| *d = 0.0);
                Some(depth)
            }
            None => recording.ground_truth(frame, GtKind::Z)?,
        };
        let depth = truth.ok_or_else(|| Error::NoDepth {
            drive: recording.name().to_owned(),
        })?;
        let Frame { drive, number } = Frame::of(recording, frame);
        let camera = recording.intrinsics(frame);
        // Depth cameras often have fewer pixels than the colour camera beside them.
        let (width, height) = (camera.width as usize, camera.height as usize);
        let depth = DepthMap {
            data: fit_depth(&depth, width, height, sky),
            width,
            height,
        };
        Ok(DepthView {
            image: recording.load_image(frame)?,
            depth,
            camera,
            sky,
            set: self.set_of[dataset],
            name: format!("{drive}/{number:010}"),
        })
    }

    /// A camera of this set at the size of its images: that of the first recording, else the simulator's, else a typical one.
    #[must_use]
    pub fn camera(&self) -> Option<Intrinsics> {
        let recorded = self.frames.first();
        let of_frame = |f: &DepthFrame| self.datasets[f.dataset].intrinsics(f.frame);
        let simulated = || {
            self.simulated
                .first()
                .map(|s| typical_camera(s.endless.config()))
        };
        recorded.map(of_frame).or_else(simulated)
    }

    /// The cameras of all frames, at the images' own sizes, and those that all simulated views of a set share, each with its index in
    /// `data.sets`.
    pub(crate) fn cameras(&self) -> impl Iterator<Item = (usize, Intrinsics)> {
        let of_frame = |f: &DepthFrame| {
            let camera = self.datasets[f.dataset].intrinsics(f.frame);
            (self.set_of[f.dataset], camera)
        };
        let held = self.simulated.iter().flat_map(|source| {
            let cameras = source.endless.config().cameras.iter();
            cameras.map(|camera| (source.set, camera.intrinsics))
        });
        self.frames.iter().map(of_frame).chain(held)
    }

    /// Whether simulated views have randomly drawn cameras.
    pub(crate) fn draws_cameras(&self) -> bool {
        let drawn = |s: &SimulatedViews| s.endless.config().cameras.is_empty();
        self.simulated.iter().any(drawn)
    }

    /// The frames and views of one set of `data.sets`.
    #[must_use]
    pub fn of_set(&self, set: usize) -> Self {
        let own = |f: &&DepthFrame| self.set_of[f.dataset] == set;
        let views = self.simulated.iter().filter(|s| s.set == set);
        Self {
            datasets: Arc::clone(&self.datasets),
            set_of: Arc::clone(&self.set_of),
            frames: self.frames.iter().filter(own).copied().collect(),
            simulated: views.cloned().collect(),
        }
    }
}

/// The camera of the views; if it is drawn at random, a typical phone camera with a field of view of 69°.
fn typical_camera(config: &EndlessConfig) -> Intrinsics {
    if let Some(camera) = config.cameras.first() {
        return camera.intrinsics;
    }
    let focal = TYPICAL_FOCAL * f64::from(config.width);
    Intrinsics::centred(focal, (config.width, config.height))
}

fn mounted(camera: &SimulatedCamera) -> MountedCamera {
    MountedCamera {
        intrinsics: camera.intrinsics(),
        height_m: camera.height_m,
        pitch_degrees: camera.pitch_degrees,
        roll_degrees: camera.roll_degrees,
    }
}

/// Name and number of a frame.
struct Frame<'a> {
    drive: &'a str,
    number: u64,
}

impl<'a> Frame<'a> {
    fn of(recording: &'a Dataset, frame: usize) -> Self {
        let frame = &recording.frames()[frame];
        Self {
            drive: &frame.drive,
            number: frame.number,
        }
    }
}

/// The simulated views of a configuration's sets, to train and to validate on.
fn simulated(config: &TrainConfig) -> Result<(Vec<SimulatedViews>, Vec<SimulatedViews>), Error> {
    let (mut train, mut held) = (Vec::new(), Vec::new());
    for (set, of) in config.data.sets.iter().enumerate() {
        let Some(simulated) = &of.simulated else {
            continue;
        };
        let names = simulated.without.iter();
        let without = names
            .map(|name| name.parse())
            .collect::<Result<Vec<Ingredient>, deepfusion_sim::Error>>()?;
        let scenes = simulated.scenes.iter();
        let scenes = scenes
            .map(|name| Scene::of_varied(name))
            .collect::<Result<Vec<_>, deepfusion_sim::Error>>()?;
        let views = |seed, views| -> Result<SimulatedViews, Error> {
            let endless = Endless::new(EndlessConfig {
                seed,
                width: config.size.width as u32,
                height: config.size.height as u32,
                views_per_world: simulated.views_per_world,
                plain: simulated.plain,
                hills: simulated.hills,
                riders: simulated.riders,
                formation: simulated.formation,
                scenes: scenes.clone(),
                without: without.clone(),
                cameras: simulated.cameras.iter().map(mounted).collect(),
                ..EndlessConfig::default()
            })?;
            Ok(SimulatedViews {
                name: of.name.clone(),
                set,
                views,
                endless: Arc::new(endless),
            })
        };
        train.push(views(simulated.seed, simulated.views)?);
        if simulated.validation_views > 0 {
            let seed = simulated.seed ^ VALIDATION_SEED;
            held.push(views(seed, simulated.validation_views)?);
        }
    }
    Ok((train, held))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pass_has_every_frame_once() {
        let endless = Endless::new(EndlessConfig::default()).unwrap();
        let frames = (0..30).map(|frame| DepthFrame { dataset: 0, frame });
        let set = DepthSet {
            frames: frames.collect(),
            simulated: vec![SimulatedViews {
                name: "worlds".into(),
                set: 1,
                views: 70,
                endless: Arc::new(endless),
            }],
            ..DepthSet::default()
        };
        let mut orders = Vec::new();
        for pass in 0..3 {
            let draws = 100 * pass..100 * (pass + 1);
            let picks = set.pick(5, draws.clone());
            let mut seen: Vec<usize> = Vec::new();
            for (pick, draw) in picks.iter().zip(draws) {
                match pick {
                    ViewRef::Frame(index) => seen.push(*index),
                    ViewRef::View(0, number) => assert_eq!(*number, draw as u64),
                    other => panic!("{other:?}"),
                }
            }
            orders.push(seen.clone());
            seen.sort_unstable();
            assert!(seen.iter().copied().eq(0..30), "pass {pass}: {seen:?}");
            // A batch that spans two passes has the views of both.
            assert_eq!(set.pick(5, 100 * pass + 40..100 * pass + 46), picks[40..46]);
        }
        assert_ne!(orders[0], orders[1]);
    }
}
