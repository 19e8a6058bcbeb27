//! The errors of work over recordings and folders, in terms of the command's options.

use std::path::Path;

use deepfusion_hint::Hint;
#[cfg(feature = "train")]
use deepfusion_hint::count_of;
#[cfg(feature = "train")]
use deepfusion_jobs::training::resume::{Contradiction, RequestedValue, Setting};
use deepfusion_jobs::{Error, OtherJob, StaleReason};
use deepfusion_records::Difference;

use super::{Exit, Reportable, set_in_file};

impl Reportable for Error {
    /// Names options instead of the library's settings.
    fn message(&self) -> String {
        match self {
            Self::Stale {
                path,
                why: StaleReason::MadeWith(what),
            } => format!(
                "{}: already exists, made with {}",
                path.display(),
                options_of(*what)
            ),
            Self::OtherJob {
                path,
                why: OtherJob::MadeWith(what),
            } => format!(
                "{}: the shards in this folder were started with {}",
                path.display(),
                options_of(*what)
            ),
            #[cfg(feature = "train")]
            Self::Contradiction(Contradiction {
                setting,
                asked,
                run,
                ..
            }) => format!(
                "`{}`: {} contradicts the run, which {run}",
                option_of(setting),
                typed(asked)
            ),
            #[cfg(feature = "train")]
            Self::BesideSets { setting } => format!(
                "`{}`: not allowed beside [[data.sets]] in the config file, where each set has its own",
                option_of(setting)
            ),
            Self::OnlyOnCpu => {
                "only `--engine burn` runs on devices other than the processor".into()
            }
            Self::OnlyFused { precision } => {
                format!("`--precision {}` needs the fused engine", precision.name())
            }
            Self::OnlyOrt => "`--ort-lib` needs `--engine ort`".into(),
            Self::NoFramework => {
                "`--engine burn` and devices other than the processor need the training framework, which this build leaves out".into()
            }
            other => wrapped(other).map_or_else(|| other.to_string(), Reportable::message),
        }
    }

    /// Names the options to use.
    fn hint_in_options(&self) -> Option<String> {
        if let Some(error) = wrapped(self) {
            return error.hint_in_options();
        }
        match self {
            Self::Exists { .. } => {
                Some("replace it with --overwrite, or choose another folder".into())
            }
            Self::LiveFrameExists { .. } => Some(
                "replace all of its live frames with --overwrite, or choose another folder".into(),
            ),
            Self::Stale { .. } => Some(
                "replace outputs that were made differently with --overwrite, or choose another folder".into(),
            ),
            Self::OtherJob { .. } => Some(
                "start every shard with the same inputs and options; to start again, use --overwrite or another folder".into(),
            ),
            Self::Busy { .. } => {
                Some("wait for it, or share the work: --shard I/N with a different I for each process".into())
            }
            Self::Incomplete {
                of_other_camera: others @ 1..,
                ..
            } => Some(format!(
                "add --camera both: {others} of the split's frames {} from the other camera",
                if *others == 1 { "is" } else { "are" }
            )),
            Self::Incomplete { .. } => Some(
                "give the folder with every drive that the split names, or leave out --strict to use the frames that exist".into(),
            ),
            Self::CameraOf { source, .. } => match **source {
                Self::Camera(_) => self.hint(),
                _ => source.hint_in_options(),
            },
            Self::NoTopic { problem, .. } => {
                Some(problem.hint().unwrap_or_else(|| set_in_file("data.topics")))
            }
            #[cfg(feature = "train")]
            Self::FewerSteps { made, .. } => Some(format!(
                "--steps and --epochs count from the run's beginning: give more than {}",
                count_of(*made, "step")
            )),
            #[cfg(feature = "train")]
            Self::BesideSets { .. } => {
                Some("leave it out, or change the sets in the config file".into())
            }
            Self::NoCamera => Some("give --intrinsics fx,fy,cx,cy or --calib".into()),
            Self::NoUncertainty => Some(
                "use a network trained with depth_net.uncertainty = true (not with --engine ort), or leave out what needs it: sigma and confidence of --save, --max-sigma, --calibrate-uncertainty"
                    .into(),
            ),
            Self::NothingToPack { .. } => {
                Some("train from it first: deepfusion train --data DRIVE --init RUN".into())
            }
            Self::SawReal { .. } => Some("leave out --simulated-only".into()),
            Self::NoBackend { device } => Some(format!(
                "build deepfusion with `cargo build --release --features {device}`, or use --device cpu"
            )),
            Self::NoSuchDevice {
                backend, count: 1.., ..
            } => Some(format!(
                "devices are counted from 0; `--device {backend}` uses the one that the backend prefers"
            )),
            Self::NoSuchDevice { .. } => Some(
                "check that the GPU's driver is installed and that this user may open the GPU, or use --device cpu".into(),
            ),
            Self::OnlyOnCpu => Some("leave out --engine, or give --device cpu".into()),
            Self::OnlyFused { .. } => {
                Some("give --engine fused --device cpu, or leave out --precision".into())
            }
            Self::OnlyOrt => Some("add --engine ort, or leave out --ort-lib".into()),
            Self::NoFramework => {
                Some("use a program built with the feature `train`, which is on by default".into())
            }
            #[cfg(feature = "train")]
            Self::NotJudged { .. } => Some(
                "give longer drives with a speed, hold out more with --held-out SHARE, or train without this check: deepfusion train --data DRIVE --init NETWORK".into(),
            ),
            #[cfg(feature = "train")]
            Self::NotAdapted { .. } => Some("give the folder that `adapt --out` named".into()),
            other => other.hint(),
        }
    }

    fn exit(&self) -> Exit {
        wrapped(self).map_or(Exit::Failed, Reportable::exit)
    }

    fn missing(&self) -> Option<&Path> {
        wrapped(self)?.missing()
    }
}

/// The other library's error that this one only passes on, which is reported in its place.
fn wrapped(error: &Error) -> Option<&dyn Reportable> {
    match error {
        Error::Video(error) => Some(error),
        Error::Images(error) => Some(error),
        Error::Data(error) => Some(error),
        Error::Cloud(error) => Some(error),
        Error::PoseFile(error) => Some(error),
        Error::Track(error) => Some(error),
        Error::Calibrate(error) => Some(error),
        Error::Eval(error) => Some(error),
        Error::Compare(error) => Some(error),
        Error::Model(error) => Some(error),
        Error::Weights(error) => Some(error),
        Error::Simulator(error) => Some(error),
        Error::Runtime(error) => Some(error),
        #[cfg(feature = "train")]
        Error::Onnx(error) => Some(error),
        #[cfg(feature = "train")]
        Error::Network(error) => Some(error),
        #[cfg(feature = "train")]
        Error::Train(error) => Some(error),
        Error::Render(error) => Some(error),
        Error::Instances(error) => Some(error),
        Error::Perception(error) => Some(error),
        _ => None,
    }
}

/// What differs, with the options that set it.
fn options_of(what: Difference) -> &'static str {
    match what {
        Difference::Version => "another program version",
        Difference::Weights => "other weights (--model)",
        Difference::Engine => "another engine (--engine, --precision)",
        Difference::Save => "another --save",
        Difference::Set => "another --data-set",
        Difference::MaxDepth => "another --max-depth",
        Difference::MaxSigma => "another --max-sigma",
        Difference::Camera => "another camera (--hfov, --intrinsics, --calib)",
        Difference::FocalCorrection => "another --no-focal-correction",
        Difference::Stretch => "another --stretch",
        Difference::CorrectScale => "another --correct-scale or --camera-height",
        Difference::Topics => "another --topic",
        Difference::PostProcess => "another --post-process",
        _ => "other options",
    }
}

/// The requested value as typed on the command line.
#[cfg(feature = "train")]
fn typed(asked: &RequestedValue) -> String {
    match asked {
        RequestedValue::Learned => "learn".into(),
        RequestedValue::Measured => "auto".into(),
        other => other.to_string(),
    }
}

/// The option that asks for a setting.
#[cfg(feature = "train")]
pub(crate) fn option_of(setting: &Setting) -> String {
    match setting {
        Setting::File(path) => return format!("--config {}", path.display()),
        Setting::Preset => "--preset",
        Setting::Size => "--size",
        Setting::Batch => "--batch",
        Setting::Seed => "--seed",
        Setting::Learn => "--learn",
        Setting::Camera => "--camera",
        Setting::Stereo => "--stereo",
        Setting::LearnedCamera => "--intrinsics",
        Setting::ViewMotion => "--view-motion",
        Setting::With => "--with",
        Setting::Without => "--without",
        Setting::Assignment => "--set",
        Setting::Init => "--init",
        Setting::Clock => "--clock-offset",
        Setting::Topic => "--topic",
        Setting::Data => "--data",
        Setting::Validation => "--val-data",
        Setting::Split => "--split",
        Setting::ValidationSplit => "--val-split",
        other => return other.to_string(),
    }
    .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::failure::Failure;

    #[cfg(feature = "train")]
    #[test]
    fn settings_are_reported_as_options() {
        let setting = Setting::ValidationSplit;
        let error = Failure::from(Error::BesideSets { setting });
        assert_eq!(
            error.to_string(),
            "`--val-split`: not allowed beside [[data.sets]] in the config file, where each set has its own"
        );
        let off = deepfusion_jobs::training::resume::RunHas::Off;
        let contradiction =
            Contradiction::new(Setting::LearnedCamera, RequestedValue::Learned, off);
        let error = Failure::from(Error::Contradiction(contradiction));
        assert_eq!(
            error.to_string(),
            "`--intrinsics`: learn contradicts the run, which has it off"
        );
    }

    #[test]
    fn a_camera_of_another_size_is_reported_at_once() {
        let other_size = deepfusion_jobs::UnfitCamera::OtherSize {
            file: None,
            made_for: (640, 480),
            image: (96, 64),
        };
        let photo = Failure::from(Error::CameraOf {
            path: "street.jpg".into(),
            source: Box::new(Error::Camera(other_size.clone())),
        });
        let expected = "street.jpg: the intrinsics do not fit the image: the calibration is for 640x480, the image has 96x64";
        assert_eq!(photo.to_string(), expected);
        assert_eq!(photo.one_line(), expected);
        // Only a live camera can be asked for another size.
        assert!(!photo.hint().unwrap().contains("?size="));
        let live = Failure::from(Error::Camera(other_size));
        assert!(live.hint().unwrap().contains("?size="));
    }

    #[test]
    fn engines_and_devices_are_options() {
        let precision = deepfusion_infer::Precision::Bf16;
        let error = Failure::from(Error::OnlyFused { precision });
        assert_eq!(
            error.to_string(),
            "`--precision bf16` needs the fused engine"
        );
        for error in [
            Error::OnlyOnCpu,
            Error::OnlyFused { precision },
            Error::OnlyOrt,
            Error::NoBackend { device: "cuda" },
            Error::NoSuchDevice {
                device: "cuda:1".into(),
                backend: "cuda",
                count: 1,
            },
        ] {
            let error = Failure::from(error);
            assert!(error.hint().is_some_and(|hint| hint.contains("--")));
        }
    }

    #[test]
    fn an_engine_that_refuses_another_size_keeps_its_own_hint() {
        use deepfusion_runtime::Error as RuntimeError;
        let hint =
            |problem: Error| Failure::from(RuntimeError::engine("other size", problem)).hint();
        let fused = RuntimeError::engine("fused", deepfusion_infer::Error::NoBf16);
        let fused = hint(fused.into()).unwrap();
        assert!(fused.contains("`--engine burn` runs every"), "{fused}");
        assert!(hint(Error::OnlyOrt).is_some_and(|hint| hint.contains("ONNX Runtime")));
    }

    #[test]
    fn a_difference_names_its_option() {
        let error = Error::Stale {
            path: "a.json".into(),
            why: StaleReason::MadeWith(Difference::MaxDepth),
        };
        let error = Failure::from(error);
        assert_eq!(
            error.to_string(),
            "a.json: already exists, made with another --max-depth"
        );
        assert!(
            error
                .hint()
                .is_some_and(|hint| hint.contains("--overwrite"))
        );
    }
}
