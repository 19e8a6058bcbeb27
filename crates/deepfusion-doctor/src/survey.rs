//! The data that the checks examine: a sample of a drive's frames, small and grey, and how they move.

use super::flow::{Flow, flow};
use super::image_quality::ImageQuality;
use super::shared_error::SharedError;
use deepfusion_data::{Dataset, Ego, EgoMotion, grey_image};
use deepfusion_geometry::Intrinsics;
use deepfusion_motion::GreyImage;
use deepfusion_motion::{GreyFrame, ImageMotion};
use rayon::prelude::*;

/// Most frames that are read; a longer drive is sampled in short runs, evenly.
const MOST_FRAMES: usize = 240;
/// Most pairs whose points are followed.
const MOST_FLOWS: usize = 120;
/// Time between frames that are compared, in seconds: neighbours at 25 a second hardly differ.
const PAIR_S: f64 = 0.1;
/// Width of the small images, in pixels.
const WIDTH: u32 = 320;
/// Width of the images whose motion as a whole is measured, in pixels.
const COARSE_WIDTH: u32 = 160;

/// A sample of a drive.
#[derive(Debug)]
pub(crate) struct Survey<'a> {
    pub(crate) dataset: &'a Dataset,
    /// The frames, in the order of time.
    pub(crate) frames: Vec<SeenFrame>,
    /// Pairs some 0.1 s apart.
    pub(crate) pairs: Vec<SeenPair>,
    /// Frames of the drive from the first to the second of a pair: 1 at 10 a second, 2 at 25.
    pub(crate) stride: usize,
    /// The camera of the small images.
    pub(crate) intrinsics: Intrinsics,
    /// Numbers of frames whose image cannot be read, and why.
    pub(crate) unreadable: Vec<(u64, SharedError<deepfusion_data::Error>)>,
}

/// A frame that was read.
#[derive(Debug)]
pub(crate) struct SeenFrame {
    /// Index in [`Dataset::frames`].
    pub(crate) index: usize,
    pub(crate) number: u64,
    pub(crate) small: GreyImage,
    pub(crate) quality: ImageQuality,
    coarse: Option<GreyFrame>,
}

/// Two frames that were read.
#[derive(Debug)]
pub(crate) struct SeenPair {
    /// Index of the later one in [`Survey::frames`].
    pub(crate) later: usize,
    /// The later camera's motion from the earlier one, as the vehicle measured it: its `source_from_target` is
    /// `earlier_from_later`.
    pub(crate) motion: Option<EgoMotion>,
    /// How the picture moved as a whole.
    pub(crate) image: Option<ImageMotion>,
    /// How its points moved, in pixels of the small images.
    pub(crate) flow: Vec<Flow>,
}

impl<'a> Survey<'a> {
    /// Reads the sample.
    pub(crate) fn of(dataset: &'a Dataset) -> Self {
        Self::times(dataset, 1)
    }

    /// Reads a sample of up to this many times the usual size.
    pub(crate) fn times(dataset: &'a Dataset, factor: usize) -> Self {
        Self::sized(dataset, (factor * MOST_FRAMES, factor * MOST_FLOWS))
    }

    /// Reads a sample of up to this many frames, and follows the points of up to this many pairs.
    pub(crate) fn sized(dataset: &'a Dataset, (most_frames, most_flows): (usize, usize)) -> Self {
        let stride = stride(dataset);
        let wanted = sample(dataset.frames().len(), stride, most_frames);
        let k = dataset.intrinsics(0);
        let (width, height) = small_size(&k);
        let read: Vec<_> = wanted
            .into_par_iter()
            .map(|index| SeenFrame::read(dataset, index, width, height))
            .collect();
        let (mut frames, mut unreadable) = (Vec::new(), Vec::new());
        for frame in read {
            match frame {
                Ok(frame) => frames.push(frame),
                Err(problem) => unreadable.push(problem),
            }
        }
        let mut survey = Self {
            dataset,
            frames,
            pairs: Vec::new(),
            stride,
            intrinsics: k.resized(width, height),
            unreadable,
        };
        survey.pairs = survey.compare(most_flows);
        survey
    }

    /// Neighbours in the drive that were both read: their indices in [`Self::frames`].
    pub(crate) fn neighbours(&self) -> impl Iterator<Item = (&SeenFrame, &SeenFrame)> {
        let pairs = self.frames.windows(2).map(|w| (&w[0], &w[1]));
        pairs.filter(|(a, b)| a.number + 1 == b.number)
    }

    /// Mean speed between two frames by index, m/s.
    pub(crate) fn speed_mps(&self, earlier: usize, later: usize) -> Option<f64> {
        let ego = self.dataset.ego().ok()?.level();
        let motion = ego.between(self.dataset.frames(), later, earlier).ok()?;
        Some(motion.speed_mps)
    }

    fn compare(&self, most_flows: usize) -> Vec<SeenPair> {
        let stride = self.stride as u64;
        let mut found = Vec::new();
        let mut from = 0;
        while from < self.frames.len() {
            let later = (from + self.stride).min(self.frames.len() - 1);
            if self.frames[later].number == self.frames[from].number + stride {
                found.push((from, later));
                from = later;
            } else {
                from += 1;
            }
        }
        let thin = found.len().div_ceil(most_flows).max(1);
        let pair = |(i, (earlier, later)): (usize, (usize, usize))| {
            let (a, b) = (&self.frames[earlier], &self.frames[later]);
            let ego = self.dataset.ego().ok().map(Ego::level);
            let motion =
                ego.and_then(|ego| ego.between(self.dataset.frames(), b.index, a.index).ok());
            let coarse = a.coarse.as_ref().zip(b.coarse.as_ref());
            SeenPair {
                later,
                motion,
                image: coarse.and_then(|(a, b)| ImageMotion::between(a, b)),
                flow: match i % thin {
                    0 => flow(&a.small, &b.small),
                    _ => Vec::new(),
                },
            }
        };
        found.into_par_iter().enumerate().map(pair).collect()
    }
}

impl SeenFrame {
    fn read(
        dataset: &Dataset,
        index: usize,
        width: u32,
        height: u32,
    ) -> Result<Self, (u64, SharedError<deepfusion_data::Error>)> {
        let frame = &dataset.frames()[index];
        let image = dataset
            .load_image(index)
            .map_err(|e| (frame.number, SharedError::from(e)))?;
        let small = grey_image(&image, width, height);
        let coarse = frame.time_s.and_then(|time_s| {
            let width = COARSE_WIDTH.min(width);
            let height = (image.height() * width).div_ceil(image.width()).max(1);
            let grey = grey_image(&image, width, height);
            GreyFrame::new(time_s, grey.width, grey.height, &grey.data).ok()
        });
        Ok(Self {
            index,
            number: frame.number,
            quality: ImageQuality::of(&image),
            small,
            coarse,
        })
    }
}

/// Width and height at which this camera's images are examined, pixels.
pub(crate) fn small_size(k: &Intrinsics) -> (u32, u32) {
    let width = WIDTH.min(k.width).max(1);
    (width, (k.height * width).div_ceil(k.width).max(1))
}

/// How many frames further the other one of a pair is.
fn stride(dataset: &Dataset) -> usize {
    let mut intervals: Vec<f64> = dataset
        .frames()
        .windows(2)
        .filter_map(|w| Some((w[1].time_s? - w[0].time_s?) / (w[1].number - w[0].number) as f64))
        .filter(|dt| *dt > 0.0)
        .collect();
    intervals.sort_by(f64::total_cmp);
    let Some(usual) = intervals.get(intervals.len() / 2) else {
        return 1;
    };
    ((PAIR_S / usual).round() as usize).clamp(1, 5)
}

/// The indices that are read: all, or runs of `stride + 1`, evenly over the drive.
fn sample(frames: usize, stride: usize, most: usize) -> Vec<usize> {
    if frames <= most {
        return (0..frames).collect();
    }
    let run = stride + 1;
    let runs = most / run;
    let start = |i: usize| i * (frames - run) / (runs - 1);
    let mut indices: Vec<usize> = (0..runs).flat_map(|i| start(i)..start(i) + run).collect();
    indices.dedup();
    indices.sort_unstable();
    indices.dedup();
    indices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_drive_is_sampled_in_runs() {
        assert_eq!(sample(5, 1, 240), [0, 1, 2, 3, 4]);
        let indices = sample(10_000, 2, 240);
        assert_eq!(indices.len(), 240);
        assert_eq!(&indices[..3], [0, 1, 2]);
        assert_eq!(indices.last(), Some(&9_999));
        assert!(indices.windows(2).all(|w| w[0] < w[1]));
        assert!(sample(241, 5, 240).windows(2).all(|w| w[0] < w[1]));
    }
}
