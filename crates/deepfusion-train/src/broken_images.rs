//! Finds images that cannot be read before training begins: each of them would end the run halfway.

use crate::{Error, Skipped};
use deepfusion_data::Dataset;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Up to this many broken images of a recording are left out; more only if they are at most one in [`ONE_IN`].
const FEW: usize = 3;
const ONE_IN: usize = 20;
/// How many broken images are named; the others are only counted.
const NAMED: usize = 3;

/// A recording and a frame of it, by their indices.
pub(crate) type FrameIndex = (usize, usize);

/// Finds the broken images among the frames of a run: [`BrokenImages::among`], or [`BrokenImages::none`].
pub(crate) type ImageCheck = fn(&[Dataset], &BTreeSet<FrameIndex>) -> Result<BrokenImages, Error>;

/// Frames that are left out because their images cannot be read.
#[derive(Debug, Default)]
pub(crate) struct BrokenImages {
    frames: BTreeSet<FrameIndex>,
    /// One entry for each recording with broken images.
    pub(crate) reasons: Vec<Skipped>,
}

impl BrokenImages {
    /// Finds the broken images among the frames of a run. The result depends on the files alone: a resumed run and every worker leave out
    /// the same frames.
    ///
    /// # Errors
    /// [`Error::BrokenImages`] if a recording has too many of them, or only such images.
    pub(crate) fn among(datasets: &[Dataset], used: &BTreeSet<FrameIndex>) -> Result<Self, Error> {
        let broken: BTreeMap<FrameIndex, String> = used
            .par_iter()
            .filter_map(|&(dataset, frame)| {
                let error = datasets[dataset].check_image(frame).err()?;
                Some(((dataset, frame), error.to_string()))
            })
            .collect();
        let recordings: BTreeSet<usize> = broken.keys().map(|(dataset, _)| *dataset).collect();
        let mut reasons = Vec::new();
        for recording in recordings {
            let of = used.iter().filter(|(d, _)| *d == recording).count();
            let own = broken.range((recording, 0)..(recording + 1, 0));
            let mut images: Vec<String> = own.map(|(_, problem)| problem.clone()).collect();
            let count = images.len();
            let drive = datasets[recording].name().to_owned();
            images.truncate(NAMED);
            if count == of || count > FEW.max(of / ONE_IN) {
                return Err(Error::BrokenImages {
                    drive,
                    broken: count,
                    of,
                    images,
                });
            }
            reasons.push(Skipped::BrokenImages {
                drive,
                broken: count,
                of,
                images,
            });
        }
        let frames = broken.into_keys().collect();
        Ok(Self { frames, reasons })
    }

    /// Checks nothing and leaves out nothing.
    pub(crate) fn none(_: &[Dataset], _: &BTreeSet<FrameIndex>) -> Result<Self, Error> {
        Ok(Self::default())
    }

    /// Whether a frame's image can be read.
    pub(crate) fn is_readable(&self, frame: FrameIndex) -> bool {
        !self.frames.contains(&frame)
    }
}
