//! The libraries' errors in terms of the command's options: a library names a setting, this file the option that sets it.

use std::io::ErrorKind;
use std::path::Path;

use deepfusion_data::{
    CalibrationSource, DatasetKind, FileError, NamedTopic, TopicProblem, TopicRole,
};
use deepfusion_eval::ExpectedProtocolSetting;
use deepfusion_hint::{Hint, system_hint};
use deepfusion_model::ExpectedSetting;
use deepfusion_runtime::EngineProblem;

use super::{Exit, Reportable};

/// Errors whose own hints name no setting that has an option.
macro_rules! as_the_library_says {
    ($($error:ty),* $(,)?) => {
        $(impl Reportable for $error {
            fn hint_in_options(&self) -> Option<String> {
                self.hint()
            }
        })*
    };
}

as_the_library_says!(
    deepfusion_eval::odometry::PoseFileError,
    deepfusion_eval::odometry::TrackError,
    deepfusion_geometry::cloud::Error,
    deepfusion_infer::Error,
    deepfusion_model::NetworkError,
    deepfusion_motion::Error,
    deepfusion_perception::Error,
);

impl Reportable for deepfusion_sim::Error {
    fn message(&self) -> String {
        match self {
            Self::Config {
                field,
                value,
                expected,
            } => match simulator_option(field) {
                Some(option) => format!("{option} is {value}, expected {expected}"),
                None => self.to_string(),
            },
            _ => self.to_string(),
        }
    }

    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::Config { field, .. } => match simulator_option(field) {
                Some(option) => Some(format!("correct {option} (see --help)")),
                None => self.hint(),
            },
            _ => self.hint(),
        }
    }

    fn exit(&self) -> Exit {
        match self {
            Self::Stopped { .. } => Exit::Stopped,
            // Each of these options is given by the caller: simulate reads no configuration file.
            Self::Config { field, .. } if simulator_option(field).is_some() => Exit::WrongArguments,
            _ => Exit::Failed,
        }
    }
}

/// The option of `simulate` that sets a field of the simulator's configuration.
fn simulator_option(field: &str) -> Option<&'static str> {
    Some(match field {
        "frames" => "--frames",
        "width" => "the width of --size",
        "height" => "the height of --size",
        "moving_cars" => "--moving-cars",
        "riders" => "--riders",
        "fps" => "--fps",
        "stereo_baseline_m" => "--stereo",
        "camera_height_m" => "--camera-height",
        _ => return None,
    })
}

impl Reportable for deepfusion_rosbag::Error {
    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::Feature { feature, .. } => Some(built_with(feature)),
            _ => self.hint(),
        }
    }
}

/// How to get a program that reads ROS 2 bags.
fn built_with(feature: &str) -> String {
    format!(
        "build with `--features {feature}` to read it: cargo install --path crates/deepfusion-cli --features {feature}"
    )
}

impl Reportable for deepfusion_calibrate::Error {
    fn hint_in_options(&self) -> Option<String> {
        use deepfusion_calibrate::Error as Problem;
        match self {
            Problem::NoBoard {
                seen: Some((columns, rows, _)),
                ..
            }
            | Problem::TooFewViews {
                seen: Some((columns, rows, _)),
                ..
            } => Some(format!(
                "count inner corners, where four squares meet; if your board has {columns}x{rows}, give --board {columns}x{rows}"
            )),
            Problem::NoBoard { .. } => self.hint().map(|hint| format!("{hint}: --board 9x6")),
            Problem::Undetermined { .. } => self.hint().map(|hint| {
                format!("{hint}; for a lens that bends straight lines strongly, give --fisheye")
            }),
            _ => self.hint(),
        }
    }
}

impl Reportable for deepfusion_doctor::NoCameraAhead {
    fn hint_in_options(&self) -> Option<String> {
        let hint = self.hint();
        match self {
            // These hints end with the offset to give.
            Self::NoSpeeds { .. }
            | Self::NotFound { .. }
            | Self::Weak { .. }
            | Self::Unsure { .. } => hint.map(|hint| {
                format!("{hint}: --clock-offset MS (without it the clocks are taken to agree)")
            }),
            _ => hint,
        }
    }
}

impl Reportable for deepfusion_logs::Error {
    fn hint_in_options(&self) -> Option<String> {
        use deepfusion_logs::ColumnProblem as Problem;
        Some(match self {
            Self::Column { problem, .. } => match problem {
                Problem::NoSpeedUnit(_) => {
                    "give it: --unit km/h (or m/s, mph, knots; speed_unit in dataset.toml); a wrong unit would scale every depth".into()
                }
                _ => return self.hint().map(|hint| {
                    format!("{hint}: --time COLUMN --speed COLUMN (time_column, speed_column in dataset.toml)")
                }),
            },
            Self::Signal { .. } => "give --dbc FILE and --speed Message.Signal".into(),
            Self::NoStart { .. } => {
                "give the first frame's time on the log's clock: --start 12:00:03, or in seconds".into()
            }
            Self::Exists { .. } => "choose another --out, or remove the file".into(),
            _ => return self.hint(),
        })
    }
}

impl Reportable for deepfusion_video::Error {
    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::Silent { .. } => {
                Some("check that the source is sending, or wait longer with --timeout S".into())
            }
            _ => self.hint(),
        }
    }
}

/// The commands with options for the camera; the others read it from files.
const TAKE_CAMERA: &str = "predict, perceive, eval, doctor and data inspect also take";

impl Reportable for deepfusion_data::Error {
    fn message(&self) -> String {
        match self {
            Self::CameraFile {
                by: CalibrationSource::Given,
                problem,
                ..
            } => format!("--intrinsics: {problem}"),
            Self::FrameSize {
                image,
                drive,
                frame,
                found,
                expected,
                field,
                calibration: CalibrationSource::Given,
            } => format!(
                "{image}: frame {frame} of {drive} is {}x{}, but its calibration is for {}x{} ({field} in --intrinsics)",
                found.0, found.1, expected.0, expected.1
            ),
            _ => self.to_string(),
        }
    }

    fn hint_in_options(&self) -> Option<String> {
        let hint = self.hint();
        let or = |option: &str| hint.as_ref().map(|hint| format!("{hint}, or {option}"));
        match self {
            Self::UnknownLayout { .. } if self.needs_ros2() => Some(built_with("ros2")),
            Self::Bag(error) => error.hint_in_options(),
            Self::NoCameraFile {
                layout: DatasetKind::RgbD,
                ..
            } => hint.map(|hint| format!("{hint}; {TAKE_CAMERA} --intrinsics 585,585,320,240")),
            Self::NoCameraFile { .. } | Self::NoBagCamera { .. } => hint.map(|hint| {
                format!(
                    "{hint} (`deepfusion calibrate` measures a camera); {TAKE_CAMERA} --hfov 70; train, as a last resort, --intrinsics learn"
                )
            }),
            Self::OwnCalibration { .. } => {
                Some("leave out --intrinsics, --hfov and --calib".into())
            }
            Self::Topic {
                choice: Some(topic),
                ..
            } if topic.role.is_optional() => or(&format!(
                "--topic {topic} (--topic {}={} reads none)",
                topic.role,
                NamedTopic::NONE
            )),
            Self::Topic {
                choice: Some(topic),
                ..
            } => or(&format!("--topic {topic}")),
            Self::Topic { problem, .. }
                if matches!(
                    **problem,
                    TopicProblem::NoTopic { config: None, .. }
                        | TopicProblem::OtherType { config: None, .. }
                ) =>
            {
                hint.map(|hint| format!("with --topic, {hint}"))
            }
            Self::InertialUnit { .. } => {
                or(&format!("--topic {}={}", TopicRole::Imu, NamedTopic::NONE))
            }
            Self::NoSegmentVideo { .. } => hint
                .map(|hint| format!("{hint}; `deepfusion data inspect` reports its other streams")),
            Self::NoTopics { .. } => Some("leave out --topic, or give only bags".into()),
            Self::OneCamera { .. } => Some("leave out --camera, or give 2".into()),
            Self::DepthKind { .. } => Some("leave out --gt-depth, or give z".into()),
            Self::Video(error) => error.hint_in_options(),
            Self::Log(error) => error.hint_in_options(),
            _ => hint,
        }
    }

    fn exit(&self) -> Exit {
        match self {
            Self::Stopped { .. } => Exit::Stopped,
            _ => Exit::Failed,
        }
    }

    fn missing(&self) -> Option<&Path> {
        match self {
            Self::File(FileError::NoSuchPath { path }) => Some(path),
            _ => None,
        }
    }
}

impl Reportable for deepfusion_eval::Error {
    fn message(&self) -> String {
        match self {
            Self::Protocol {
                value,
                expected: ExpectedProtocolSetting::MetresAboveMinimum,
                ..
            } => format!("--cap is {value} m, expected more than --min"),
            _ => self.to_string(),
        }
    }

    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::InvalidPrediction { kind, .. } => Some(format!(
                "a network's {kind} is positive everywhere; if these values mean \"no prediction\", pass --allow-holes, \
                 which leaves them out and counts them in missing_rate"
            )),
            Self::NothingToEvaluate { skipped: 0, .. } => Some(
                "give --gt FILE, or another --gt-depth if the drive has ground truth of another kind; a drive with speeds can also be \
                 evaluated without ground truth (deepfusion data import adds them to a video)"
                    .into(),
            ),
            Self::NothingToEvaluate { .. } => Some(
                "check that the ground truth is in metres, with 0 where it is unknown, and that --crop and --cap leave pixels"
                    .into(),
            ),
            Self::Protocol {
                expected: ExpectedProtocolSetting::MetresAboveMinimum,
                ..
            } => Some("raise --cap or lower --min".into()),
            Self::Intervals { .. } => {
                Some("write them again with `eval --calibrate-uncertainty`".into())
            }
            _ => self.hint(),
        }
    }
}

impl Reportable for deepfusion_eval::compare::Error {
    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::NotEvaluated { path } if path.join("config.toml").is_file() => Some(format!(
                "evaluate it first: deepfusion eval --model {} --data PATH",
                path.display()
            )),
            Self::NotAnEvaluation { .. } | Self::NotEvaluated { .. } => Some(
                "give a run's folder, a file of its eval/ folder, or what `eval --json` printed"
                    .into(),
            ),
            _ => self.hint(),
        }
    }
}

impl Reportable for deepfusion_instances::Error {
    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::Class { known, .. } if known.is_empty() => {
                Some("leave out --classes to use all of them: the model has no class names".into())
            }
            _ => self.hint(),
        }
    }
}

impl Reportable for deepfusion_model::Error {
    fn message(&self) -> String {
        match self {
            Self::DataSet { expected, found } => {
                format!("setting `--data-set`: expected {expected}, found {found}")
            }
            Self::PresetAsKey { assignment } => {
                format!("{assignment}: a preset is chosen with --preset or in the file")
            }
            Self::Config {
                field,
                expected: ExpectedSetting::Recordings,
                found,
            } => format!(
                "setting `{field}`: expected --data, or data.paths or [[data.sets]] in the config file, found {found}"
            ),
            _ => self.to_string(),
        }
    }

    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::EncodersOnly { .. } => {
                Some("train from it first: deepfusion train --data DRIVE --init RUN".into())
            }
            Self::DataSet { .. } => {
                Some("name the data set whose metric scale to use: --data-set NAME".into())
            }
            Self::Config { field: "data" | "data.paths", .. } => Some(
                "give recordings in one place: with --data, or as data.paths or [[data.sets]] in the config file".into(),
            ),
            Self::Config { field: "view_motion", .. } => Some(
                "use --view-motion posenet, which needs no measured motion, or keep the speed loss".into(),
            ),
            Self::Config { field, .. } => Some(set_in_file(field)),
            Self::NoCheckpoint { .. } => {
                Some("start again without --resume, in another folder (--out) or after emptying this one".into())
            }
            Self::NotResumable { .. } => {
                Some("start a new run from these weights with --init".into())
            }
            Self::RunExists { .. } => {
                Some("continue it with --resume, or choose another folder with --out".into())
            }
            Self::Setting { .. } | Self::PresetAsKey { .. } => {
                Some("`deepfusion config show` prints every key and what it means".into())
            }
            Self::ConfigFile { .. } => Some(
                "name a preset and the keys in which it differs; `deepfusion config show` prints them all".into(),
            ),
            Self::NotARun { .. } => {
                Some("give the folder that `train`, `adapt`, `demo` or a command of `weights` wrote".into())
            }
            Self::Foreign { .. } => {
                Some("`weights import` reads weights of other programs".into())
            }
            _ => self.hint(),
        }
    }
}

/// The hint how to set a key of the configuration.
pub(crate) fn set_in_file(field: &str) -> String {
    format!("correct `{field}` in the config file or with its option (see --help)")
}

impl Reportable for deepfusion_onnx::Error {
    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::Node { .. } | Self::Model { .. } => {
                Some("export the network again with `deepfusion export` of this version; no other ONNX files can be read".into())
            }
            _ => self.hint(),
        }
    }
}

impl Reportable for deepfusion_images::Error {
    fn hint_in_options(&self) -> Option<String> {
        self.hint()
    }

    fn missing(&self) -> Option<&Path> {
        match self {
            Self::File(FileError::NoSuchPath { path }) => Some(path),
            _ => None,
        }
    }
}

impl Reportable for deepfusion_render::Error {
    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::Log { .. } => {
                Some("give the log.csv that `train` wrote into the run's folder".into())
            }
            _ => self.hint(),
        }
    }
}

impl Reportable for deepfusion_runtime::Error {
    fn message(&self) -> String {
        match self {
            Self::Model(error) => error.message(),
            _ => self.to_string(),
        }
    }

    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::NoSuchModel { known, .. } => {
                const WROTE: &str = "give the folder that `train`, `adapt`, `demo` or a command of `weights` wrote";
                Some(match known.as_slice() {
                    [] => format!(
                        "{WROTE}; this build has no embedded network (deepfusion train --data DRIVE trains a network)"
                    ),
                    known => format!("{WROTE}, or an embedded network: {}", known.join(", ")),
                })
            }
            Self::Engine { reason, .. } => Some(of_engine(reason).unwrap_or(
                "the fused engine in f32 runs on every processor; with the training framework, `--engine burn` runs \
                 every network on every device"
                    .into(),
            )),
            Self::NotCalibrated | Self::Calibration(_) => Some(
                "calibrate it on some of your images first: deepfusion weights calibrate --model RUN DRIVE; `--precision bf16` needs no calibration"
                    .into(),
            ),
            Self::Weights(error) => error.hint_in_options(),
            Self::Model(error) => error.hint_in_options(),
            Self::Onnx(error) => error.hint_in_options(),
            _ => self.hint(),
        }
    }
}

/// The hint of an engine's problem.
fn of_engine(problem: &EngineProblem) -> Option<String> {
    match problem {
        EngineProblem::Fused(error) => error.hint_in_options(),
        EngineProblem::Onnx(error) => error.hint_in_options(),
        EngineProblem::Network(error) => error.hint_in_options(),
        other => other.hint(),
    }
}

impl Reportable for deepfusion_weights::Error {
    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::NotEmbedded { known, .. } if known.is_empty() => Some(
                "train a network (deepfusion train --data DRIVE), then give its folder: --model RUN".into(),
            ),
            Self::Card { .. } => Some(
                "`deepfusion weights pack` writes a card beside the weights; take both from there"
                    .into(),
            ),
            Self::Exists { .. } => {
                Some("choose another folder or --name, or give --overwrite to replace it".into())
            }
            _ => self.hint(),
        }
    }
}

#[cfg(feature = "train")]
impl Reportable for deepfusion_train::Error {
    fn message(&self) -> String {
        match self {
            Self::Data(error) => error.message(),
            Self::Model(error) => error.message(),
            _ => self.to_string(),
        }
    }

    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::Data(error) => error.hint_in_options(),
            Self::Model(error) => error.hint_in_options(),
            Self::NoSamples { .. } => self
                .hint()
                .map(|hint| format!("{hint}; `deepfusion data inspect` shows what a recording contains")),
            Self::Precision { .. } => Some(set_in_file("precision")),
            Self::CameraKnown { .. } => Some(
                "leave out --intrinsics learn, or this recording: known intrinsics are better than learned ones".into(),
            ),
            Self::SharedFrames { .. } => Some(
                "validate on other drives (--val-data) or other frames (--val-split), or leave out both, which holds out the end of each \
                 drive"
                    .into(),
            ),
            Self::NotFinite { .. } | Self::GradientsNotFinite { .. } => Some(
                "check the frames named above or lower the learning rate, then continue from the last good \
                 checkpoint with --resume"
                    .into(),
            ),
            Self::Loader { .. } => Some(
                "this is a bug: please report it with the lines above; the saved checkpoints are intact, and --resume \
                 continues from the last"
                    .into(),
            ),
            Self::NoValidation => Some(
                "give longer drives or --val-data; `validation_share = 0` in a config file trains without validation and without a `best` \
                 checkpoint"
                    .into(),
            ),
            _ => self.hint(),
        }
    }

    fn missing(&self) -> Option<&Path> {
        match self {
            Self::Data(error) => error.missing(),
            _ => None,
        }
    }
}

impl Reportable for deepfusion_view::Error {
    fn hint_in_options(&self) -> Option<String> {
        match self {
            Self::NoSuchFolder { .. } => {
                Some("give the folder that `predict --out` or `perceive --out` wrote".into())
            }
            Self::NoFrames { .. } => {
                Some("give the folder that `predict` or `perceive` wrote".into())
            }
            Self::NothingToShow { path } => Some(format!(
                "predict some images first: deepfusion predict IMAGES --out {}",
                path.display()
            )),
            Self::PortInUse { .. } => {
                Some("give another --port, or --port 0 for any free one".into())
            }
            Self::Listen { source, .. } => Some(match source.kind() {
                ErrorKind::PermissionDenied => {
                    "give --port 8765: ports below 1024 are reserved for the system".into()
                }
                _ => "give --host an address of this machine, such as 127.0.0.1 or 0.0.0.0".into(),
            }),
            _ => self.hint(),
        }
    }

    fn exit(&self) -> Exit {
        match self {
            // The viewer's library has this error with and without the feature `rerun`.
            Self::Stopped { .. } => Exit::Stopped,
            _ => Exit::Failed,
        }
    }
}

/// Errors of other people's crates, which have no hint.
macro_rules! foreign {
    ($($error:ty),* $(,)?) => {
        $(impl Reportable for $error {
            fn hint_in_options(&self) -> Option<String> {
                None
            }
        })*
    };
}

foreign!(clap::Error, toml::de::Error, toml::ser::Error);

impl Reportable for std::io::Error {
    fn hint_in_options(&self) -> Option<String> {
        Some(system_hint(self.kind()).into())
    }
}

impl Reportable for serde_json::Error {
    fn hint_in_options(&self) -> Option<String> {
        self.io_error_kind().map(|kind| system_hint(kind).into())
    }
}
