#[cfg(feature = "train")]
use deepfusion_hint::count_of;
use deepfusion_hint::{Hint, system_hint};

use super::{Error, NoMean, UnfitCamera};

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::NoImages { .. } => Some(
                "give images, a folder of them, or a pattern such as 'drive/*.png'; a recording is given by its own folder or file".into(),
            ),
            Self::Camera(UnfitCamera::OtherSize { .. }) => Some(
                "give the calibration of images of this size; a camera of this machine gives images of another with ?size=1920x1080 behind its name".into(),
            ),
            Self::Camera(_) => {
                Some("give fx,fy,cx,cy in pixels of the input image, at its own size".into())
            }
            // A file has the size that it has.
            Self::CameraOf { source, .. }
                if matches!(**source, Self::Camera(UnfitCamera::OtherSize { .. })) =>
            {
                Some("give the calibration of images of this size, or the camera's field of view, which is the same at any size".into())
            }
            Self::CameraOf { source, .. } => source.hint(),
            Self::NoTopic { problem, .. } => {
                Some(problem.hint().unwrap_or("set `data.topics` so in the configuration".into()))
            }
            Self::Incomplete {
                of_other_camera: others @ 1..,
                ..
            } => Some(format!(
                "open both cameras: {others} of the split's frames are of the other one"
            )),
            Self::Incomplete { .. } => {
                Some("give the folder that holds every drive that the split names".into())
            }
            Self::NothingToMeasure { .. } => Some(
                "exact depth is the simulator's (proj_depth), scans are in velodyne_points; without either nothing says which boxes are seen".into(),
            ),
            Self::StackLength { .. } => Some(
                "give an .npz whose arrays have the frames' names, or an array for each frame, in the order of the split's lines".into(),
            ),
            Self::NotText { .. } => Some("rename it, or the folder that it is in".into()),
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
            Self::FolderBusy { .. } => Some("wait for it, or choose another folder".into()),
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
            Self::FewerSteps { made, .. } => Some(format!(
                "steps and epochs count from the run's beginning: give more than {}",
                count_of(*made, "step")
            )),
            #[cfg(feature = "train")]
            Self::AtWork { .. } => {
                Some("wait for it, stop it first, or choose another folder".into())
            }
            #[cfg(feature = "train")]
            Self::AdaptedBefore { .. } => {
                Some("choose another folder: what was adapted before stays".into())
            }
            #[cfg(feature = "train")]
            Self::MountPoint { .. } => Some("choose a folder in it".into()),
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
