use std::path::PathBuf;

use deepfusion_data::{DatasetKind, NoNamedTopic};
use deepfusion_hint::count_of;
use deepfusion_runtime::Precision;

use crate::bulk::Shard;

#[cfg(feature = "train")]
mod contradiction;
mod hint;
mod reasons;

#[cfg(feature = "train")]
pub use self::contradiction::{Contradiction, RequestedValue, RunHas, Setting};
pub use self::reasons::{NoMean, OtherJob, StaleReason, UnfitCamera};

/// What can go wrong when working with recordings and folders.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A folder or pattern without images.
    #[error("{input}: no images (.png, .jpg, .jpeg) found")]
    NoImages {
        /// The folder or pattern as given.
        input: String,
    },
    /// A point cloud without a camera.
    #[error("a point cloud needs the camera's intrinsics, which are unknown")]
    NoCamera,
    /// Uncertainty was requested, but this network or engine does not predict it.
    #[error("this network, or the engine that runs it, does not predict uncertainty")]
    NoUncertainty,
    /// Pictures of a network's layers were requested, but there is nothing to show them.
    #[error("cannot make pictures of the network's layers: this job does not compute them")]
    NoLayers,
    /// An invalid pattern of file names.
    #[error(transparent)]
    Pattern(#[from] glob::PatternError),
    /// Intrinsics that do not fit the image.
    #[error("the intrinsics do not fit the image: {0}")]
    Camera(UnfitCamera),
    /// Intrinsics that do not fit one image among others.
    #[error("{}: {source}", path.display())]
    CameraOf {
        /// Path of the image.
        path: PathBuf,
        /// Why the camera does not fit, or what is wrong with its file.
        source: Box<Error>,
    },
    /// An invalid topic of bags.
    #[error("setting `data.topics`: {text}: {problem}")]
    NoTopic {
        /// The text in the configuration.
        text: String,
        /// What is wrong with it.
        problem: NoNamedTopic,
    },
    /// A split of which all frames are needed, but not all could be used.
    #[error("{}: only {found} of {} {what}", split.display(), count_of(*expected, "frame"))]
    Incomplete {
        /// Path of the split file.
        split: PathBuf,
        /// Number of frames that could be used.
        found: usize,
        /// Number of frames that the file lists.
        expected: usize,
        /// What the usable frames have.
        what: &'static str,
        /// Number of other frames that belong to a camera that was not opened.
        of_other_camera: usize,
    },
    /// No frame of a recording has both labels and the requested depth.
    #[error("{}: no frame has the requested depth", path.display())]
    NothingToMeasure {
        /// Path of the recording.
        path: PathBuf,
    },
    /// Ground truth without names whose number of arrays is not the number of frames.
    #[error(
        "{} of ground truth without names, but {}",
        count_of(*found, "array"),
        count_of(*expected, "frame")
    )]
    StackLength {
        /// Number of arrays.
        found: usize,
        /// Number of frames to evaluate.
        expected: usize,
    },
    /// An image whose path is not text, as JSON needs it.
    #[error("{}: the path is not UTF-8, as needed for the JSON beside the outputs", path.display())]
    NotText {
        /// Path of the image.
        path: PathBuf,
    },
    /// A file that would be overwritten.
    #[error("{}: already exists", path.display())]
    Exists {
        /// Path of the file.
        path: PathBuf,
    },
    /// A file of KITTI's object frames that cannot be read.
    #[error("{}: {problem}", path.display())]
    ObjectFrame {
        /// Path of the file.
        path: PathBuf,
        /// What is wrong with it.
        problem: crate::labelled::ObjectFrameProblem,
    },
    /// Perception settings that cannot be read.
    #[error("{}: {problem}", path.display())]
    PerceptionFile {
        /// Path of the file.
        path: PathBuf,
        /// The parser's error.
        problem: deepfusion_model::TomlProblem,
    },
    /// Perception settings that contradict one another.
    #[error("{}: {source}", path.display())]
    PerceptionSettings {
        /// Path of the file.
        path: PathBuf,
        /// The contradiction.
        source: deepfusion_perception::Error,
    },
    /// A frame of an earlier live run.
    #[error("{}: already exists", path.display())]
    LiveFrameExists {
        /// Path of the file.
        path: PathBuf,
    },
    /// An output of another run, or of this run for another image.
    #[error("{}: already exists, {why}", path.display())]
    Stale {
        /// Path of the sidecar.
        path: PathBuf,
        /// How it differs.
        why: StaleReason,
    },
    /// A shard of one job beside shards of another.
    #[error("{}: the shards in this folder were started with {why}", path.display())]
    OtherJob {
        /// Path of the other shard's manifest.
        path: PathBuf,
        /// How the other job differs.
        why: OtherJob,
    },
    /// A shard that another process is working on.
    #[error("{}: another run is already working on shard {shard}", folder.display())]
    Busy {
        /// The output folder.
        folder: PathBuf,
        /// The shard.
        shard: Shard,
    },
    /// A folder that another process is writing to.
    #[error("{}: another run is already writing to this folder", folder.display())]
    FolderBusy {
        /// The output folder.
        folder: PathBuf,
    },
    /// A file beside a network that cannot be read.
    #[error("{}", path.display())]
    NetworkFile {
        /// Path of the file, or the network's name.
        path: PathBuf,
        /// The parser's error.
        source: toml::de::Error,
    },
    /// Interval factors that cannot be read, or that are invalid.
    #[error("{}", path.display())]
    IntervalFactors {
        /// Path of the file, or the network's name.
        path: PathBuf,
        /// What is wrong.
        source: Box<deepfusion_eval::Error>,
    },
    /// Trained encoders without a depth network.
    #[error("{}: only its encoders were trained: there is no depth network to pack", path.display())]
    NothingToPack {
        /// Path of the checkpoint.
        path: PathBuf,
    },
    /// A network that was trained on real images, but was said to be trained on simulated ones only.
    #[error(
        "{}: learned from {}, which is real ({})",
        run.display(), recording.display(), layout.label()
    )]
    SawReal {
        /// The run, which may be an ancestor of the given one.
        run: PathBuf,
        /// Path of the recording.
        recording: PathBuf,
        /// Layout of the recording.
        layout: DatasetKind,
    },
    /// Networks whose weights cannot be averaged.
    #[error("{}: {why}", path.display())]
    NoMean {
        /// The network that does not match the first.
        path: PathBuf,
        /// Why it does not match.
        why: NoMean,
    },
    /// A folder for a new output that is not empty.
    #[error("{}: the output folder is not empty", path.display())]
    Occupied {
        /// Path of the folder.
        path: PathBuf,
    },
    /// Invalid shares of a mean.
    #[error(
        "{} for {}: expected one positive number for each network",
        count_of(*found, "share"), count_of(*networks, "network")
    )]
    Shares {
        /// Number of shares.
        found: usize,
        /// Number of networks.
        networks: usize,
    },
    /// A packed network where a run is needed.
    #[error("{}: already packed", path.display())]
    PackedAlready {
        /// The network as given.
        path: PathBuf,
    },
    /// A network of which no convolution can be computed in int8.
    #[error(
        "int8: even a single convolution changes depth by more than {} % on average",
        100.0 * most_deviation
    )]
    NothingInInt8 {
        /// How far depth may differ from that in f32: mean |ln|.
        most_deviation: f64,
    },
    /// An embedded network, whose card cannot be changed.
    #[error("{name}: embedded networks cannot be calibrated again")]
    EmbeddedNetwork {
        /// The network's name.
        name: String,
    },
    /// A part of a card that cannot be written as TOML.
    #[error("{what}")]
    NoTomlForm {
        /// The part, as a message.
        what: &'static str,
        /// The serialiser's error.
        source: toml::ser::Error,
    },
    /// A device whose backend was not compiled in.
    #[error("this build has no `{device}` backend")]
    NoBackend {
        /// The backend's name, which is also its feature's name.
        device: &'static str,
    },
    /// A device that this machine does not have.
    #[error("no device `{device}`: the backend `{backend}` has {} on this machine", count_of(*count, "device"))]
    NoSuchDevice {
        /// The device as given.
        device: String,
        /// Its backend.
        backend: &'static str,
        /// Number of the backend's devices on this machine.
        count: usize,
    },
    /// An engine for processors, on another device.
    #[error("only Burn runs on devices other than the processor")]
    OnlyOnCpu,
    /// A precision that an engine does not have.
    #[error("only the fused engine on the processor computes in {}", precision.name())]
    OnlyFused {
        /// The requested precision.
        precision: Precision,
    },
    /// A library for an engine that was not chosen.
    #[error("an ONNX Runtime library is given, but another engine runs the network")]
    OnlyOrt,
    /// Burn, in a build without it.
    #[error("this build lacks Burn, which all devices except the processor need")]
    NoFramework,
    /// An embedded network that differs from the one a configuration started from.
    #[cfg(feature = "train")]
    #[error(
        "the embedded network `{name}` is not the one that this configuration started from: SHA-256 {found}, expected {expected}"
    )]
    OtherStart {
        /// The network's name.
        name: String,
        /// SHA-256 of the weights in this build.
        found: String,
        /// SHA-256 in the configuration.
        expected: String,
    },
    /// A run, or a table of runs, that another process is writing.
    #[cfg(feature = "train")]
    #[error("{}: another process is already writing to this folder", folder.display())]
    RunBusy {
        /// Path of the folder.
        folder: PathBuf,
    },
    /// A folder for an adapted network that already exists.
    #[cfg(feature = "train")]
    #[error("{}: already exists", path.display())]
    AdaptedBefore {
        /// Path of the folder.
        path: PathBuf,
    },
    /// A folder for an adapted network that cannot be replaced by a rename.
    #[cfg(feature = "train")]
    #[error("{}: is a mount point, which a finished run cannot replace", path.display())]
    MountPoint {
        /// Path of the folder.
        path: PathBuf,
    },
    /// An interrupted adaptation with other settings.
    #[cfg(feature = "train")]
    #[error("{}: already exists", path.display())]
    OtherSettings {
        /// Path of its folder.
        path: PathBuf,
    },
    /// Drives on which a network cannot be judged, so that it cannot be adapted to them.
    #[cfg(feature = "train")]
    #[error("only {} can be used to judge the network, too few to adapt it{}", count_of(*frames, "held-out frame"), because(*why))]
    NotJudged {
        /// Number of held-out frames that can be used.
        frames: usize,
        /// Why none can be used.
        why: Option<deepfusion_eval::verdict::NoCertificate>,
    },
    /// A folder without an adaptation that can be undone.
    #[cfg(feature = "train")]
    #[error("{}: no network was adapted here, or it was already undone", path.display())]
    NotAdapted {
        /// Path of the folder.
        path: PathBuf,
    },
    /// A result of an ablation that cannot be read.
    #[cfg(feature = "train")]
    #[error("{}: not a result of an ablation", path.display())]
    NoResult {
        /// Path of the file.
        path: PathBuf,
        /// The parser's error.
        source: serde_json::Error,
    },
    /// A process for checking a device that cannot be started.
    #[cfg(feature = "train")]
    #[error("cannot start the process that checks the device")]
    CheckNotStarted {
        /// The system's error.
        source: std::io::Error,
    },
    /// A process for checking a device whose end cannot be waited for.
    #[cfg(feature = "train")]
    #[error("cannot wait for the process that checks the device")]
    CheckNotEnded {
        /// The system's error.
        source: std::io::Error,
    },
    /// A written file that cannot be read back.
    #[cfg(feature = "train")]
    #[error("cannot read {} back", path.display())]
    ReadBack {
        /// The path that the file should have had.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// An exported file that computes something else than the network.
    #[cfg(feature = "train")]
    #[error(
        "{}: {engine} differs from the network by {deviation:.1e} (max |difference| / max |value|), expected at most {:.0e}; not kept",
        path.display(),
        deepfusion_onnx::check::TOLERANCE
    )]
    Deviates {
        /// The path that the file should have had.
        path: PathBuf,
        /// The engine that ran it.
        engine: String,
        /// Its relative difference from the network.
        deviation: f64,
    },
    /// A requested setting that contradicts the resumed run.
    #[cfg(feature = "train")]
    #[error(transparent)]
    Contradiction(Contradiction),
    /// A run that has already made more steps than requested.
    #[cfg(feature = "train")]
    #[error("the run has already made {}, more than the {asked} requested", count_of(*made, "step"))]
    FewerSteps {
        /// Number of steps that it has made.
        made: usize,
        /// Requested number of steps of the whole run.
        asked: usize,
    },
    /// Recordings, or settings for opening them, that were given in addition to a configuration's data sets.
    #[cfg(feature = "train")]
    #[error("setting `{setting}`: not allowed beside data.sets, where each set has its own")]
    BesideSets {
        /// The setting.
        setting: Setting,
    },
    /// A value that cannot be written as TOML.
    #[error(transparent)]
    Toml(#[from] toml::ser::Error),
    /// A value that cannot be written as JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A picture that cannot be encoded.
    #[error(transparent)]
    Picture(#[from] image::ImageError),
    /// A map whose values do not match its shape.
    #[error(transparent)]
    Shape(#[from] ndarray::ShapeError),
    /// A map that cannot be written as a NumPy file.
    #[error(transparent)]
    Npy(#[from] ndarray_npy::WriteNpyError),
    /// An error of a video.
    #[error(transparent)]
    Video(#[from] deepfusion_video::Error),
    /// An error of an image.
    #[error(transparent)]
    Images(#[from] deepfusion_images::Error),
    /// An error of a recording, or of another file.
    #[error(transparent)]
    Data(#[from] deepfusion_data::Error),
    /// An error of a scan.
    #[error(transparent)]
    Cloud(#[from] deepfusion_geometry::cloud::Error),
    /// An error of a file of poses.
    #[error(transparent)]
    PoseFile(#[from] deepfusion_eval::odometry::PoseFileError),
    /// Poses that are not a camera's trajectory.
    #[error(transparent)]
    Track(#[from] deepfusion_eval::odometry::TrackError),
    /// An error of a calibration.
    #[error(transparent)]
    Calibrate(#[from] deepfusion_calibrate::Error),
    /// An error of an evaluation.
    #[error(transparent)]
    Eval(#[from] deepfusion_eval::Error),
    /// An error of an evaluation saved beside a run.
    #[error(transparent)]
    Compare(#[from] deepfusion_eval::compare::Error),
    /// An error of a configuration or a run's folder.
    #[error(transparent)]
    Model(#[from] deepfusion_model::Error),
    /// An error of a packed network.
    #[error(transparent)]
    Weights(#[from] deepfusion_weights::Error),
    /// An error of the simulator.
    #[error(transparent)]
    Simulator(#[from] deepfusion_sim::Error),
    /// An error of a network, or of its engine.
    #[error(transparent)]
    Runtime(#[from] deepfusion_runtime::Error),
    /// An error of an ONNX file, or of its engine.
    #[cfg(feature = "train")]
    #[error(transparent)]
    Onnx(#[from] deepfusion_onnx::Error),
    /// An error of another project's weights.
    #[cfg(feature = "train")]
    #[error(transparent)]
    Network(#[from] deepfusion_model::NetworkError),
    /// An error of training.
    #[cfg(feature = "train")]
    #[error(transparent)]
    Train(#[from] deepfusion_train::Error),
    /// An error of drawing a picture.
    #[error(transparent)]
    Render(#[from] deepfusion_render::Error),
    /// An error of the user's segmentation model.
    #[error(transparent)]
    Instances(#[from] deepfusion_instances::Error),
    /// An error of the perception.
    #[error(transparent)]
    Perception(#[from] deepfusion_perception::Error),
}

/// A result with this crate's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// For networks of other input sizes: the runtime's own errors keep their type.
impl From<Error> for deepfusion_runtime::EngineProblem {
    fn from(error: Error) -> Self {
        match error {
            Error::Runtime(error) => error.into(),
            error => Self::Runner(Box::new(error)),
        }
    }
}

#[cfg(feature = "train")]
fn because(why: Option<deepfusion_eval::verdict::NoCertificate>) -> String {
    why.map_or_else(String::new, |why| format!(": {why}"))
}
