//! Opens a video file with tables and a calibration beside it.

use super::shared::frames_place::folder_for_frames;
use super::shared::plain::PlainParts;
use crate::camera::{CameraCalibration, Pictures, find_camera};
use crate::dataset_toml::FolderConfig;
use crate::logs::clock::{TimeUnit, seconds};
use crate::logs::frame_times::{TimedImage, from_start, numbers_by_time};
use crate::logs::speed_log::SpeedLog;
use crate::{
    Camera, CameraProblem, CameraWarning, ConfigProblem, DataWarning, Dataset, DatasetKind, Error,
    OpenOptions, Result, TimesWarning,
};
use deepfusion_geometry::Distortion;
use deepfusion_logs::{GoproLens, may_hold_log};
use deepfusion_video::{VideoFrames, is_video};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The video in a folder.
#[derive(Debug)]
pub(crate) struct FolderVideo {
    pub(crate) file: PathBuf,
    /// Whether it is named in `dataset.toml`.
    pub(crate) named: bool,
}

/// The video in a folder: the one named in `dataset.toml`, or the only one.
///
/// # Errors
/// [`Error::Config`] if a named video does not exist, or none is named and there are several.
pub(crate) fn in_folder(folder: &Path) -> Result<Option<FolderVideo>> {
    let config = FolderConfig::read(folder)?;
    if config.images.is_some() {
        return Ok(None);
    }
    if let Some(named) = config.find(folder, "video", config.video.as_ref(), &[])? {
        return Ok(Some(FolderVideo {
            file: named,
            named: true,
        }));
    }
    let mut videos = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, e))? {
        let path = entry.map_err(|e| Error::file(folder, e))?.path();
        if path.is_file() && is_video(&path) {
            videos.push(path);
        }
    }
    match videos.len() {
        0 => Ok(None),
        1 => Ok(videos.pop().map(|file| FolderVideo { file, named: false })),
        count => Err(config.error(ConfigProblem::SeveralVideos { count })),
    }
}

/// Opens a video file, or the video of a folder, which may be elsewhere; tables and settings are those of the folder.
pub(crate) fn open(place: &Path, options: &OpenOptions) -> Result<Dataset> {
    let (file, folder) = if place.is_dir() {
        let file = in_folder(place)?.map_or_else(|| place.to_owned(), |found| found.file);
        (file, place.to_owned())
    } else {
        let folder = place.parent().unwrap_or(Path::new("."));
        (place.to_owned(), folder.to_owned())
    };
    let config = FolderConfig::read(&folder)?;
    let mut warnings = Vec::new();
    let video = frames_of(&file, &config, &mut warnings)?;
    // Ignore errors here: ffmpeg has already checked the video.
    let lens = may_hold_log(&file).then(|| GoproLens::read(&file).ok().flatten());
    let lens = lens.flatten();
    let calibration = find_camera(
        &folder,
        &config,
        options,
        video.size(),
        DatasetKind::Video,
        Pictures::Video(&file, lens.as_ref()),
        &mut warnings,
    )
    .map_err(|error| match (error, &lens) {
        (Error::NoCameraFile { .. }, Some(lens)) => no_pinhole(&file, lens),
        (other, _) => other,
    })?;
    let model = lens.as_ref().map(|lens| lens.model.clone());
    let bent = lens.and_then(|lens| lens_warning(&lens, &calibration));
    warnings.extend(bent.map(DataWarning::from));
    let times = match (video.times_ns(), config.fps) {
        (_, Some(fps)) => {
            let ns = |i: usize| Some((i as f64 / fps * 1e9).round() as i64);
            (0..video.count()).map(ns).collect()
        }
        (Some(times), None) => times.iter().copied().map(Some).collect(),
        (None, None) => {
            warnings.push(TimesWarning::VideoUntimed.into());
            vec![None; video.count()]
        }
    };
    let speeds = SpeedLog::read(&folder, &config)?;
    let start_s = config.start_s.or_else(|| {
        let (created, log) = (video.created_ns()?, speeds.as_ref()?);
        let ns = &log.speeds_mps.ns;
        let log = (*ns.first()?, *ns.last()?);
        let start_ns = start_of(created, &times, log)?;
        warnings.push(TimesWarning::VideoBegins { start_ns }.into());
        let zone = zone_warning(created, &times, log, model);
        warnings.extend(zone.map(DataWarning::from));
        Some(seconds(start_ns, 0))
    });
    let times = from_start(times, start_s);
    let known: Option<Vec<i64>> = times.iter().copied().collect();
    let numbers = match known {
        Some(known) => numbers_by_time(&known),
        None => (0..video.count() as u64).collect(),
    };
    // Neither matters without speeds.
    if start_s.is_none() && speeds.is_some() {
        warnings.push(TimesWarning::VideoOnTablesClock.into());
    }
    let image = |(number, ns): (u64, Option<i64>)| TimedImage {
        number,
        path: file.clone(),
        ns,
    };
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    PlainParts {
        kind: DatasetKind::Video,
        name: stem.into_owned(),
        images: numbers.into_iter().zip(times).map(image).collect(),
        calibration,
        camera_ahead_s: config.camera_ahead_s(options),
        image_size: video.size(),
        // The mount converts the vehicle's motion into the camera's, so it does not matter without motion.
        mount_assumed: config.mount.is_none() && speeds.is_some(),
        speeds,
        cam_from_vehicle: config.cam_from_vehicle(),
        camera: Camera::Left,
        truth: None,
        world_from_cam: BTreeMap::new(),
        streams: Vec::new(),
        warnings,
        untimed_poses: false,
        video: Some(video),
        folder,
    }
    .into_dataset()
    .map(|dataset| dataset.with_simulated(config.simulated))
}

/// The warning about a GoPro's video that was not filmed through the linear lens; `None` if the calibration includes a lens
/// distortion.
fn lens_warning(lens: &GoproLens, calibration: &CameraCalibration) -> Option<CameraWarning> {
    if lens.is_linear() || calibration.distortion != Distortion::default() {
        return None;
    }
    Some(CameraWarning::BendsLines {
        lens: name_of(lens),
        model: lens.model.clone(),
    })
}

/// The name of a lens in the GoPro's menu.
fn name_of(lens: &GoproLens) -> String {
    match lens.digital {
        'N' => "narrow".to_owned(),
        'W' => "wide".to_owned(),
        'S' => "SuperView".to_owned(),
        'H' => "HyperView".to_owned(),
        'M' => "max".to_owned(),
        other => other.to_string(),
    }
}

/// The error about a GoPro's video from which the camera cannot be derived.
fn no_pinhole(video: &Path, lens: &GoproLens) -> Error {
    let model = lens.model.clone();
    let problem = if lens.is_linear() {
        CameraProblem::LinearZoomed { model }
    } else {
        let lens = name_of(lens);
        CameraProblem::BendsLines { lens, model }
    };
    Error::CameraFile {
        by: video.into(),
        problem,
    }
}

/// The beginning of a video whose times count from 0, for speeds with dates. The recorder's date is that of the first or the last
/// frame; the choice that puts more of the video within the log is used. `None` if the video's times are dates themselves, or the log's are
/// not.
fn start_of(created_ns: i64, times: &[Option<i64>], log: (i64, i64)) -> Option<i64> {
    let first = (*times.first()?)?;
    let is_date = |ns: i64| TimeUnit::of_date(ns as f64).is_some();
    if is_date(first) || !is_date(log.0) {
        return None;
    }
    let length_ns = length_ns(times)?;
    let within = |start: i64| within_ns(start, length_ns, log);
    let from_end = created_ns.saturating_sub(length_ns);
    Some(if within(from_end) > within(created_ns) {
        from_end
    } else {
        created_ns
    })
}

/// The time from a video's first frame to its last, at least 1 ns, so that a video of a single frame is not empty.
fn length_ns(times: &[Option<i64>]) -> Option<i64> {
    let (first, last) = ((*times.first()?)?, (*times.last()?)?);
    Some(last.saturating_sub(first).max(1))
}

/// How much of a video that begins at `start_ns` is within a log.
fn within_ns(start_ns: i64, length_ns: i64, log: (i64, i64)) -> i64 {
    let end_ns = start_ns.saturating_add(length_ns).min(log.1);
    end_ns.saturating_sub(start_ns.max(log.0)).max(0)
}

/// The warning about a recorder's date, which is assumed to be UTC: if no part of the video is then within the log, or, for a GoPro, which
/// writes local time, if at least as much of it is within the log with another time zone.
fn zone_warning(
    created_ns: i64,
    times: &[Option<i64>],
    log: (i64, i64),
    gopro: Option<String>,
) -> Option<TimesWarning> {
    let length_ns = length_ns(times)?;
    let in_zone = |ahead_min: i64| {
        let utc_ns = created_ns.saturating_sub(ahead_min * MINUTE_NS);
        let start_ns = start_of(utc_ns, times, log)?;
        let within_ns = within_ns(start_ns, length_ns, log);
        (within_ns > 0).then_some(InZone {
            ahead_min,
            start_ns,
            within_ns,
        })
    };
    let zones: Vec<InZone> = zones_min().filter_map(in_zone).collect();
    let Some(utc) = zones.iter().find(|zone| zone.ahead_min == 0) else {
        let moved_ns = likeliest(&zones);
        return Some(TimesWarning::VideoBesideLog { moved_ns });
    };
    let fits_as_well = |zone: &&InZone| zone.within_ns >= utc.within_ns;
    let may_be_another = zones.iter().filter(fits_as_well).count() > 1;
    let model = gopro.filter(|_| may_be_another)?;
    Some(TimesWarning::LocalRecorder { model })
}

/// A video, on the assumption that its recorder's clock shows the time of some time zone.
struct InZone {
    /// How far that time zone is ahead of UTC, in minutes.
    ahead_min: i64,
    /// When the video then began, nanoseconds since 1970.
    start_ns: i64,
    /// How much of it is then within the log, in nanoseconds.
    within_ns: i64,
}

const MINUTE_NS: i64 = 60_000_000_000;

/// How far the world's time zones are ahead of UTC, in minutes.
fn zones_min() -> impl Iterator<Item = i64> {
    /// Offsets that are not whole hours, from the Marquesas to the Chatham Islands.
    const UNEVEN: [i64; 13] = [
        -570, -210, -150, 210, 270, 330, 345, 390, 525, 570, 630, 765, 825,
    ];
    (-12..=14).map(|hours| 60 * hours).chain(UNEVEN)
}

/// The beginning of a video in the time zone that puts most of it within the log. If several do, the only one with whole hours is used,
/// since most have these; `None` if it is not unique.
fn likeliest(zones: &[InZone]) -> Option<i64> {
    let most_ns = zones.iter().map(|zone| zone.within_ns).max()?;
    let alike = zones.iter().filter(|zone| zone.within_ns == most_ns);
    let whole = alike.clone().filter(|zone| zone.ahead_min % 60 == 0);
    let zone = only(whole).or_else(|| only(alike))?;
    Some(zone.start_ns)
}

/// The only item; `None` if there are none or several.
fn only<T>(mut all: impl Iterator<Item = T>) -> Option<T> {
    let first = all.next()?;
    all.next().is_none().then_some(first)
}

/// The frames of a video, kept in the cache folder of `dataset.toml`, otherwise beside the video or, if its folder is not writable, in the
/// user's cache folder, with a warning.
///
/// # Errors
/// [`Error::Video`], [`Error::NoPlaceForFrames`].
pub(crate) fn frames_of(
    file: &Path,
    config: &FolderConfig,
    warnings: &mut Vec<DataWarning>,
) -> Result<VideoFrames> {
    let beside = file.parent().unwrap_or(Path::new("."));
    let folder = match &config.cache {
        Some(named) => beside.join(named),
        None => folder_for_frames(file, dirs::cache_dir())?,
    };
    if config.cache.is_none() && folder != beside {
        let folder = folder.clone();
        warnings.push(DataWarning::FramesElsewhere { folder });
    }
    Ok(VideoFrames::open(file, &folder)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A minute of video whose recorder wrote local summer time, and logs in UTC.
    #[test]
    fn local_time_with_a_log_in_utc_gives_a_warning() {
        const S: i64 = 1_000_000_000;
        const H: i64 = 3600 * S;
        let day = 1_700_000_000 * S;
        let (half_an_hour, five_hours) = ((day, day + H / 2), (day, day + 5 * H));
        let times = [Some(0), Some(60 * S)];
        let warning = |created: i64, log: (i64, i64), gopro: Option<&str>| {
            zone_warning(created, &times, log, gopro.map(str::to_owned))
        };
        let began = day + 60 * S;
        let beside = |moved_ns| Some(TimesWarning::VideoBesideLog { moved_ns });
        assert_eq!(warning(began, half_an_hour, None), None);
        assert_eq!(
            warning(began + 2 * H, half_an_hour, None),
            beside(Some(began))
        );
        let in_india = began + 5 * H + H / 2;
        assert_eq!(warning(in_india, half_an_hour, None), beside(Some(began)));
        assert_eq!(warning(day - 9 * 24 * H, half_an_hour, None), beside(None));
        // Several time zones put the video within a long log, and none is likelier.
        assert_eq!(warning(began + 6 * H, five_hours, None), beside(None));
        // A video of a single frame can be within its log too.
        assert_eq!(zone_warning(day, &[Some(0)], half_an_hour, None), None);
    }

    /// A GoPro's clock may show UTC, which a short log can confirm.
    #[test]
    fn a_gopro_gives_a_warning_if_another_time_zone_is_possible() {
        const S: i64 = 1_000_000_000;
        const H: i64 = 3600 * S;
        let day = 1_700_000_000 * S;
        let times = [Some(0), Some(60 * S)];
        let warning = |log| zone_warning(day + 60 * S, &times, log, Some("HERO11 Black".into()));
        let model = "HERO11 Black".to_owned();
        let recorder = TimesWarning::LocalRecorder { model };
        assert_eq!(warning((day, day + H / 2)), None);
        assert_eq!(warning((day, day + 4 * H)), Some(recorder.clone()));
        // In the zone one hour off, first more, then less of it is within the log.
        assert_eq!(warning((day + 90 * S, day + 2 * H)), Some(recorder));
        assert_eq!(warning((day, day + H + 30 * S)), None);
    }

    /// A minute of video, with the date that each of the two kinds of recorders writes.
    #[test]
    fn a_video_begins_where_its_log_has_speeds() {
        const S: i64 = 1_000_000_000;
        let day = 1_700_000_000 * S;
        let times = [Some(0), Some(30 * S), Some(60 * S)];
        let log = (day, day + 60 * S);
        assert_eq!(
            start_of(day, &times, log),
            Some(day),
            "the date is that of the first frame"
        );
        assert_eq!(
            start_of(day + 60 * S, &times, log),
            Some(day),
            "the date is that of the last frame"
        );
        let longer = (day - 600 * S, day + 600 * S);
        assert_eq!(
            start_of(day, &times, longer),
            Some(day),
            "both fit: the first frame is used"
        );
        assert_eq!(
            start_of(day, &times, (0, 60 * S)),
            None,
            "the log's times count from 0 too"
        );
        let dates = times.map(|t| t.map(|t| t + day));
        assert_eq!(
            start_of(day, &dates, log),
            None,
            "the video's times are dates"
        );
        assert_eq!(start_of(day, &[None], log), None);
    }
}
