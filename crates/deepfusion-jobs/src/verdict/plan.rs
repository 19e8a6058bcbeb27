//! Chooses the frames to measure, and the earlier frames that they are compared with.

use std::collections::{HashMap, HashSet};

use deepfusion_data::Dataset;
use deepfusion_eval::verdict::NoCertificate;
use deepfusion_geometry::Se3;

use super::Unseen;
use crate::drives::first_of_drive;

/// Distances in metres from a frame to the earlier ones that it is compared with: near points move enough over the first, far ones over the
/// last.
const WAYS_M: [f64; 3] = [0.6, 2.5, 7.0];
/// A distance this many times longer than wanted is too long: the frames are too far apart.
const TOO_LONG: f64 = 4.0;
/// Largest turn between two frames, radians.
const TURN: f64 = 0.2;
/// Number of earlier frames that are tried.
const BEFORE: usize = 60;
/// Length of a block, in metres travelled.
const BLOCK_M: f64 = 10.0;
/// Largest number of frames in a block.
const TARGETS: usize = 4;

/// A frame to measure.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// Its index.
    pub frame: usize,
    /// The vehicle's speed, m/s.
    pub speed_mps: f64,
    /// The earlier frames, nearest first, each with the measured motion from this frame's camera to theirs.
    pub sources: Vec<(usize, Se3)>,
}

/// The frames of some metres of road.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Index of the data set.
    pub dataset: usize,
    /// The frames in order.
    pub targets: Vec<Target>,
}

/// The frames to measure.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plan {
    /// The blocks along each drive.
    pub blocks: Vec<Block>,
    /// Why there are no blocks.
    pub nothing: Option<NoCertificate>,
}

impl Plan {
    /// Number of frames to measure.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.blocks.iter().map(|b| b.targets.len()).sum()
    }

    /// The data sets whose blocks count for the certificate: the first camera used of each drive. Another camera sees the same road at the
    /// same time, and its blocks would wrongly count as independent.
    pub(super) fn certifying(&self, datasets: &[Dataset]) -> HashSet<usize> {
        let drives = first_of_drive(datasets);
        let mut first = HashMap::new();
        for block in &self.blocks {
            first.entry(drives[block.dataset]).or_insert(block.dataset);
        }
        first.into_values().collect()
    }

    pub(super) fn all_seen(&self) -> bool {
        self.nothing == Some(NoCertificate::AllSeen)
    }
}

/// Divides the drives' unseen frames into blocks of ten metres, and takes at most `most` of them, evenly.
#[must_use]
pub fn plan(datasets: &[Dataset], unseen: &Unseen, most: usize) -> Plan {
    let mut nothing = NoCertificate::MotionUnknown;
    let mut blocks = Vec::new();
    for (number, dataset) in datasets.iter().enumerate() {
        if dataset.track().is_none() || !dataset.yaw_known() {
            continue;
        }
        if nothing == NoCertificate::MotionUnknown {
            nothing = NoCertificate::NoMovement;
        }
        let fresh = |frame: usize| match unseen {
            Unseen::Except(seen) => !seen.contains(&(number, frame)),
            Unseen::All | Unseen::NotKnown => true,
        };
        for stretch in dataset.stretches() {
            let moving = Targets::of(dataset, &stretch);
            let before = moving.0.len();
            let kept: Vec<(f64, Target)> = moving
                .0
                .into_iter()
                .filter(|(_, target)| fresh(target.frame))
                .collect();
            if before > 0 && kept.is_empty() {
                nothing = NoCertificate::AllSeen;
            }
            blocks.extend(in_blocks(number, kept));
        }
    }
    let blocks = evenly(blocks, most);
    Plan {
        nothing: blocks.is_empty().then_some(nothing),
        blocks,
    }
}

/// Frames of a section that can be measured, with the distance travelled up to each.
struct Targets(Vec<(f64, Target)>);

impl Targets {
    fn of(dataset: &Dataset, stretch: &[usize]) -> Self {
        let mut way = 0.0;
        let mut targets = Vec::new();
        for (place, &frame) in stretch.iter().enumerate().skip(1) {
            let Some(step) = dataset.camera_motion(frame, stretch[place - 1]) else {
                continue;
            };
            way += step.translation().norm();
            let earlier = &stretch[place.saturating_sub(BEFORE)..place];
            let sources = sources(dataset, frame, earlier);
            if !sources.is_empty() {
                let speed_mps = dataset.frames()[frame].speed_mps.map_or(f64::NAN, f64::abs);
                targets.push((
                    way,
                    Target {
                        frame,
                        speed_mps,
                        sources,
                    },
                ));
            }
        }
        Self(targets)
    }
}

/// For each distance in [`WAYS_M`], the latest frame that is at least so far behind.
fn sources(dataset: &Dataset, frame: usize, earlier: &[usize]) -> Vec<(usize, Se3)> {
    let mut found: Vec<(usize, Se3)> = Vec::new();
    let mut wanted = WAYS_M.iter().peekable();
    for &source in earlier.iter().rev() {
        // From the target's camera to the source's.
        let Some(motion) = dataset.camera_motion(source, frame) else {
            break;
        };
        let way = motion.translation().norm();
        if motion.angle() > TURN {
            break;
        }
        let Some(&&least) = wanted.peek() else {
            break;
        };
        if way >= least {
            if way > TOO_LONG * least.max(1.0) {
                break;
            }
            found.push((source, motion));
            while wanted.peek().is_some_and(|least| way >= **least) {
                wanted.next();
            }
        }
    }
    found
}

/// Divides targets into blocks of ten metres, and thins them.
fn in_blocks(dataset: usize, targets: Vec<(f64, Target)>) -> Vec<Block> {
    let number = |way: f64| (way / BLOCK_M) as u64;
    let chunks = targets.chunk_by(|a, b| number(a.0) == number(b.0));
    chunks
        .map(|chunk| {
            let chunk = chunk.iter().map(|(_, target)| target.clone()).collect();
            Block {
                dataset,
                targets: evenly(chunk, TARGETS),
            }
        })
        .collect()
}

/// At most `most` of the items, evenly from the first to the last.
fn evenly<T>(items: Vec<T>, most: usize) -> Vec<T> {
    let n = items.len();
    if n <= most {
        return items;
    }
    let mut wanted = (0..most).map(|i| (2 * i + 1) * n / (2 * most)).peekable();
    let kept = items.into_iter().enumerate().filter(|(i, _)| {
        let keep = wanted.peek() == Some(i);
        if keep {
            wanted.next();
        }
        keep
    });
    kept.map(|(_, item)| item).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_data::{Cameras, OpenOptions};
    use deepfusion_sim::{SimConfig, Simulation, write_kitti};
    use std::ops::ControlFlow;

    #[test]
    fn only_one_of_a_drives_cameras_certifies() {
        let at = tempfile::tempdir().unwrap();
        let simulation = Simulation::new(&SimConfig {
            frames: 3,
            width: 160,
            height: 96,
            scan_every: 0,
            stereo_baseline_m: 0.5,
            ..SimConfig::default()
        })
        .unwrap();
        let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
        let drive = write_kitti(&simulation, at.path(), &mut go_on).unwrap();
        let options = OpenOptions {
            camera: Cameras::Both,
            ..OpenOptions::default()
        };
        let datasets = Dataset::open(&drive, &options).unwrap();
        assert_eq!(first_of_drive(&datasets), [0, 0]);
        let certifying = |of: [usize; 4]| {
            let block = |dataset| Block {
                dataset,
                targets: Vec::new(),
            };
            let blocks = of.map(block).into();
            let plan = Plan {
                blocks,
                nothing: None,
            };
            plan.certifying(&datasets)
        };
        assert_eq!(certifying([0, 0, 1, 1]), HashSet::from([0]));
        // Training saw all of the first.
        assert_eq!(certifying([1; 4]), HashSet::from([1]));
    }

    #[test]
    fn items_are_chosen_evenly() {
        assert_eq!(evenly((0..10).collect(), 3), [1, 5, 8]);
        assert_eq!(evenly(vec![1, 2], 3), [1, 2]);
        assert_eq!(evenly((0..7).collect(), 7).len(), 7);
    }
}
