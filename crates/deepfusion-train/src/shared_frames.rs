//! Frames used for both training and validation.

use crate::{SampleSet, SharedFrames};
use deepfusion_data::FrameImage;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

/// The validation targets, including frames with known depth, that are also frames of training samples: by drive, in order of names, without
/// drives that have none. Frames are identified by their file, with links resolved, and their position in it.
#[must_use]
pub fn shared_frames(train: &SampleSet, validation: &SampleSet) -> Vec<SharedFrames> {
    let mut files = Files::default();
    let mut seen = HashMap::new();
    for sample in &train.samples {
        let target = (sample.dataset, sample.snippet.target);
        let sources = sample.sources().map(|source| (source, false));
        for ((dataset, frame), is_target) in sources.chain([(target, true)]) {
            let place = files.place(&train.datasets[dataset].frames()[frame].image);
            *seen.entry(place).or_insert(is_target) |= is_target;
        }
    }
    for known in &train.depth.frames {
        let place = files.place(&known.of(&train.depth.datasets).image);
        seen.insert(place, true);
    }
    let own = validation.samples.iter().map(|sample| {
        let dataset = &validation.datasets[sample.dataset];
        (dataset, &dataset.frames()[sample.snippet.target])
    });
    let with_depth = validation.depth.frames.iter().map(|known| {
        let datasets = &validation.depth.datasets;
        (&datasets[known.dataset], known.of(datasets))
    });
    let mut counted = HashSet::new();
    let mut drives: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    for (dataset, frame) in own.chain(with_depth) {
        let place = files.place(&frame.image);
        let Some(is_target) = seen.get(&place) else {
            continue;
        };
        if !counted.insert(place) {
            continue;
        }
        let (targets, sources) = drives.entry(dataset.name().to_owned()).or_default();
        if *is_target {
            *targets += 1;
        } else {
            *sources += 1;
        }
    }
    let shared = drives.into_iter();
    shared
        .map(|(drive, (targets, sources))| SharedFrames {
            drive,
            targets,
            sources,
        })
        .collect()
}

/// Numbers files, with links resolved. Consecutive frames of the same file need a single look-up.
#[derive(Default)]
pub(crate) struct Files {
    numbers: HashMap<PathBuf, usize>,
    last: Option<(PathBuf, usize)>,
}

impl Files {
    /// An image's file, and its position in it.
    pub(crate) fn place(&mut self, image: &FrameImage) -> (usize, u64) {
        match image {
            FrameImage::File(path) => (self.number(path), 0),
            FrameImage::Within { file, index } => (self.number(file), *index),
        }
    }

    fn number(&mut self, path: &Path) -> usize {
        if let Some((last, number)) = &self.last
            && last == path
        {
            return *number;
        }
        // A file that has disappeared is reported when it is read.
        let real = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let next = self.numbers.len();
        let number = *self.numbers.entry(real).or_insert(next);
        self.last = Some((path.to_owned(), number));
        number
    }
}
