use crate::broken_images::{BrokenImages, ImageCheck};
use crate::error::MOST_SIGMA_SHARE;
use crate::shared_frames::Files;
use crate::stereo::{OtherCameras, StereoSource};
use crate::window::Window;
use crate::{
    DepthFrame, DepthSet, Error, Learn, NoStereo, SampleProblem, Skipped, TrainConfig,
    shared_frames,
};
use deepfusion_data::{Dataset, Snippet, hold_out};
use deepfusion_geometry::Intrinsics;
use std::collections::HashSet;
use std::sync::Arc;

/// Whether all distances of a sample are certain enough; a distance of unknown uncertainty is.
fn is_sure(snippet: &Snippet) -> bool {
    snippet.sources.iter().all(|source| {
        let motion = &source.motion;
        let sigma_m = motion.distance_sigma_m.unwrap_or(0.0);
        sigma_m <= MOST_SIGMA_SHARE * motion.distance_m
    })
}

/// The position of this reason in `skipped`, where it is added unless it is there. The two cameras of a drive, or its training and
/// validation, give the same reason only once.
fn add_reason(skipped: &mut Vec<Skipped>, reason: Skipped) -> usize {
    let text = reason.to_string();
    let place = skipped.iter().position(|s| s.to_string() == text);
    place.unwrap_or_else(|| {
        skipped.push(reason);
        skipped.len() - 1
    })
}

/// A training sample and the recording it belongs to.
#[derive(Debug, Clone)]
pub struct Sample {
    /// Index in [`SampleSet::datasets`].
    pub dataset: usize,
    /// The frames and the motion between them.
    pub snippet: Snippet,
    /// The other camera's view at the target's moment, if the run has stereo and the drive a second camera.
    pub stereo: Option<StereoSource>,
}

impl Sample {
    /// All frames of the sample other than its target: recording and frame.
    pub fn sources(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let own = self.snippet.sources.iter().map(|s| (self.dataset, s.frame));
        own.chain(self.stereo.iter().map(|s| (s.dataset, s.frame)))
    }

    /// All frames of the sample: the target and [`Self::sources`].
    fn shown(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.sources().chain([(self.dataset, self.snippet.target)])
    }
}

/// Keeps what one way of learning holds out also out of the other's training: depth of frames in held-out samples, and samples with frames
/// whose depth is held out. A drive that would have nothing left keeps everything.
fn keep_apart(
    (samples, depth): (&mut Vec<Sample>, &mut DepthSet),
    (held_out, held_depth): (&[Sample], &DepthSet),
) {
    if samples.is_empty() || depth.frames.is_empty() {
        return;
    }
    let mut files = Files::default();
    let datasets = Arc::clone(&depth.datasets);
    // Frames are compared by file: a drive may be in two data sets, or its depth in another one than its video.
    let mut place =
        |(dataset, frame): (usize, usize)| files.place(&datasets[dataset].frames()[frame].image);
    let mut shown = |sample: &Sample| -> Vec<_> { sample.shown().map(&mut place).collect() };
    let views: HashSet<_> = held_out.iter().flat_map(&mut shown).collect();
    let shown: Vec<_> = samples.iter().map(&mut shown).collect();
    let known: HashSet<_> = held_depth.frames.iter().map(|f| place(f.place())).collect();
    let of_depth: Vec<_> = depth.frames.iter().map(|f| place(f.place())).collect();
    let unseen = |i: usize| !views.contains(&of_depth[i]);
    retain_where_some_stay(&mut depth.frames, |frame| frame.dataset, unseen);
    let unseen = |i: usize| !shown[i].iter().any(|place| known.contains(place));
    retain_where_some_stay(samples, |sample| sample.dataset, unseen);
}

/// Leaves out training samples whose second camera's view is a held-out target: a split that selects frames for each camera may hold out
/// different moments of each. A recording that would have nothing left keeps everything.
fn leave_out_held_views(samples: &mut Vec<Sample>, held_out: &[Sample], datasets: &[Dataset]) {
    let mut files = Files::default();
    let mut place =
        |(dataset, frame): (usize, usize)| files.place(&datasets[dataset].frames()[frame].image);
    let targets = held_out.iter().map(|s| (s.dataset, s.snippet.target));
    let held: HashSet<_> = targets.map(&mut place).collect();
    let mut shows = |sample: &Sample| {
        let view = sample.stereo.as_ref();
        view.is_some_and(|view| held.contains(&place((view.dataset, view.frame))))
    };
    let shown: Vec<bool> = samples.iter().map(&mut shows).collect();
    retain_where_some_stay(samples, |sample| sample.dataset, |i| !shown[i]);
}

/// Leaves out frames with depth whose image cannot be read, and adds the reason to `skipped`.
fn leave_out_broken(
    [train, held]: [&mut DepthSet; 2],
    check: ImageCheck,
    skipped: &mut Vec<Skipped>,
) -> Result<(), Error> {
    let frames = train.frames.iter().chain(&held.frames);
    let used = frames.map(DepthFrame::place).collect();
    let broken = check(&train.datasets, &used)?;
    for depth in [train, held] {
        depth
            .frames
            .retain(|frame| broken.is_readable(frame.place()));
    }
    for reason in broken.reasons {
        add_reason(skipped, reason);
    }
    Ok(())
}

/// Keeps the items for whose index `keep` is true, and all items of a recording that would have none left.
fn retain_where_some_stay<T>(
    all: &mut Vec<T>,
    dataset: impl Fn(&T) -> usize,
    keep: impl Fn(usize) -> bool,
) {
    let kept = all.iter().enumerate().filter(|(i, _)| keep(*i));
    let stay: HashSet<usize> = kept.map(|(_, one)| dataset(one)).collect();
    let mut places = 0..;
    all.retain(|one| {
        let kept = places.next().is_some_and(&keep);
        kept || !stay.contains(&dataset(one))
    });
}

/// The samples of all recordings.
#[derive(Debug, Clone)]
pub struct SampleSet {
    /// The recordings.
    pub datasets: Arc<Vec<Dataset>>,
    /// The index in `data.sets` of each recording; 0 if the run has no sets.
    pub set_of: Arc<Vec<usize>>,
    /// The samples from video.
    pub samples: Vec<Sample>,
    /// The images with known depth.
    pub depth: DepthSet,
}

impl SampleSet {
    /// The training samples of `train`, and the validation samples: those of `validation` if given,
    /// else the held-out end of each training drive. Drives without a usable pair are skipped and
    /// listed in the last result, as long as one drive is left.
    ///
    /// # Errors
    /// [`Error::NoSamples`] with the reason for the last drive when no drive has a pair;
    /// [`Error::NoYawRate`] if the configuration needs the yaw rate and a drive has none.
    pub fn split(
        config: &TrainConfig,
        train: Vec<Dataset>,
        validation: Option<Vec<Dataset>>,
    ) -> Result<(Self, Self, Vec<Skipped>), Error> {
        let one_set = |datasets: Vec<Dataset>| datasets.into_iter().map(|d| (0, d)).collect();
        Self::split_sets(config, one_set(train), validation.map(one_set))
    }

    /// As [`Self::split`], for recordings with the index of their set in `data.sets`.
    ///
    /// # Errors
    /// As [`Self::split`]; [`Error::NoSamples`] for a set with nothing left to train on;
    /// [`Error::SharedFrames`] if a target of `validation` is also one of `train`.
    pub fn split_sets(
        config: &TrainConfig,
        train: Vec<(usize, Dataset)>,
        validation: Option<Vec<(usize, Dataset)>>,
    ) -> Result<(Self, Self, Vec<Skipped>), Error> {
        Self::split_by(config, train, validation, BrokenImages::among)
    }

    /// As [`Self::split_sets`], without checking any image: finds the frames that a run may have seen, even if the recordings' images no
    /// longer exist.
    ///
    /// # Errors
    /// As [`Self::split_sets`].
    pub fn split_unread(
        config: &TrainConfig,
        train: Vec<(usize, Dataset)>,
        validation: Option<Vec<(usize, Dataset)>>,
    ) -> Result<(Self, Self, Vec<Skipped>), Error> {
        Self::split_by(config, train, validation, BrokenImages::none)
    }

    fn split_by(
        config: &TrainConfig,
        train: Vec<(usize, Dataset)>,
        validation: Option<Vec<(usize, Dataset)>>,
        check: ImageCheck,
    ) -> Result<(Self, Self, Vec<Skipped>), Error> {
        let mut skipped = Vec::new();
        let apart = validation.is_some();
        let share = if apart { 0.0 } else { config.validation_share };
        let shared = |recordings: Vec<(usize, Dataset)>| {
            let (sets, datasets): (Vec<usize>, Vec<Dataset>) = recordings.into_iter().unzip();
            (Arc::new(sets), Arc::new(datasets))
        };
        let (set_of, train) = shared(train);
        let (mut samples, held_out) =
            Self::gather(config, (&train, &set_of), share, (check, &mut skipped))?;
        leave_out_held_views(&mut samples, &held_out, &train);
        if let (true, Some(first)) = (config.stereo, samples.first())
            && samples.iter().all(|sample| sample.stereo.is_none())
        {
            return Err(Error::NoStereo {
                drive: train[first.dataset].name().to_owned(),
                why: NoStereo::OneCamera,
            });
        }
        let (mut depth, mut held_depth) = DepthSet::split(config, &train, &set_of, share)?;
        leave_out_broken([&mut depth, &mut held_depth], check, &mut skipped)?;
        let validation = match validation {
            Some(datasets) => {
                let (set_of, datasets) = shared(datasets);
                let both: (&[Dataset], &[usize]) = (&datasets, &set_of);
                let (samples, _) = Self::gather(config, both, 0.0, (check, &mut skipped))?;
                let (mut all, mut none) = DepthSet::split(config, &datasets, &set_of, 0.0)?;
                leave_out_broken([&mut all, &mut none], check, &mut skipped)?;
                held_depth = DepthSet {
                    // The simulated views of validation have worlds of their own.
                    simulated: held_depth.simulated,
                    ..all
                };
                Self {
                    datasets,
                    set_of,
                    samples,
                    depth: held_depth,
                }
            }
            None => {
                keep_apart((&mut samples, &mut depth), (&held_out, &held_depth));
                Self {
                    datasets: Arc::clone(&train),
                    set_of: Arc::clone(&set_of),
                    samples: held_out,
                    depth: held_depth,
                }
            }
        };
        let train = Self {
            datasets: train,
            set_of,
            samples,
            depth,
        };
        if apart {
            let shared = shared_frames(&train, &validation);
            if shared.iter().any(|s| s.targets > 0) {
                return Err(Error::SharedFrames { shared });
            }
        }
        for (i, set) in config.data.sets.iter().enumerate() {
            let motion = || train.samples.iter().any(|s| train.set_of[s.dataset] == i);
            // A set without depth has already been refused.
            if set.learn.from_motion() && !motion() {
                return Err(Error::NoSamples {
                    data: format!("data set {}", set.name),
                    reason: SampleProblem::Skipped(skipped.pop().into_iter().collect()),
                });
            }
        }
        Ok((train, validation, skipped))
    }

    fn gather(
        config: &TrainConfig,
        (datasets, set_of): (&[Dataset], &[usize]),
        share: f64,
        (check, skipped): (ImageCheck, &mut Vec<Skipped>),
    ) -> Result<(Vec<Sample>, Vec<Sample>), Error> {
        let (mut train, mut held) = (Vec::new(), Vec::new());
        // Why drives have no sample: the last error, or uncertain distances, as positions in `skipped`.
        let (mut last, mut unsure) = (None, Vec::<usize>::new());
        let learns = |dataset: &usize| config.learn(set_of[*dataset]);
        let other_cameras = OtherCameras::of(datasets, set_of);
        for (dataset, recording) in datasets.iter().enumerate() {
            if learns(&dataset) == Learn::Depth {
                continue;
            }
            let distance = config.frame_distance_m;
            match recording.snippets_apart(&config.frames, distance, config.min_speed_mps) {
                Ok(_) if config.reads_rotation() && !recording.yaw_known() => {
                    return Err(Error::NoYawRate {
                        drive: recording.name().to_owned(),
                    });
                }
                Ok(snippets) => {
                    let all = snippets.len();
                    let snippets: Vec<_> = snippets.into_iter().filter(is_sure).collect();
                    if snippets.len() < all {
                        let reason = Skipped::UnsureDistances {
                            drive: recording.name().to_owned(),
                            unsure: all - snippets.len(),
                            of: all,
                        };
                        let place = add_reason(skipped, reason);
                        if snippets.is_empty() && !unsure.contains(&place) {
                            unsure.push(place);
                        }
                    }
                    let (a, b) = hold_out(snippets, share);
                    let other = config.stereo.then(|| other_cameras.beside(dataset));
                    let other = other.transpose()?.flatten();
                    // A frame without a counterpart in the other camera is left out.
                    let sample = |snippet: Snippet| {
                        let number = recording.frames()[snippet.target].number;
                        let stereo = match &other {
                            Some(other) => Some(other.at(number)?),
                            None => None,
                        };
                        Some(Sample {
                            dataset,
                            snippet,
                            stereo,
                        })
                    };
                    let (wanted, before) = (a.len(), train.len());
                    train.extend(a.into_iter().filter_map(sample));
                    held.extend(b.into_iter().filter_map(sample));
                    if wanted > 0 && train.len() == before {
                        return Err(Error::NoStereo {
                            drive: recording.name().to_owned(),
                            why: NoStereo::NoCommonFrame,
                        });
                    }
                }
                Err(error) => last = Some(add_reason(skipped, Skipped::Drive(error.into()))),
            }
        }
        let used = train.iter().chain(&held).flat_map(Sample::shown).collect();
        let broken = check(datasets, &used)?;
        let is_readable = |sample: &Sample| sample.shown().all(|frame| broken.is_readable(frame));
        train.retain(is_readable);
        held.retain(is_readable);
        for reason in broken.reasons {
            last = Some(add_reason(skipped, reason));
        }
        let depth_alone =
            (0..config.data.sets.len().max(1)).all(|s| !config.learn(s).from_motion());
        if !train.is_empty() || depth_alone {
            return Ok((train, held));
        }
        unsure.truncate(3);
        let mut all: Vec<_> = skipped.drain(..).map(Some).collect();
        let places = unsure.into_iter().chain(last);
        let mut reasons: Vec<Skipped> = places.filter_map(|i| all[i].take()).collect();
        let one = match reasons.pop() {
            Some(Skipped::Drive(error)) if reasons.is_empty() => match Arc::try_unwrap(error) {
                // The error is the only reason: return it as it is.
                Ok(error) => return Err(error.into()),
                Err(shared) => Some(Skipped::Drive(shared)),
            },
            one => one,
        };
        reasons.extend(one);
        Err(Error::NoSamples {
            data: "the data given".into(),
            reason: match reasons.as_slice() {
                [] => SampleProblem::NoDrive,
                _ => SampleProblem::Skipped(reasons),
            },
        })
    }

    /// The mean length of the camera's translation over all pairs, in metres.
    #[must_use]
    pub fn mean_displacement_m(&self) -> f64 {
        let pairs = || self.samples.iter().flat_map(|s| &s.snippet.sources);
        pairs().map(|s| s.motion.distance_m).sum::<f64>() / pairs().count().max(1) as f64
    }

    /// The samples of one set of `data.sets`.
    #[must_use]
    pub fn of_set(&self, set: usize) -> Self {
        let own = |s: &&Sample| self.set_of[s.dataset] == set;
        Self {
            datasets: Arc::clone(&self.datasets),
            set_of: Arc::clone(&self.set_of),
            samples: self.samples.iter().filter(own).cloned().collect(),
            depth: self.depth.of_set(set),
        }
    }

    /// The camera of the first sample, at the image's own size.
    #[must_use]
    pub fn camera(&self) -> Option<Intrinsics> {
        let of = |sample: &Sample| self.datasets[sample.dataset].intrinsics(sample.snippet.target);
        self.samples.first().map(of).or_else(|| self.depth.camera())
    }

    /// f_y of every sample at the network's input size, with the sample's index in `data.sets`. Images of video are resized as a whole;
    /// images with known depth are cropped to the network's aspect ratio first.
    pub(crate) fn focal_lengths_px(
        &self,
        config: &TrainConfig,
    ) -> impl Iterator<Item = (usize, f64)> {
        let (width, height) = (config.size.width as u32, config.size.height as u32);
        let of_video = move |sample: &Sample| {
            // A sample of a missing recording is an error when it is loaded.
            let camera = self
                .datasets
                .get(sample.dataset)?
                .intrinsics(sample.snippet.target);
            let fy = camera.resized(width, height).fy;
            Some((*self.set_of.get(sample.dataset)?, fy))
        };
        let of_depth = move |(set, camera): (usize, Intrinsics)| {
            let shown = Window::centred(&camera, config).of_camera(&camera);
            (set, shown.resized(width, height).fy)
        };
        let depth = self.depth.cameras().map(of_depth);
        self.samples.iter().filter_map(of_video).chain(depth)
    }

    /// Whether there is nothing to learn from.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty() && self.depth.is_empty()
    }

    /// Drive and frame numbers of a sample, for messages.
    #[must_use]
    pub fn name(&self, sample: usize) -> String {
        let Sample {
            dataset, snippet, ..
        } = &self.samples[sample];
        let frame = &self.datasets[*dataset].frames()[snippet.target];
        format!("{}/{:010}", frame.drive, frame.number)
    }
}
