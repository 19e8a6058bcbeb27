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

/// What can go wrong with work over recordings and folders.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A folder or pattern without images.
    #[error("{input}: no image (.png, .jpg, .jpeg) there")]
    NoImages {
        /// What was given.
        input: String,
    },
    /// A point cloud without a camera.
    #[error("a point cloud needs the camera's intrinsics, and the model knows none")]
    NoCamera,
    /// The error of a prediction asked for of a network, or an engine, that does not say it.
    #[error("this network, or the engine that runs it, does not say how sure it is of its depth")]
    NoUncertainty,
    /// Pictures of a network's layers, without what shows these.
    #[error("pictures of the network's layers are asked for, and nothing shows what these do")]
    NoLayers,
    /// A pattern of file names that cannot be one.
    #[error(transparent)]
    Pattern(#[from] glob::PatternError),
    /// Intrinsics that cannot be the image's.
    #[error("the intrinsics do not fit the image: {0}")]
    Camera(UnfitCamera),
    /// The same of one image among others.
    #[error("{}: {source}", path.display())]
    CameraOf {
        /// The image.
        path: PathBuf,
        /// Why it cannot be its camera, or what is wrong with the file that says it.
        source: Box<Error>,
    },
    /// A topic of bags that is not named as one.
    #[error("setting `data.topics`: {text}: {problem}")]
    NoTopic {
        /// What stands in the configuration.
        text: String,
        /// What is wrong with it.
        problem: NoNamedTopic,
    },
    /// A split of which not everything could be used, where everything has to be.
    #[error("{}: {found} of its {} {what}", split.display(), count_of(*expected, "frame"))]
    Incomplete {
        /// The split file.
        split: PathBuf,
        /// Frames that could be used.
        found: usize,
        /// Frames that the file lists.
        expected: usize,
        /// What those have that could be.
        what: &'static str,
        /// How many of the others are of a camera that was not opened.
        of_other_camera: usize,
    },
    /// No frame of a recording has both labels and the depth asked for.
    #[error("{}: no frame has the depth that was asked for", path.display())]
    NothingToMeasure {
        /// The recording.
        path: PathBuf,
    },
    /// Ground truth without names, and not an array for each frame.
    #[error(
        "{} of ground truth without names for {}",
        count_of(*found, "array"),
        count_of(*expected, "frame")
    )]
    StackLength {
        /// How many arrays there are.
        found: usize,
        /// How many frames are evaluated.
        expected: usize,
    },
    /// An image whose path is no text, as JSON needs it.
    #[error("{}: its path is not UTF-8, and the JSON beside its outputs has to name it", path.display())]
    NotText {
        /// The image.
        path: PathBuf,
    },
    /// Something that would be overwritten.
    #[error("{}: already exists", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A file of KITTI's object frames cannot be read.
    #[error("{}: {problem}", path.display())]
    ObjectFrame {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: crate::labelled::ObjectFrameProblem,
    },
    /// Settings of the perception that cannot be read.
    #[error("{}: {problem}", path.display())]
    PerceptionFile {
        /// The file.
        path: PathBuf,
        /// What the parser says.
        problem: deepfusion_model::TomlProblem,
    },
    /// Settings of the perception that contradict one another.
    #[error("{}: {source}", path.display())]
    PerceptionSettings {
        /// The file.
        path: PathBuf,
        /// In what.
        source: deepfusion_perception::Error,
    },
    /// A frame of an earlier live run.
    #[error("{}: already exists", path.display())]
    LiveFrameExists {
        /// The file.
        path: PathBuf,
    },
    /// An output that another run made, or this one of another image.
    #[error("{}: already exists, {why}", path.display())]
    Stale {
        /// The sidecar.
        path: PathBuf,
        /// In what it differs.
        why: StaleReason,
    },
    /// A shard of a job beside shards of another.
    #[error("{}: the shards of this folder were begun with {why}", path.display())]
    OtherJob {
        /// The other shard's manifest.
        path: PathBuf,
        /// In what it differs.
        why: OtherJob,
    },
    /// A shard that another process works on.
    #[error("{}: another run is at work on shard {shard} there", folder.display())]
    Busy {
        /// The output folder.
        folder: PathBuf,
        /// The shard.
        shard: Shard,
    },
    /// A folder that another process writes into.
    #[error("{}: another run is at work there", folder.display())]
    FolderBusy {
        /// The output folder.
        folder: PathBuf,
    },
    /// What is kept beside a network cannot be read.
    #[error("{}", path.display())]
    Kept {
        /// The file, or the network's name.
        path: PathBuf,
        /// Why not.
        source: toml::de::Error,
    },
    /// Factors of intervals that cannot be read, or cannot be such.
    #[error("{}", path.display())]
    KeptFactors {
        /// The file, or the network's name.
        path: PathBuf,
        /// Why not.
        source: Box<deepfusion_eval::Error>,
    },
    /// Encoders without a depth network.
    #[error("{}: only its encoders were ever trained: there is no depth to pack", path.display())]
    NothingToPack {
        /// The checkpoint.
        path: PathBuf,
    },
    /// A network that is to count as one that saw no real image, and did.
    #[error(
        "{} learned from {}, which is real: drives of {}",
        run.display(), recording.display(), layout.label()
    )]
    SawReal {
        /// The run, which may be one that the network began from or is the mean of.
        run: PathBuf,
        /// The recording.
        recording: PathBuf,
        /// Whose drives it is or has.
        layout: DatasetKind,
    },
    /// Networks whose weights have no mean.
    #[error("{}: {why}", path.display())]
    NoMean {
        /// The network that does not fit the first.
        path: PathBuf,
        /// Why not.
        why: NoMean,
    },
    /// A folder for something new that is not empty.
    #[error("{}: is not empty", path.display())]
    Occupied {
        /// The folder.
        path: PathBuf,
    },
    /// Shares of a mean that cannot be such.
    #[error(
        "{} for {}: one positive number for each is needed",
        count_of(*found, "share"), count_of(*networks, "network")
    )]
    Shares {
        /// How many there are.
        found: usize,
        /// How many networks.
        networks: usize,
    },
    /// A packed network where a run is needed.
    #[error("{}: is packed already", path.display())]
    PackedAlready {
        /// What was given.
        path: PathBuf,
    },
    /// A network of which no convolution bears int8.
    #[error(
        "int8: even one convolution alone changes depth by more than {} % on average",
        100.0 * most_deviation
    )]
    NothingInInt8 {
        /// How far depth may differ from that in f32: mean |ln|.
        most_deviation: f64,
    },
    /// A network inside the program, whose card nobody can write to.
    #[error("{name}: is embedded in the program, and calibrated there")]
    EmbeddedNetwork {
        /// Its name.
        name: String,
    },
    /// Something of a card that TOML has no form for.
    #[error("{what}")]
    NoTomlForm {
        /// What, in a sentence.
        what: &'static str,
        /// Why not.
        source: toml::ser::Error,
    },
    /// A device whose backend was not compiled in.
    #[error("this build has no `{device}` backend")]
    NoBackend {
        /// The backend's name, which is that of its feature.
        device: &'static str,
    },
    /// A device that this machine does not have.
    #[error("no device `{device}`: this machine has {count} of the `{backend}` backend")]
    NoSuchDevice {
        /// As it was given.
        device: String,
        /// Its backend.
        backend: &'static str,
        /// How many devices that has here.
        count: usize,
    },
    /// An engine for processors on another device.
    #[error("only Burn computes on other devices than the processor")]
    OnlyOnCpu,
    /// A precision that an engine does not have.
    #[error("only the fused engine, on the processor, computes in {}", precision.name())]
    OnlyFused {
        /// What was asked for.
        precision: Precision,
    },
    /// A library for another engine.
    #[error("a library of ONNX Runtime is given, and another engine runs the network")]
    OnlyOrt,
    /// Burn, in a build without it.
    #[error("Burn, and with it any device but the processor, is left out of this build")]
    NoFramework,
    /// An embedded network that is not the one a configuration began from.
    #[cfg(feature = "train")]
    #[error(
        "the embedded network `{name}` is another one than this configuration began from: SHA-256 {found}, not {expected}"
    )]
    OtherStart {
        /// Its name.
        name: String,
        /// Of the weights in this build.
        found: String,
        /// In the configuration.
        expected: String,
    },
    /// A run, or a table of runs, that another process writes.
    #[cfg(feature = "train")]
    #[error("{}: another process is at work there", folder.display())]
    AtWork {
        /// The folder.
        folder: PathBuf,
    },
    /// A folder for an adapted network that is not new.
    #[cfg(feature = "train")]
    #[error("{}: already exists", path.display())]
    AdaptedBefore {
        /// The folder.
        path: PathBuf,
    },
    /// A folder for an adapted network that no other one can be renamed to.
    #[cfg(feature = "train")]
    #[error("{}: is a mount point, which a finished run cannot take the place of", path.display())]
    MountPoint {
        /// The folder.
        path: PathBuf,
    },
    /// An interrupted adaptation with other settings.
    #[cfg(feature = "train")]
    #[error("{}: already exists", path.display())]
    OtherSettings {
        /// Its folder.
        path: PathBuf,
    },
    /// Drives that a network cannot be judged on, and so not adapted to.
    #[cfg(feature = "train")]
    #[error("{frames} of the frames that are held out can show how good a network is, too few to adapt by{}", because(*why))]
    NotJudged {
        /// How many.
        frames: usize,
        /// Why there are none.
        why: Option<deepfusion_eval::verdict::NoCertificate>,
    },
    /// A folder without a network to go back to.
    #[cfg(feature = "train")]
    #[error("{}: no network was adapted there, or it is undone already", path.display())]
    NotAdapted {
        /// The folder.
        path: PathBuf,
    },
    /// What an ablation keeps of a run cannot be read.
    #[cfg(feature = "train")]
    #[error("{}: not a result of an ablation", path.display())]
    NoResult {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: serde_json::Error,
    },
    /// A process that is to check a device cannot be started.
    #[cfg(feature = "train")]
    #[error("cannot start the process that checks the device")]
    CheckNotStarted {
        /// What the system says.
        source: std::io::Error,
    },
    /// Nobody can say how a process ended that checked a device.
    #[cfg(feature = "train")]
    #[error("cannot wait for the process that checks the device")]
    CheckNotEnded {
        /// What the system says.
        source: std::io::Error,
    },
    /// A file that was written and cannot be read again.
    #[cfg(feature = "train")]
    #[error("cannot read {} back", path.display())]
    ReadBack {
        /// Where it would have gone.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// An exported file that is not the network.
    #[cfg(feature = "train")]
    #[error(
        "{}: {engine} is {deviation:.1e} away from the network (max |difference| / max |value|), more than {:.0e}; not kept",
        path.display(),
        deepfusion_onnx::check::TOLERANCE
    )]
    Deviates {
        /// The file that would have been written.
        path: PathBuf,
        /// What ran it.
        engine: String,
        /// How far it is from the network.
        deviation: f64,
    },
    /// Something asked of a run that goes on, and that is not what it has.
    #[cfg(feature = "train")]
    #[error(transparent)]
    Contradiction(Contradiction),
    /// A run that has made more steps than it is asked for.
    #[cfg(feature = "train")]
    #[error("the run has made {} already, more than the {asked} that it is to have", count_of(*made, "step"))]
    FewerSteps {
        /// Steps that it has made.
        made: usize,
        /// Steps of the whole run, as asked for.
        asked: usize,
    },
    /// Recordings, or something of how they are opened, that are asked for beside a configuration's data sets.
    #[cfg(feature = "train")]
    #[error(
        "setting `{setting}`: expected none beside data.sets: each set has its own, found both"
    )]
    BesideSets {
        /// What is asked for.
        setting: Setting,
    },
    /// Something that has no TOML form.
    #[error(transparent)]
    Toml(#[from] toml::ser::Error),
    /// Something that has no JSON form.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A picture that cannot be encoded.
    #[error(transparent)]
    Picture(#[from] image::ImageError),
    /// A map whose values do not fill it.
    #[error(transparent)]
    Shape(#[from] ndarray::ShapeError),
    /// A map that cannot be written as NumPy's.
    #[error(transparent)]
    Npy(#[from] ndarray_npy::WriteNpyError),
    /// A video.
    #[error(transparent)]
    Video(#[from] deepfusion_video::Error),
    /// A picture.
    #[error(transparent)]
    Images(#[from] deepfusion_images::Error),
    /// A recording, or another file.
    #[error(transparent)]
    Data(#[from] deepfusion_data::Error),
    /// A scan.
    #[error(transparent)]
    Cloud(#[from] deepfusion_geometry::cloud::Error),
    /// A file of poses.
    #[error(transparent)]
    PoseFile(#[from] deepfusion_eval::odometry::PoseFileError),
    /// Poses that cannot be a camera's path.
    #[error(transparent)]
    Track(#[from] deepfusion_eval::odometry::TrackError),
    /// A board in pictures.
    #[error(transparent)]
    Calibrate(#[from] deepfusion_calibrate::Error),
    /// What was measured.
    #[error(transparent)]
    Eval(#[from] deepfusion_eval::Error),
    /// An evaluation that is kept beside a run.
    #[error(transparent)]
    Compare(#[from] deepfusion_eval::compare::Error),
    /// A configuration or a run's folder.
    #[error(transparent)]
    Model(#[from] deepfusion_model::Error),
    /// A packed network.
    #[error(transparent)]
    Weights(#[from] deepfusion_weights::Error),
    /// A simulated street.
    #[error(transparent)]
    Simulator(#[from] deepfusion_sim::Error),
    /// A network, or what runs it.
    #[error(transparent)]
    Runtime(#[from] deepfusion_runtime::Error),
    /// An ONNX file, or what runs it.
    #[cfg(feature = "train")]
    #[error(transparent)]
    Onnx(#[from] deepfusion_onnx::Error),
    /// Weights of another project.
    #[cfg(feature = "train")]
    #[error(transparent)]
    Network(#[from] deepfusion_model::NetworkError),
    /// Samples that cannot be learned from.
    #[cfg(feature = "train")]
    #[error(transparent)]
    Train(#[from] deepfusion_train::Error),
    /// A picture that cannot be drawn.
    #[error(transparent)]
    Render(#[from] deepfusion_render::Error),
    /// A user's model that tells things apart.
    #[error(transparent)]
    Instances(#[from] deepfusion_instances::Error),
    /// A depth image that nothing can be found in.
    #[error(transparent)]
    Perception(#[from] deepfusion_perception::Error),
}

/// A result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// For networks of other input sizes: what the runtime says stays its own.
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
