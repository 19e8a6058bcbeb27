use deepfusion_hint::{Hint, count_of};
use std::path::PathBuf;

mod samples;
mod stopped;

pub(crate) use self::samples::MOST_SIGMA_SHARE;
use self::samples::named;
pub use self::samples::{NoStereo, SampleProblem, SharedFrames, Skipped};
pub use self::stopped::{LoaderProblem, ThreadsProblem, WorkersProblem};

/// What can go wrong while learning.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Nothing to learn from.
    #[error("no training sample in {data}: {reason}")]
    NoSamples {
        /// The data that was given.
        data: String,
        /// Why nothing is left.
        reason: SampleProblem,
    },
    /// A configuration that reads how the car turned, and a drive that does not say.
    #[error(
        "{drive}: how the car turned is not known, and this configuration reads it: no yaw rate was recorded"
    )]
    NoYawRate {
        /// The drive.
        drive: String,
    },
    /// A drive whose other camera is wanted as a view, and cannot be one.
    #[error("{drive}: {why}")]
    NoStereo {
        /// The drive.
        drive: String,
        /// Why not.
        why: NoStereo,
    },
    /// A run that was asked for a vehicle's motion as its PoseNet sees it.
    #[error("{}: this run has no PoseNet", run.display())]
    NoPoseNet {
        /// The run, or a checkpoint of it.
        run: PathBuf,
    },
    /// A recording to learn depth from that has none.
    #[error("{drive}: no frame has depth, and `learn` asks for it")]
    NoDepth {
        /// The drive.
        drive: String,
    },
    /// A drive of which many images cannot be read, or all.
    #[error("{drive}: {broken} of {} cannot be read: {}", count_of(*of, "image"), named(images, *broken))]
    BrokenImages {
        /// The drive.
        drive: String,
        /// How many of its images cannot be read.
        broken: usize,
        /// How many images it has.
        of: usize,
        /// The first of them, each with what is wrong with it.
        images: Vec<String>,
    },
    /// Validation frames that are learned from: their loss would say how well they are known by heart.
    #[error("validation frames are training frames: {}", frames_by_drive(shared))]
    SharedFrames {
        /// The drives with such frames.
        shared: Vec<SharedFrames>,
    },
    /// A camera is to be learned, and a recording says what it is.
    #[error("{drive}: it says what its camera is, and the camera is to be learned")]
    CameraKnown {
        /// The drive.
        drive: String,
    },
    /// A camera is to be learned, and images of two sizes are of two cameras.
    #[error(
        "one camera is learned, of images of one size: {} has {}x{}, {} has {}x{}",
        drives[0], sizes[0].0, sizes[0].1, drives[1], sizes[1].0, sizes[1].1
    )]
    SeveralCameras {
        /// Two drives.
        drives: [String; 2],
        /// Width and height of their images.
        sizes: [(u32, u32); 2],
    },
    /// A loss that is not a number.
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
    /// Gradients that stay non-finite.
    #[error(
        "{count} steps in a row had a gradient that is not finite, the last at step {step}; frames {frames}"
    )]
    GradientsNotFinite {
        /// How many.
        count: usize,
        /// The last such step.
        step: usize,
        /// The drives and frame numbers of its batch.
        frames: String,
    },
    /// A precision that the device, or this processor, does not have.
    #[error(
        "setting `precision`: expected \"f32\" (bf16 needs a processor with AVX512-BF16 or AMX, or a GPU with tensor cores for it), \
         found {found}"
    )]
    Precision {
        /// The one asked for.
        found: &'static str,
    },
    /// The loader's threads could not be started.
    #[error("no threads to load images with: {reason}")]
    Threads {
        /// What the system says.
        #[source]
        reason: ThreadsProblem,
    },
    /// The loader's thread died.
    #[error("the loader of images stopped: {reason}")]
    Loader {
        /// What it died of.
        reason: LoaderProblem,
    },
    /// Workers that learn together, and cannot.
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
    /// Samples should be held out, and none are.
    #[error("no sample is held out to validate on")]
    NoValidation,
    /// The recording.
    #[error(transparent)]
    Data(Box<deepfusion_data::Error>),
    /// The simulator, of which views are learned from.
    #[error(transparent)]
    Simulator(#[from] deepfusion_sim::Error),
    /// The configuration, the run's folder, or the networks' weights.
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
                "training needs consecutive frames of a moving camera, with time stamps and speeds"
                    .into(),
            ),
            Self::NoYawRate { .. } => Some(
                "turns are taken from the images where these show enough of them, unless data.measured_turns_only is set; else train with \
                 view_motion auto, distance or posenet and loss.rotation = 0, or give a yaw rate: yaw_rate_radps in speed.csv, or imu.csv"
                    .into(),
            ),
            Self::NoStereo { .. } => Some(
                "stereo needs both cameras of a drive, as KITTI's image_02 and image_03; without it one camera and the speeds will do"
                    .into(),
            ),
            Self::NoDepth { .. } => Some(
                "learn = \"self\" needs no depth but a speed; RGB-D folders, drives with LiDAR scans and simulated drives \
                 have depth"
                    .into(),
            ),
            Self::BrokenImages { .. } => Some(
                "fetch the recording again, or leave it out; a few such images would be done without"
                    .into(),
            ),
            Self::SharedFrames { .. } => Some(
                "validate on other drives or other frames, or on none that are named: the end of each drive \
                 is held out then"
                    .into(),
            ),
            Self::CameraKnown { .. } => Some(
                "a camera that is known is better than one that is learned: train without assumed_camera.learn, or leave this recording out"
                    .into(),
            ),
            Self::SeveralCameras { .. } => {
                Some("train on the recordings of one camera, at one size".into())
            }
            Self::NotFinite { .. } | Self::GradientsNotFinite { .. } => Some(
                "the last good checkpoint is kept; look at the frames named above, or lower the \
                 learning rate, and resume"
                    .into(),
            ),
            Self::NoPoseNet { .. } => Some(
                "it learned by the vehicle's motion alone (`freeze` names `pose`), or is an imported depth network; a run that starts from it \
                 without that has a PoseNet, too"
                    .into(),
            ),
            Self::Precision { .. } => Some("set `precision` so in the configuration".into()),
            Self::Threads { .. } => Some(
                "the system allows this user too few threads or too little memory; see `ulimit -u`"
                    .into(),
            ),
            Self::Loader { .. } => Some(
                "this is a fault of the program: please report it with the lines above; what was saved is whole, and \
                 the run can be resumed from there"
                    .into(),
            ),
            Self::Workers { .. } => Some(
                "all workers need the same configuration, recordings and start; after a failure start all of them again, and resume: the last \
                 checkpoint is whole"
                    .into(),
            ),
            Self::NoValidation => Some(
                "give longer drives or some to validate on; `validation_share = 0` trains without validation \
                 and chooses no `best`"
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

/// Each drive that has such frames, with their number.
fn frames_by_drive(shared: &[SharedFrames]) -> String {
    let drives = shared.iter().filter(|s| s.targets > 0);
    let drives = drives.map(|s| format!("{} of {}", s.targets, s.drive));
    drives.collect::<Vec<_>>().join(", ")
}
