//! Finds, before training starts, every reason why training on a recording would fail or give depths of a wrong scale.
//!
//! [`doctor`] opens a recording and runs one check after the other. A check measures a figure and compares
//! it with a limit; a figure outside its limit is a [`Finding`] with a hint. The limits are set so that the clean drives
//! at hand (KITTI 0005 and 0009, the simulator's five scenes) pass all of them. What is wrong ([`FindingReason`], which
//! has the hint) and why a check could not be made ([`SkipReason`]) are types, and sentences as text and in JSON.

mod before_training;
mod blur;
mod camera_ahead;
mod clock;
mod clock_offset;
mod depth_pictures;
mod duplicates;
mod dynamic_points;
mod epipolar;
mod exposure;
mod finding;
mod flow;
mod ground;
mod heading;
mod hood;
mod image_quality;
mod intrinsics;
mod lidar_speed;
mod log;
mod opening;
mod parallax;
mod plots;
mod reason;
mod record;
mod seen_turns;
mod shared_error;
mod skip;
mod speed;
mod standing;
mod steering;
mod stereo;
mod summary;
mod survey;
mod timing;
mod turn;
mod turning;

pub use before_training::{camera_finding, turn_finding};
pub use camera_ahead::{
    CameraAhead, CommonCameraAhead, LEAST_CORRELATION, MOST_STD_ERROR_S, MOST_TRACK_STD_ERROR_S,
    NoCameraAhead, camera_ahead, common_camera_ahead,
};
pub use depth_pictures::{DepthPicture, depth_pictures};
pub use finding::{Figure, Finding, Limit, Outcome, Severity, Status};
pub use heading::heading;
pub use log::{doctor_log, is_log};
pub use plots::{DrivePlots, Line};
pub use reason::{
    CameraReason, CentreCoordinate, FindingReason, FramesReason, HeadingAngle, ImageSide,
    LogReason, MotionReason, OpeningReason, PicturesReason, RoadAngle,
};
pub use record::{CheckRecord, DiagnosisRecord, FindingRecord};
pub use seen_turns::{SEEN_TURNS_VERSION, TurnsOfImages, seen_turns};
pub use shared_error::SharedError;
pub use skip::{
    CameraSkip, ClockSkip, FramesSkip, LogSkip, MotionSkip, NoHeading, PicturesSkip, SkipReason,
    UnsureHeading,
};
pub use summary::CheckSummary;

use deepfusion_data::{
    Cameras, ClockOffset, Dataset, DatasetKind, Error, Inspection, OpenOptions, Result,
};
use deepfusion_motion::TimeOffset;
use serde::Serialize;
use std::path::{Path, PathBuf};
use survey::Survey;

/// The results of all checks of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Findings about the recording as a whole: it cannot be opened, its cameras are swapped.
    pub recording: Vec<Outcome>,
    /// The results of each drive.
    pub drives: Vec<DriveDiagnosis>,
}

/// The results of all checks of one drive.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriveDiagnosis {
    /// The drive's name.
    pub name: String,
    /// The camera that was examined: 2 or 3.
    pub camera: u8,
    /// Layout of the recording.
    pub kind: DatasetKind,
    /// Number of images.
    pub frames: usize,
    /// How many of them were examined.
    pub looked_at: usize,
    /// One outcome per check.
    pub outcomes: Vec<Outcome>,
    /// Folder or file of the drive: several drives may have the same name.
    #[serde(skip)]
    pub place: PathBuf,
    /// What was measured over time, to be drawn.
    #[serde(skip)]
    pub plots: DrivePlots,
}

impl Diagnosis {
    /// The diagnosis of a recording that cannot be opened: why, and what to do about it, in a program's own words.
    #[must_use]
    pub fn unopened(why: String, hint: Option<String>) -> Self {
        let unopened = Self::not_opened(FindingReason::Words(why));
        match hint {
            Some(hint) => unopened.reworded(|finding| finding.hint.clone_from(&hint)),
            None => unopened,
        }
    }

    fn not_opened(why: FindingReason) -> Self {
        let others = CHECKS.iter().filter(|check| **check != opening::CHECK);
        let skipped = |check: &&'static str| Outcome::skipped(check, SkipReason::NotOpened);
        let failed = std::iter::once(opening::failed(why));
        Self {
            recording: failed.chain(others.map(skipped)).collect(),
            drives: Vec::new(),
        }
    }

    /// Adds the checks of what a file that cannot be opened as a recording holds besides its pictures: a GoPro's own log.
    #[must_use]
    pub fn with_log_within(mut self, path: &Path) -> Self {
        self.recording.extend(log::within(path));
        self
    }

    /// The same diagnosis with each finding reworded by `reword`: a program names its options there.
    #[must_use]
    pub fn reworded(mut self, reword: impl Fn(&mut Finding)) -> Self {
        let drives = self.drives.iter_mut().flat_map(|drive| &mut drive.outcomes);
        let outcomes = self.recording.iter_mut().chain(drives);
        outcomes
            .flat_map(|outcome| &mut outcome.findings)
            .for_each(reword);
        self
    }

    /// All findings with the drive they are about, the worst first.
    #[must_use]
    pub fn findings(&self) -> Vec<(Option<&str>, &Finding)> {
        let of_recording = self.recording.iter().map(|outcome| (None, outcome));
        let drives = self.drives.iter().flat_map(|drive| {
            let named = |outcome| (Some(drive.name.as_str()), outcome);
            drive.outcomes.iter().map(named)
        });
        let mut found: Vec<(Option<&str>, &Finding)> = of_recording
            .chain(drives)
            .flat_map(|(name, outcome)| outcome.findings.iter().map(move |f| (name, f)))
            .collect();
        found.sort_by_key(|(_, finding)| std::cmp::Reverse(finding.severity));
        found
    }

    /// The highest severity among the findings.
    #[must_use]
    pub fn worst(&self) -> Option<Severity> {
        self.findings().first().map(|(_, finding)| finding.severity)
    }
}

/// Names of all checks in the order in which they are reported: those of a drive, then that of both cameras.
const CHECKS: [&str; 18] = [
    "opening",
    "timing",
    "duplicates",
    "intrinsics",
    "standing",
    "speed",
    "lidar-speed",
    "dynamic-points",
    "steering",
    "clock",
    "turn",
    "heading",
    "ground",
    "parallax",
    "exposure",
    "blur",
    "bonnet",
    "stereo",
];

/// Examines a recording of any layout; `intrinsics` as [`OpenOptions::intrinsics`]. A recording that cannot be opened
/// is a finding, not an error.
#[must_use]
pub fn doctor(path: &Path, intrinsics: Option<[f64; 4]>) -> Diagnosis {
    let options = OpenOptions {
        intrinsics,
        ..OpenOptions::default()
    };
    doctor_with(path, &options).unwrap_or_else(|error| {
        Diagnosis::not_opened(OpeningReason::Recording(error.into()).into())
    })
}

/// [`doctor`] with a given camera or clock offset; camera and split of the options are ignored.
///
/// # Errors
/// Those of [`Dataset::open`]: the caller turns a recording that cannot be opened into a finding in its own words
/// ([`Diagnosis::unopened`]).
pub fn doctor_with(path: &Path, options: &OpenOptions) -> Result<Diagnosis> {
    let open = |camera| {
        let options = OpenOptions {
            camera,
            split: None,
            ..options.clone()
        };
        Dataset::open(path, &options)
    };
    let datasets = match open(Cameras::Left) {
        Err(Error::NoImages { .. }) => open(Cameras::Right),
        other => other,
    }?;
    let trains = datasets.iter().any(|d| opening::pairs(d).is_ok());
    let drives = datasets.iter().map(|d| examine_among(d, trains));
    Ok(Diagnosis {
        drives: drives.collect(),
        recording: std::iter::once(stereo::check(path, options))
            .chain(log::within(path))
            .collect(),
    })
}

/// Examines one drive of several, of which another one may be usable for training.
fn examine_among(dataset: &Dataset, others_train: bool) -> DriveDiagnosis {
    let survey = Survey::of(dataset);
    let pairs = epipolar::pairs(&survey);
    let outcomes = vec![
        opening::check(&survey, others_train),
        timing::check(dataset),
        duplicates::check(&survey),
        intrinsics::check(&dataset.intrinsics(0)),
        standing::check(dataset),
        speed::check(dataset),
        lidar_speed::check(dataset),
        dynamic_points::check(dataset),
        steering::check(dataset),
        clock::check(&survey, &pairs),
        turn::check(&pairs),
        heading::check(&survey, &pairs),
        ground::check(dataset),
        parallax::check(&survey, &pairs),
        exposure::check(&survey),
        blur::check(&survey),
        hood::check(&survey),
    ];
    DriveDiagnosis {
        name: dataset.name().to_owned(),
        camera: dataset.camera().number(),
        kind: dataset.kind(),
        frames: dataset.frames().len(),
        looked_at: survey.frames.len(),
        outcomes,
        place: dataset.place().to_owned(),
        plots: DrivePlots::of(&survey, &pairs),
    }
}

/// The offset of the camera's clock to the vehicle's, measured as by the check `clock`, from how a sample of the pictures
/// moved. `None` without speeds and turns, or if the drive does not show it to 0.05 s.
#[must_use]
pub fn time_offset(dataset: &Dataset) -> Option<TimeOffset> {
    // Without speeds and turns, no picture has to be read.
    clock_offset::rates(dataset)?.yaw_rate_radps?;
    let survey = Survey::of(dataset);
    let pairs = epipolar::pairs(&survey);
    let estimate = clock::estimate(&survey, &pairs).ok()?;
    Some(estimate.offset)
}

/// [`deepfusion_data::inspect_with`] with the clocks' offset measured by [`time_offset`], if one drive is examined.
/// Reads a few hundred pictures for it.
///
/// # Errors
/// As [`deepfusion_data::inspect`].
pub fn inspect(path: &Path, options: &OpenOptions) -> Result<Inspection> {
    deepfusion_data::inspect_with(path, options, |dataset| {
        time_offset(dataset).map(|offset| ClockOffset {
            vehicle_minus_camera_s: offset.vehicle_minus_camera_s,
            std_error_s: offset.std_error_s,
        })
    })
}
