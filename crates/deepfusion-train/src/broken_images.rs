//! Images that cannot be read, found before training begins: one of them would end the run in its middle.

use crate::{Error, Skipped};
use deepfusion_data::Dataset;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// So many broken images of a recording are left out, and more only up to one in so many.
const FEW: usize = 3;
const ONE_IN: usize = 20;
/// Those that are named; the others are counted.
const NAMED: usize = 3;

/// A recording and a frame of it, by their indices.
pub(crate) type FrameIndex = (usize, usize);

/// What looks for them among the frames of a run: [`BrokenImages::among`], or [`BrokenImages::none`].
pub(crate) type ImageCheck = fn(&[Dataset], &BTreeSet<FrameIndex>) -> Result<BrokenImages, Error>;

/// Frames to do without.
#[derive(Debug, Default)]
pub(crate) struct BrokenImages {
    frames: BTreeSet<FrameIndex>,
    /// Of each recording that has some.
    pub(crate) reasons: Vec<Skipped>,
}

impl BrokenImages {
    /// Those among the frames of a run. Which they are depends on the files alone: a run that goes on, and every worker, leaves out the same.
    ///
    /// # Errors
    /// [`Error::BrokenImages`] where they are too many for a mishap.
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

    /// None, unchecked.
    pub(crate) fn none(_: &[Dataset], _: &BTreeSet<FrameIndex>) -> Result<Self, Error> {
        Ok(Self::default())
    }

    /// Whether a frame's image can be read.
    pub(crate) fn is_whole(&self, frame: FrameIndex) -> bool {
        !self.frames.contains(&frame)
    }
}
