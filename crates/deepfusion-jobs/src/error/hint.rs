#[cfg(feature = "train")]
use deepfusion_hint::count_of;
use deepfusion_hint::{Hint, system_hint};

use super::{Error, NoMean, UnfitCamera};

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::NoImages { .. } => Some(
                "give images, a folder of images, a pattern such as 'drive/*.png', or a recording's folder or file".into(),
            ),
            Self::Camera(UnfitCamera::OtherSize { .. }) => Some(
                "give the calibration of images of this size, or append ?size=1920x1080 to the name of a local camera".into(),
            ),
            Self::Camera(_) => {
                Some("give fx,fy,cx,cy in pixels of the input image, at its own size".into())
            }
            // The size of a file's images cannot be changed.
            Self::CameraOf { source, .. }
                if matches!(**source, Self::Camera(UnfitCamera::OtherSize { .. })) =>
            {
                Some("give the calibration of images of this size, or the camera's field of view, which is the same at any size".into())
            }
            Self::CameraOf { source, .. } => source.hint(),
            Self::NoTopic { problem, .. } => {
                Some(problem.hint().unwrap_or("correct `data.topics` in the configuration".into()))
            }
            Self::Incomplete {
                of_other_camera: others @ 1..,
                ..
            } => Some(format!(
                "open both cameras: {others} of the split's frames belong to the other one"
            )),
            Self::Incomplete { .. } => {
                Some("give the folder that holds every drive that the split names".into())
            }
            Self::NothingToMeasure { .. } => Some(
                "give a recording with exact depth (proj_depth, from the simulator) or scans (velodyne_points)".into(),
            ),
            Self::StackLength { .. } => Some(
                "give an .npz with arrays named after the frames, or one array for each frame in the order of the split file".into(),
            ),
            Self::NotText { .. } => Some("rename the image or its folder".into()),
            Self::Exists { .. } | Self::Stale { .. } => {
                Some("allow overwriting, or choose another folder".into())
            }
            Self::PerceptionFile { .. } => Some(
                "correct the setting, or remove the line to use its default".into(),
            ),
            Self::PerceptionSettings { source, .. } => source.hint(),
            Self::ObjectFrame { .. } => Some("correct the file, or leave out its frame".into()),
            Self::LiveFrameExists { .. } => {
                Some("allow replacing all of the folder's live frames, or choose another folder".into())
            }
            Self::OtherJob { .. } => {
                Some("run every shard with the same inputs and options, or choose another folder".into())
            }
            Self::Busy { .. } => Some("wait for it to finish, or divide the work into shards".into()),
            Self::FolderBusy { .. } => Some("wait for it to finish, or choose another folder".into()),
            Self::NothingToPack { .. } => Some("start a training from it first".into()),
            Self::SawReal { .. } => Some(
                "pack it without claiming that it was trained only on simulated images".into(),
            ),
            Self::NoMean { why, .. } => Some(
                match why {
                    NoMean::Packed => {
                        "give a run's folder first, since the mean takes its settings"
                    }
                    NoMean::EncodersOnly => "start a training from it first",
                    NoMean::LearnedCamera => {
                        "train both with a known camera, such as the one that this run learned"
                    }
                    NoMean::Layers { .. } | NoMean::Setting { .. } => {
                        "give networks that were trained from the same one"
                    }
                }
                .into(),
            ),
            Self::Occupied { .. } => Some("choose another folder, or empty this one first".into()),
            Self::Shares { .. } => {
                Some("give one positive number for each network, in the same order, such as 2,1".into())
            }
            Self::NothingInInt8 { .. } => {
                Some("allow a larger deviation, or use bf16 (an earlier calibration stays)".into())
            }
            Self::EmbeddedNetwork { .. } => {
                Some("give a run's folder, or the network's file and card".into())
            }
            Self::PackedAlready { .. } => {
                Some("give the folder of the run that it was packed from".into())
            }
            #[cfg(feature = "train")]
            Self::OtherStart { .. } => Some(
                "use the version of the program that made the run, or remove init_sha256 from the configuration to start from this one".into(),
            ),
            Self::NoBackend { device } => Some(format!(
                "build with the feature `{device}`, or use the processor"
            )),
            Self::NoSuchDevice { count: 1.., .. } => Some(
                "give a number from 0, or none for the backend's default".into(),
            ),
            Self::NoSuchDevice { .. } => Some(
                "check that the GPU's driver is installed and that this user may open the GPU, or use the processor".into(),
            ),
            Self::OnlyOnCpu => {
                Some("do not set the engine, or use the processor".into())
            }
            Self::OnlyFused { .. } => {
                Some("use the fused engine on the processor, or f32".into())
            }
            Self::OnlyOrt => {
                Some("choose ONNX Runtime as the engine, or do not give its library".into())
            }
            Self::NoFramework => Some("build with the feature `train`".into()),
            #[cfg(feature = "train")]
            Self::FewerSteps { made, .. } => Some(format!(
                "give more than {}: steps and epochs count from the start of the run",
                count_of(*made, "step")
            )),
            #[cfg(feature = "train")]
            Self::RunBusy { .. } => {
                Some("wait for it to finish, stop it, or choose another folder".into())
            }
            #[cfg(feature = "train")]
            Self::AdaptedBefore { .. } => {
                Some("choose another folder".into())
            }
            #[cfg(feature = "train")]
            Self::MountPoint { .. } => Some("choose a folder inside it".into()),
            #[cfg(feature = "train")]
            Self::OtherSettings { .. } => Some(
                "it belongs to an unfinished adaptation with other settings: use those to continue it, or remove the folder".into(),
            ),
            #[cfg(feature = "train")]
            Self::NotJudged { .. } => Some(
                "give longer drives with a speed, hold out more of them, or train from this network without the check".into(),
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
                Some("this is a bug in the program or in the library that ran the file: please report it".into())
            }
            #[cfg(feature = "train")]
            Self::Contradiction(_) => {
                Some("leave it out to continue the run, or start a new one in another folder".into())
            }
            #[cfg(feature = "train")]
            Self::BesideSets { .. } => {
                Some("leave it out, or set it in the data sets".into())
            }
            #[cfg(feature = "train")]
            Self::NoResult { .. } => Some("delete it to run this row again".into()),
            Self::NoCamera => Some("give fx, fy, cx, cy or a calibration".into()),
            Self::NoUncertainty => Some(
                "leave out sigma and confidence, or use a network trained with `depth_net.uncertainty = true`".into(),
            ),
            Self::NoLayers => Some(
                "leave out features".into(),
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
            | Self::NetworkFile { .. }
            | Self::NoTomlForm { .. }
            | Self::Toml(_) => None,
            Self::IntervalFactors { source, .. } => source.hint(),
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
