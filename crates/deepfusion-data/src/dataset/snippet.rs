//! Training samples: a frame, its neighbours, and the camera's motion between them.

use super::ego::NoMotion;
use crate::{Dataset, EgoMotion, Error, Result};
use std::collections::{HashMap, HashSet};

/// A neighbour of a target frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Source {
    /// Its number minus the target's, such as −1 or +1.
    pub offset: i32,
    /// Its index in [`Dataset::frames`].
    pub frame: usize,
    /// The camera's motion between the target and this frame.
    pub motion: EgoMotion,
}

/// A training sample: one target and its sources, in the order of the requested offsets.
#[derive(Debug, Clone, PartialEq)]
pub struct Snippet {
    /// The target's index in [`Dataset::frames`].
    pub target: usize,
    /// Its sources.
    pub sources: Vec<Source>,
}

impl Dataset {
    /// The snippets of the selected frames that have every neighbour in `offsets`, ordered by number. Each
    /// snippet has consecutive numbers, valid time stamps, known ego-motion, and a mean speed of at least
    /// `min_speed_mps` in every pair. `[1]` gives the two-frame sample (t, t + 1).
    ///
    /// # Errors
    /// [`Error::Offsets`]; [`Error::Missing`] or [`Error::NoTrack`] without times, speeds or the camera's
    /// mount; and, if no snippet is left, [`Error::OneFrame`], [`Error::Standing`] or [`Error::NoPairs`].
    pub fn snippets(&self, offsets: &[i32], min_speed_mps: f64) -> Result<Vec<Snippet>> {
        self.snippets_apart(offsets, 0.0, min_speed_mps)
    }

    /// Like [`Self::snippets`], but an offset counts steps of at least `frame_distance_m` metres of camera motion: the
    /// source at offset n is the first frame that is at least |n| frames and |n| × `frame_distance_m` metres away. This is
    /// for slow drives, whose consecutive frames differ by less than a pixel. With 0 only frames are counted.
    ///
    /// # Errors
    /// Those of [`Self::snippets`].
    pub fn snippets_apart(
        &self,
        offsets: &[i32],
        frame_distance_m: f64,
        min_speed_mps: f64,
    ) -> Result<Vec<Snippet>> {
        let distinct: HashSet<_> = offsets.iter().collect();
        if offsets.is_empty() || offsets.contains(&0) || distinct.len() != offsets.len() {
            return Err(Error::Offsets {
                offsets: offsets.to_vec(),
            });
        }
        if let [only] = self.frames() {
            return Err(Error::OneFrame {
                drive: self.name().to_owned(),
                frame: only.number,
            });
        }
        let ego = self.ego()?;
        let numbers = self.frames().iter().enumerate();
        let index_of: HashMap<u64, usize> = numbers.map(|(i, f)| (f.number, i)).collect();
        let (mut no_neighbour, mut bad_time, mut no_motion) = (0, 0, 0);
        let (mut standing, mut fastest_mps) = (0, 0.0_f64);
        let mut snippets = Vec::new();
        'targets: for &target in self.selected() {
            let number = self.frames()[target].number;
            let mut sources = Vec::with_capacity(offsets.len());
            for &offset in offsets {
                let least_m = f64::from(offset.unsigned_abs()) * frame_distance_m;
                let mut offset = offset;
                let source = loop {
                    let neighbour = number.checked_add_signed(i64::from(offset));
                    let Some(&frame) = neighbour.and_then(|n| index_of.get(&n)) else {
                        no_neighbour += 1;
                        continue 'targets;
                    };
                    let motion = match ego.between(self.frames(), target, frame) {
                        Ok(motion) => motion,
                        Err(NoMotion::Time) => {
                            bad_time += 1;
                            continue 'targets;
                        }
                        Err(NoMotion::Speed) => {
                            no_motion += 1;
                            continue 'targets;
                        }
                    };
                    // A larger step does not help if the distance is NaN or infinite.
                    if !motion.distance_m.is_finite() {
                        no_motion += 1;
                        continue 'targets;
                    }
                    // A pair that is too slow is dropped below, so do not search on while the vehicle stands still.
                    if motion.distance_m >= least_m || motion.speed_mps < min_speed_mps {
                        break Source {
                            offset,
                            frame,
                            motion,
                        };
                    }
                    offset += offset.signum();
                };
                sources.push(source);
            }
            let slowest = sources.iter().map(|s| s.motion.speed_mps);
            let slowest = slowest.fold(f64::INFINITY, f64::min);
            if slowest < min_speed_mps {
                standing += 1;
                fastest_mps = fastest_mps.max(slowest);
                continue;
            }
            snippets.push(Snippet { target, sources });
        }
        if !snippets.is_empty() {
            return Ok(snippets);
        }
        let drive = self.name().to_owned();
        Err(if standing > 0 {
            Error::Standing {
                drive,
                pairs: standing,
                fastest_mps,
                min_speed_mps,
            }
        } else {
            Error::NoPairs {
                drive,
                targets: self.selected().len(),
                offsets: offsets.to_vec(),
                frame_distance_m,
                no_neighbour,
                bad_time,
                no_motion,
            }
        })
    }
}

/// Splits one drive's snippets, in order, into those for training and the last `fraction` for
/// validation. Training snippets that share a frame with a validation snippet are left out, so that the
/// validation frames are unseen. A single snippet is used for training.
#[must_use]
pub fn hold_out(mut snippets: Vec<Snippet>, fraction: f64) -> (Vec<Snippet>, Vec<Snippet>) {
    let held = (snippets.len() as f64 * fraction.clamp(0.0, 1.0)).ceil() as usize;
    let held = held.min(snippets.len().saturating_sub(1));
    let validation = snippets.split_off(snippets.len() - held);
    let frames = |s: &Snippet| -> Vec<usize> {
        std::iter::once(s.target)
            .chain(s.sources.iter().map(|source| source.frame))
            .collect()
    };
    let seen: HashSet<usize> = validation.iter().flat_map(frames).collect();
    let shares = |s: &Snippet| frames(s).iter().any(|f| seen.contains(f));
    // If the drive is so short that nothing would be left for training, keep the snippets that share frames.
    if snippets.iter().any(|s| !shares(s)) {
        snippets.retain(|s| !shares(s));
    }
    (snippets, validation)
}
