use std::path::PathBuf;

use deepfusion_data::{DatasetKind, NoNamedTopic};
use deepfusion_hint::{Hint, count_of, system_hint};
use deepfusion_records::Difference;
use deepfusion_runtime::Precision;

use crate::bulk::Shard;

mod camera;
#[cfg(feature = "train")]
mod contradiction;

pub use self::camera::UnfitCamera;
#[cfg(feature = "train")]
pub use self::contradiction::{Contradiction, RequestedValue, RunHas, Setting};

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
    /// A pattern of file names that is none.
    #[error(transparent)]
    Pattern(#[from] glob::PatternError),
    /// Intrinsics that cannot be the image's.
    #[error("the intrinsics do not fit the image: {0}")]
    Camera(UnfitCamera),
    /// The same of one image among others.
    #[error("{}", path.display())]
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
    /// What is kept beside a network cannot be read.
    #[error("{}", path.display())]
    Kept {
        /// The file, or the network's name.
        path: PathBuf,
        /// Why not.
        source: toml::de::Error,
    },
    /// Factors of intervals that are none.
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
    /// Shares of a mean that are none.
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
    /// A folder for an adapted network that is not new.
    #[cfg(feature = "train")]
    #[error("{}: already exists", path.display())]
    AdaptedBefore {
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
    /// A path that is none.
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

/// Why what stands beside an image is not this job's.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum StaleReason {
    /// It is no sidecar.
    NoSidecar,
    /// It is of another image.
    OtherImage(PathBuf),
    /// It was made in another way.
    MadeWith(Difference),
    /// The image is another one now.
    ImageChanged(PathBuf),
    /// Its recording has another calibration now.
    Calibration,
}

impl std::fmt::Display for StaleReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoSidecar => write!(f, "and does not say how it was made"),
            Self::OtherImage(image) => write!(f, "made from {}", image.display()),
            Self::MadeWith(what) => write!(f, "made with {what}"),
            Self::Calibration => write!(f, "made with another calibration of its recording"),
            Self::ImageChanged(image) => write!(f, "and {} has changed since", image.display()),
        }
    }
}

/// In what another job differs.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum OtherJob {
    /// It has other images: so many, and this one so many.
    Inputs(usize, usize),
    /// It makes them in another way.
    MadeWith(Difference),
}

impl std::fmt::Display for OtherJob {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Inputs(others, ours) => {
                write!(f, "{}, not these {ours}", count_of(*others, "other input"))
            }
            Self::MadeWith(what) => write!(f, "{what}"),
        }
    }
}

/// Why there is no mean of weights.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoMean {
    /// There is no run to put the mean into.
    Packed,
    /// Its depth network never learned.
    EncodersOnly,
    /// It learned its camera, which belongs to its weights.
    LearnedCamera,
    /// A tensor that one network lacks, or that has another shape.
    Layers {
        /// The tensor's name.
        name: String,
    },
    /// A setting by which the same weights mean something else.
    Setting {
        /// The key, or what it is.
        key: String,
        /// Of this network.
        found: String,
        /// Of the first one.
        first: String,
    },
}

impl std::fmt::Display for NoMean {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Packed => write!(f, "is packed, and the first network must be a run's"),
            Self::EncodersOnly => write!(f, "only its encoders were ever trained"),
            Self::LearnedCamera => write!(
                f,
                "learned its camera with its weights, so that they have no mean with others"
            ),
            Self::Layers { name } => write!(
                f,
                "has other layers than the first network: {name} is not the same in both"
            ),
            Self::Setting { key, found, first } => {
                write!(f, "{key} is {found}, and {first} in the first network")
            }
        }
    }
}

/// For networks of other input sizes: what the runtime says stays its own.
impl From<Error> for deepfusion_runtime::EngineProblem {
    fn from(error: Error) -> Self {
        match error {
            Error::Runtime(error) => error.into(),
            error => Self::Runner(Box::new(error)),
        }
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::NoImages { .. } => Some(
                "give images, a folder of them, or a pattern such as 'drive/*.png'; a recording is given by its own folder or file".into(),
            ),
            Self::Camera(_) => {
                Some("give fx,fy,cx,cy in pixels of the input image, at its own size".into())
            }
            Self::CameraOf { source, .. } => source.hint(),
            Self::NoTopic { problem, .. } => {
                Some(problem.hint().unwrap_or("set `data.topics` so in the configuration".into()))
            }
            Self::Incomplete { .. } => {
                Some("give the folder that holds every drive that the split names".into())
            }
            Self::NothingToMeasure { .. } => Some(
                "exact depth is the simulator's (proj_depth), scans are in velodyne_points; without either nothing says which boxes are seen".into(),
            ),
            Self::StackLength { .. } => Some(
                "give an .npz whose arrays have the frames' names, or an array for each frame, in the order of the split's lines".into(),
            ),
            Self::Exists { .. } | Self::Stale { .. } => {
                Some("allow overwriting, or choose another folder".into())
            }
            Self::PerceptionFile { .. } => Some(
                "mend what is named there, or leave the line out: each setting has a default".into(),
            ),
            Self::PerceptionSettings { source, .. } => source.hint(),
            Self::ObjectFrame { .. } => Some("correct the file, or leave its frame out".into()),
            Self::LiveFrameExists { .. } => {
                Some("allow replacing all of the folder's live frames, or choose another folder".into())
            }
            Self::OtherJob { .. } => {
                Some("start every shard with the same inputs and options, or choose another folder".into())
            }
            Self::Busy { .. } => Some("wait for it, or share the work among shards".into()),
            Self::NothingToPack { .. } => Some("train from it first".into()),
            Self::SawReal { .. } => Some(
                "pack it without saying that it saw simulated images alone".into(),
            ),
            Self::NoMean { why, .. } => Some(
                match why {
                    NoMean::Packed => {
                        "give a run's folder first: its settings are those of the mean"
                    }
                    NoMean::EncodersOnly => "train from it first",
                    NoMean::LearnedCamera => {
                        "train both with a known camera, for example the one that this run learned"
                    }
                    NoMean::Layers { .. } | NoMean::Setting { .. } => {
                        "take networks that were trained from the same one"
                    }
                }
                .into(),
            ),
            Self::Occupied { .. } => Some("choose a new folder".into()),
            Self::Shares { .. } => {
                Some("give one positive number for each network, in their order, such as 2,1".into())
            }
            Self::NothingInInt8 { .. } => {
                Some("allow more, or use bf16; what was calibrated before stays".into())
            }
            Self::EmbeddedNetwork { .. } => {
                Some("give a run's folder, or the network's file and card".into())
            }
            Self::PackedAlready { .. } => {
                Some("give the folder of the run that it was packed from".into())
            }
            #[cfg(feature = "train")]
            Self::OtherStart { .. } => Some(
                "take the version of the program that made the run, or remove init_sha256 from the file to begin from this one".into(),
            ),
            Self::NoBackend { device } => Some(format!(
                "build it with the feature `{device}`, or compute on the processor"
            )),
            Self::NoSuchDevice { count: 1.., .. } => Some(
                "they are counted from 0; without a number the backend takes the one that it prefers".into(),
            ),
            Self::NoSuchDevice { .. } => Some(
                "is the GPU's driver installed, and may this user open it? The processor computes the same".into(),
            ),
            Self::OnlyOnCpu => {
                Some("leave the engine to be chosen, or compute on the processor".into())
            }
            Self::OnlyFused { .. } => {
                Some("compute on the processor in the fused engine, or in f32".into())
            }
            Self::OnlyOrt => {
                Some("choose ONNX Runtime as the engine, or leave its library out".into())
            }
            Self::NoFramework => Some("build it with the feature `train`".into()),
            #[cfg(feature = "train")]
            Self::AdaptedBefore { .. } => {
                Some("choose another folder: what was adapted before stays".into())
            }
            #[cfg(feature = "train")]
            Self::OtherSettings { .. } => Some(
                "it was left by an adaptation with other settings: give those to go on with it, or remove it".into(),
            ),
            #[cfg(feature = "train")]
            Self::NotJudged { .. } => Some(
                "give longer drives with a speed, or hold more of them out; or train on from the network without this check".into(),
            ),
            #[cfg(feature = "train")]
            Self::NotAdapted { .. } => {
                Some("give the folder that the adapted network was written to".into())
            }
            #[cfg(feature = "train")]
            Self::ReadBack { source, .. }
            | Self::CheckNotStarted { source }
            | Self::CheckNotEnded { source } => Some(system_hint(source.kind()).into()),
            #[cfg(feature = "train")]
            Self::Deviates { .. } => {
                Some("this is a fault of the program or of the library that ran the file; please report it".into())
            }
            #[cfg(feature = "train")]
            Self::Contradiction(_) => {
                Some("leave it out to go on with the run, or start a new one in another folder".into())
            }
            #[cfg(feature = "train")]
            Self::BesideSets { .. } => {
                Some("leave it out, or change the data sets that it is for".into())
            }
            #[cfg(feature = "train")]
            Self::NoResult { .. } => Some("delete it to run this row again".into()),
            Self::NoCamera => Some("give fx, fy, cx, cy or a calibration".into()),
            Self::NoUncertainty => Some(
                "leave out sigma and confidence, or use a network trained with depth_net.uncertainty = true".into(),
            ),
            Self::NoLayers => Some(
                "leave out features; targets have none, and depth has them where a job is given what shows layers".into(),
            ),
            Self::Picture(image::ImageError::IoError(source))
            | Self::Npy(ndarray_npy::WriteNpyError::Io(source)) => {
                Some(system_hint(source.kind()).into())
            }
            Self::Json(error) => error.io_error_kind().map(|kind| system_hint(kind).into()),
            Self::Pattern(_)
            | Self::Picture(_)
            | Self::Shape(_)
            | Self::Npy(_)
            | Self::Kept { .. }
            | Self::NoTomlForm { .. }
            | Self::Toml(_) => None,
            Self::KeptFactors { source, .. } => source.hint(),
            Self::Video(error) => error.hint(),
            Self::Images(error) => error.hint(),
            Self::Data(error) => error.hint(),
            Self::Cloud(error) => error.hint(),
            Self::PoseFile(error) => error.hint(),
            Self::Track(error) => error.hint(),
            Self::Calibrate(error) => error.hint(),
            Self::Eval(error) => error.hint(),
            Self::Compare(error) => error.hint(),
            Self::Model(error) => error.hint(),
            Self::Runtime(error) => error.hint(),
            Self::Weights(error) => error.hint(),
            Self::Simulator(error) => error.hint(),
            #[cfg(feature = "train")]
            Self::Onnx(error) => error.hint(),
            #[cfg(feature = "train")]
            Self::Network(error) => error.hint(),
            #[cfg(feature = "train")]
            Self::Train(error) => error.hint(),
            Self::Render(error) => error.hint(),
            Self::Instances(error) => error.hint(),
            Self::Perception(error) => error.hint(),
        }
    }
}

#[cfg(feature = "train")]
fn because(why: Option<deepfusion_eval::verdict::NoCertificate>) -> String {
    why.map_or_else(String::new, |why| format!(": {why}"))
}
