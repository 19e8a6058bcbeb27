use deepfusion_hint::{Hint, count_of};
use std::path::PathBuf;

mod samples;
mod stopped;

pub(crate) use self::samples::MOST_SIGMA_SHARE;
use self::samples::named;
pub use self::samples::{NoStereo, SampleProblem, SharedFrames, Skipped};
pub use self::stopped::{LoaderProblem, ThreadsProblem, WorkersProblem};

/// What can go wrong in training.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no training sample.
    #[error("no training sample in {data}: {reason}")]
    NoSamples {
        /// Which data it is, in words.
        data: String,
        /// Why there is no sample.
        reason: SampleProblem,
    },
    /// The configuration requires the vehicle's turns, and they are not known for a drive.
    #[error(
        "{drive}: no yaw rate was recorded, and this configuration requires the vehicle's turns"
    )]
    NoYawRate {
        /// The drive.
        drive: String,
    },
    /// A drive's second camera was requested as a view, and cannot be used as one.
    #[error("{drive}: {why}")]
    NoStereo {
        /// The drive.
        drive: String,
        /// Why not.
        why: NoStereo,
    },
    /// Odometry was requested from a run without PoseNet.
    #[error("{}: this run has no PoseNet", run.display())]
    NoPoseNet {
        /// The run, or a checkpoint of it.
        run: PathBuf,
    },
    /// A recording to learn depth from has no depth.
    #[error("{drive}: no frame has depth, and `learn` requires it")]
    NoDepth {
        /// The drive.
        drive: String,
    },
    /// Many or all images of a drive cannot be read.
    #[error("{drive}: {broken} of {} cannot be read: {}", count_of(*of, "image"), named(images, *broken))]
    BrokenImages {
        /// The drive.
        drive: String,
        /// How many of its images cannot be read.
        broken: usize,
        /// How many images it has.
        of: usize,
        /// The first of them, each with its error.
        images: Vec<String>,
    },
    /// Validation frames are also training frames: their loss would measure memorisation.
    #[error(
        "validation frames are also training frames: {}",
        frames_by_drive(shared)
    )]
    SharedFrames {
        /// The drives with such frames.
        shared: Vec<SharedFrames>,
    },
    /// A camera is to be learned, and a recording has a known camera.
    #[error("{drive}: its camera is known, but the run is to learn one")]
    CameraKnown {
        /// The drive.
        drive: String,
    },
    /// A camera is to be learned, and the images have two sizes, so there are two cameras.
    #[error(
        "a run learns one camera, of images of one size: {} has {}x{}, {} has {}x{}",
        drives[0], sizes[0].0, sizes[0].1, drives[1], sizes[1].0, sizes[1].1
    )]
    SeveralCameras {
        /// Two drives with images of different sizes.
        drives: [String; 2],
        /// Width and height of their images.
        sizes: [(u32, u32); 2],
    },
    /// A loss is infinite or NaN.
    #[error("step {step}: the loss term `{term}` is {value}; frames {frames}")]
    NotFinite {
        /// The step, counted from 1.
        step: usize,
        /// The term's name.
        term: &'static str,
        /// Its value.
        value: f64,
        /// The drives and frame numbers of the batch.
        frames: String,
    },
    /// Many gradients in a row were not finite.
    #[error(
        "{count} steps in a row had a gradient that is not finite, the last at step {step}; frames {frames}"
    )]
    GradientsNotFinite {
        /// Number of such steps in a row.
        count: usize,
        /// The last such step.
        step: usize,
        /// The drives and frame numbers of its batch.
        frames: String,
    },
    /// The device or this processor does not support a precision.
    #[error(
        "setting `precision`: expected \"f32\" (bf16 needs a processor with AVX512-BF16 or AMX, or a GPU with tensor cores for it), \
         found {found}"
    )]
    Precision {
        /// The requested precision.
        found: &'static str,
    },
    /// The loader's threads could not be started.
    #[error("cannot start the threads that load images: {reason}")]
    Threads {
        /// The system's error.
        #[source]
        reason: ThreadsProblem,
    },
    /// The image loader stopped early.
    #[error("the image loader stopped: {reason}")]
    Loader {
        /// Why it stopped.
        reason: LoaderProblem,
    },
    /// Several workers cannot train together.
    #[error("worker {rank} of {count}: {reason}")]
    Workers {
        /// This worker, from 0.
        rank: usize,
        /// How many there are.
        count: usize,
        /// What went wrong between them.
        #[source]
        reason: WorkersProblem,
    },
    /// The configuration requires held-out samples, and there are none.
    #[error("no sample is held out for validation")]
    NoValidation,
    /// An error of a recording.
    #[error(transparent)]
    Data(Box<deepfusion_data::Error>),
    /// An error of the simulator that renders training views.
    #[error(transparent)]
    Simulator(#[from] deepfusion_sim::Error),
    /// An error of the configuration, the run's folder, or the networks' weights.
    #[error(transparent)]
    Model(#[from] deepfusion_model::Error),
}

impl From<deepfusion_data::Error> for Error {
    fn from(error: deepfusion_data::Error) -> Self {
        Self::Data(Box::new(error))
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::NoSamples { .. } => Some(
                "give consecutive frames of a moving camera, with time stamps and speeds"
                    .into(),
            ),
            Self::NoYawRate { .. } => Some(
                "give a yaw rate (yaw_rate_radps in speed.csv, or imu.csv), or train with view_motion auto, distance or posenet and \
                 loss.rotation = 0; without data.measured_turns_only, images that show the turns well also do"
                    .into(),
            ),
            Self::NoStereo { .. } => Some(
                "give both cameras of a drive, like KITTI's image_02 and image_03, or train without stereo"
                    .into(),
            ),
            Self::NoDepth { .. } => Some(
                "give RGB-D folders, drives with LiDAR scans or simulated drives, or set learn = \"self\", which needs speeds instead of \
                 depth"
                    .into(),
            ),
            Self::BrokenImages { .. } => Some(
                "copy or download the recording again, or leave it out; only a few broken images are skipped"
                    .into(),
            ),
            Self::SharedFrames { .. } => Some(
                "validate on other drives or frames; if none are given, the end of each training drive is held out"
                    .into(),
            ),
            Self::CameraKnown { .. } => Some(
                "train without assumed_camera.learn, or leave out this recording; a known camera is better than a learned one"
                    .into(),
            ),
            Self::SeveralCameras { .. } => {
                Some("train on the recordings of one camera, at one size".into())
            }
            Self::NotFinite { .. } | Self::GradientsNotFinite { .. } => Some(
                "check the frames named above or lower the learning rate, then resume from the last good checkpoint"
                    .into(),
            ),
            Self::NoPoseNet { .. } => Some(
                "give a run with a PoseNet: this one learned from the vehicle's motion alone (`freeze` names `pose`) or is an imported \
                 depth network; a new run that starts from it has one unless it freezes `pose`"
                    .into(),
            ),
            Self::Precision { .. } => Some("set `precision` to \"f32\" in the configuration".into()),
            Self::Threads { .. } => Some(
                "raise the system's limits for this user's threads (`ulimit -u`) or memory"
                    .into(),
            ),
            Self::Loader { .. } => Some(
                "this is a bug: please report it with the lines above; the run can be resumed from its last checkpoint"
                    .into(),
            ),
            Self::Workers { .. } => Some(
                "give all workers the same configuration, recordings and starting weights; after a failure restart all of them and resume \
                 from the last checkpoint"
                    .into(),
            ),
            Self::NoValidation => Some(
                "give longer drives or validation drives; `validation_share = 0` trains without validation and without a `best` checkpoint"
                    .into(),
            ),
            Self::Data(error) => error.hint(),
            Self::Simulator(error) => error.hint(),
            Self::Model(error) => error.hint(),
        }
    }
}

impl Error {
    pub(crate) fn io(path: &std::path::Path, action: &'static str, source: std::io::Error) -> Self {
        deepfusion_model::Error::io(path, action, source).into()
    }
}

impl From<deepfusion_nn::Error> for Error {
    fn from(error: deepfusion_nn::Error) -> Self {
        Self::Model(error.into())
    }
}

/// The number of shared targets of each drive that has some.
fn frames_by_drive(shared: &[SharedFrames]) -> String {
    let drives = shared.iter().filter(|s| s.targets > 0);
    let drives = drives.map(|s| format!("{} of {}", s.targets, s.drive));
    drives.collect::<Vec<_>>().join(", ")
}
