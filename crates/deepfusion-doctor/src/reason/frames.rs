//! What is wrong with the frames' times, and with whether the vehicle moved.

use deepfusion_hint::count_of;

/// What is wrong with the frames' times, and with whether the vehicle moved.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FramesReason {
    /// A frame was taken before the one before it.
    #[error("its time stamp is {by_s:.3} s earlier than that of the frame before")]
    Backwards {
        /// Time between the two, seconds.
        by_s: f64,
    },
    /// Frames are missing.
    #[error(
        "{} {} missing at {rate_hz:.1} frames a second, the first before frame {first}: pairs across a gap are left out or move further than others",
        count_of(*lost, "frame"),
        if *lost == 1 { "is" } else { "are" }
    )]
    Lost {
        /// Number of missing frames.
        lost: usize,
        /// The camera's usual rate, 1/s.
        rate_hz: f64,
        /// The number of the first frame that has a gap before it.
        first: u64,
    },
    /// The vehicle's motion is unknown at some times.
    #[error(
        "the vehicle's motion is unknown for {unknown_s:.1} s in {}, the first from frame {first}: its speed has gaps there, and no pair of these frames can be used for training",
        count_of(*stretches, "stretch")
    )]
    UnknownMotion {
        /// Total time without a motion, seconds.
        unknown_s: f64,
        /// Number of stretches without a motion.
        stretches: usize,
        /// The number of the first frame of the first stretch.
        first: u64,
    },
    /// The log of speeds does not cover all images.
    #[error("the speeds {}: frames beyond them cannot be used for training", beside(*before_s, *after_s))]
    BesideLog {
        /// Time from the first image to the first speed, seconds.
        before_s: f64,
        /// Time from the last speed to the last image, seconds.
        after_s: f64,
    },
    /// Frames repeat the frame before.
    #[error(
        "{repeated} of {} {} the frame before while the vehicle moves, the first of them frame {first}: training on {} teaches that everything is infinitely far",
        count_of(*frames, "frame"),
        if *repeated == 1 { "repeats" } else { "repeat" },
        if *repeated == 1 { "it" } else { "them" }
    )]
    Repeated {
        /// Number of repeated frames.
        repeated: usize,
        /// Number of frames that were compared.
        frames: u32,
        /// The number of the first repeated frame.
        first: u64,
    },
    /// The vehicle stands in much of the drive.
    #[error(
        "the vehicle stands in {standing} of {pairs} pairs, longest in frames {from} to {to}: they show no parallax and are left out of training"
    )]
    Standing {
        /// Pairs in which it stands.
        standing: usize,
        /// All pairs of neighbouring frames.
        pairs: usize,
        /// The first frame of the longest stretch.
        from: u64,
        /// The last frame of the longest stretch.
        to: u64,
    },
}

impl FramesReason {
    /// What to do about it.
    pub(super) fn hint(&self) -> &'static str {
        match self {
            Self::Backwards { .. } => "sort the frames by time, or correct the time stamps",
            Self::Lost { .. } => {
                "find out where the recorder drops frames (disk, network, queue length), or cut the recording there"
            }
            Self::UnknownMotion { .. } => {
                "find out where the recorder drops messages of the speed, or cut the recording there"
            }
            Self::BesideLog { .. } => {
                "start the log before the camera and stop it after; if you did, the clocks differ: shift the images with start_s in dataset.toml, or clock.camera_ahead_s"
            }
            Self::Repeated { .. } => {
                "record at the camera's own rate, and remove the repeated frames with their time stamps"
            }
            Self::Standing { .. } => {
                "cut out the parts where the vehicle stands, or check whether the speed signal drops out"
            }
        }
    }
}

/// Says by how much the speeds begin after the first image and end before the last.
fn beside(before_s: f64, after_s: f64) -> String {
    let begin = format!("begin {before_s:.1} s after the first image");
    let end = format!("end {after_s:.1} s before the last");
    match (before_s > 0.0, after_s > 0.0) {
        (true, true) => format!("{begin} and {end}"),
        (true, false) => begin,
        _ => format!("{end} image"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timing_problems_have_their_messages() {
        let lost = |lost| FramesReason::Lost {
            lost,
            rate_hz: 10.04,
            first: 31,
        };
        let unknown = |stretches| FramesReason::UnknownMotion {
            unknown_s: 1.64,
            stretches,
            first: 40,
        };
        for (reason, message) in [
            (
                FramesReason::Backwards { by_s: 0.1 },
                "its time stamp is 0.100 s earlier than that of the frame before",
            ),
            (
                lost(1),
                "1 frame is missing at 10.0 frames a second, the first before frame 31: pairs across a gap are left out or move further \
                 than others",
            ),
            (
                lost(12),
                "12 frames are missing at 10.0 frames a second, the first before frame 31: pairs across a gap are left out or move further \
                 than others",
            ),
            (
                FramesReason::BesideLog {
                    before_s: 0.0,
                    after_s: 0.8,
                },
                "the speeds end 0.8 s before the last image: frames beyond them cannot be used for training",
            ),
            (
                FramesReason::BesideLog {
                    before_s: 0.5,
                    after_s: 0.8,
                },
                "the speeds begin 0.5 s after the first image and end 0.8 s before the last: frames beyond them cannot be used for training",
            ),
            (
                unknown(1),
                "the vehicle's motion is unknown for 1.6 s in 1 stretch, the first from frame 40: its speed has gaps there, and no pair of \
                 these frames can be used for training",
            ),
            (
                unknown(2),
                "the vehicle's motion is unknown for 1.6 s in 2 stretches, the first from frame 40: its speed has gaps there, and no pair of \
                 these frames can be used for training",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }

    #[test]
    fn frames_that_show_no_motion_are_counted() {
        let repeated = |repeated| FramesReason::Repeated {
            repeated,
            frames: 9,
            first: 5,
        };
        for (reason, message) in [
            (
                repeated(1),
                "1 of 9 frames repeats the frame before while the vehicle moves, the first of them frame 5: training on it teaches that everything is infinitely far",
            ),
            (
                repeated(3),
                "3 of 9 frames repeat the frame before while the vehicle moves, the first of them frame 5: training on them teaches that everything is infinitely far",
            ),
            (
                FramesReason::Standing {
                    standing: 30,
                    pairs: 99,
                    from: 10,
                    to: 25,
                },
                "the vehicle stands in 30 of 99 pairs, longest in frames 10 to 25: they show no parallax and are left out of training",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }
}
