//! The times of the images in a folder, and which of them are neighbours.

use super::clock::{TimeUnit, seconds};
use super::date_time;
use super::table::Table;
use super::times::times;
use crate::dataset_toml::FolderConfig;
use crate::{
    ColumnsProblem, DataWarning, Error, ExpectedCell, IncompleteWarning, Result, TableProblem,
    TimeStampProblem, TimesWarning,
};
use deepfusion_fs::natural_order;
use deepfusion_logs::parse_date;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

const TABLE: &str = "frames.csv";
/// A header of that table.
const HEADER: &str = "time_s,file";
const LISTS: [&str; 2] = ["timestamps.txt", "times.txt"];

/// An image with its number and its time on the recording's clock, in nanoseconds.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TimedImage {
    pub(crate) number: u64,
    pub(crate) path: PathBuf,
    pub(crate) ns: Option<i64>,
}

/// The images ordered by number.
///
/// Times come from `frames.csv` (columns time and file), from the lines of `timestamps.txt` or `times.txt`,
/// from `fps` in `dataset.toml`, or from the files' names if these are dates (1403636579763555584.png,
/// 1305031102.175304.png). Numbers are those in the files' names, unless these are dates. Otherwise they count
/// from 0, and a pause takes as many numbers as frames are missing in it.
///
/// # Errors
/// [`Error::Table`], [`Error::Columns`], [`Error::TimeStamp`], [`Error::NoTimeStamp`].
pub(crate) fn timed_images(
    folder: &Path,
    images: Vec<PathBuf>,
    config: &FolderConfig,
    warnings: &mut Vec<DataWarning>,
) -> Result<Vec<TimedImage>> {
    let mut images = in_order(images);
    let table = folder.join(TABLE);
    let list = LISTS.map(|name| folder.join(name));
    let dates = name_dates(&images);
    let times: Vec<Option<i64>> = if table.is_file() {
        let (listed, ns) = from_table(&table, &images, config, warnings)?;
        images = listed;
        ns
    } else if let Some(list) = list.iter().find(|l| l.is_file()) {
        from_list(list, images.len(), config, warnings)?
            .into_iter()
            .map(Some)
            .collect()
    } else if let Some(fps) = config.fps {
        // Names that are dates are not frame numbers.
        let numbers = match dates {
            Some(_) => (0..images.len() as u64).collect(),
            None => numbers(&images, None),
        };
        let ns = |n: &u64| Some((*n as f64 / fps * 1e9).round() as i64);
        numbers.iter().map(ns).collect()
    } else if let Some((dates, unit)) = &dates {
        let unit = unit.symbol();
        warnings.push(TimesWarning::ImagesByName { unit }.into());
        dates.iter().copied().map(Some).collect()
    } else {
        warnings.push(TimesWarning::ImagesUntimed.into());
        vec![None; images.len()]
    };
    let times = from_start(times, config.start_s);
    let known: Option<Vec<i64>> = times.iter().copied().collect();
    let by_time = known.filter(|_| dates.is_some() || !have_numbers(&images));
    let numbers = numbers(&images, by_time.as_deref());
    let images = images.into_iter().zip(numbers).zip(times);
    let timed = images.map(|((path, number), ns)| TimedImage { number, path, ns });
    Ok(timed.collect())
}

/// The times, shifted so that the first is at `start_s`.
pub(crate) fn from_start(times: Vec<Option<i64>>, start_s: Option<f64>) -> Vec<Option<i64>> {
    let (Some(start_s), Some(Some(first))) = (start_s, times.first().copied()) else {
        return times;
    };
    let shift = ((start_s * 1e9) as i64).saturating_sub(first);
    let moved = |t: Option<i64>| t.map(|ns| ns.saturating_add(shift));
    times.into_iter().map(moved).collect()
}

fn stem(path: &Path) -> &str {
    path.file_stem().and_then(|s| s.to_str()).unwrap_or("")
}

/// The file's name as a number.
fn number(path: &Path) -> Option<u64> {
    let stem = stem(path);
    stem.bytes()
        .all(|b| b.is_ascii_digit())
        .then(|| stem.parse().ok())?
}

fn have_numbers(images: &[PathBuf]) -> bool {
    images.iter().all(|path| number(path).is_some())
}

/// The images ordered by number if all names are numbers, otherwise in natural order of their names.
fn in_order(mut images: Vec<PathBuf>) -> Vec<PathBuf> {
    if have_numbers(&images) {
        images.sort_by_cached_key(|path| (number(path), path.clone()))
    } else {
        images.sort_by(|a, b| natural_order(a, b))
    }
    images
}

/// The times in the files' names, if all are dates in the same unit.
fn name_dates(images: &[PathBuf]) -> Option<(Vec<i64>, TimeUnit)> {
    let unit = TimeUnit::of_date(stem(images.first()?).parse().ok()?)?;
    let date = |path: &PathBuf| {
        let stem = stem(path);
        (TimeUnit::of_date(stem.parse().ok()?) == Some(unit)).then(|| unit.nanoseconds(stem))?
    };
    let dates: Option<Vec<i64>> = images.iter().map(date).collect();
    Some((dates?, unit))
}

/// The numbers in the files' names; otherwise numbers by time, or from 0.
fn numbers(images: &[PathBuf], times_ns: Option<&[i64]>) -> Vec<u64> {
    if let Some(times) = times_ns {
        return numbers_by_time(times);
    }
    let own: Option<Vec<u64>> = images.iter().map(|path| number(path)).collect();
    let rising = own.filter(|own| own.windows(2).all(|w| w[0] < w[1]));
    rising.unwrap_or_else(|| (0..images.len() as u64).collect())
}

/// Most numbers that are left out in a pause.
const MAX_MISSING: f64 = 1e5;

/// Frame numbers that leave out as many numbers as frames are missing in a pause.
pub(crate) fn numbers_by_time(times_ns: &[i64]) -> Vec<u64> {
    let steps: Vec<f64> = times_ns.windows(2).map(|w| seconds(w[1], w[0])).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let mut numbers = Vec::with_capacity(times_ns.len());
    let mut next = 0_u64;
    numbers.extend(times_ns.first().map(|_| 0));
    for step in steps {
        let frames = if median > 0.0 {
            (step / median).round()
        } else {
            1.0
        };
        // Limit long breaks, so that loops over all numbers do not take forever.
        next += frames.clamp(1.0, MAX_MISSING) as u64;
        numbers.push(next);
    }
    numbers
}

/// The images listed in `frames.csv`, with their times.
fn from_table(
    path: &Path,
    images: &[PathBuf],
    config: &FolderConfig,
    warnings: &mut Vec<DataWarning>,
) -> Result<(Vec<PathBuf>, Vec<Option<i64>>)> {
    let table = Table::read(path)?;
    let ns = times(&table, config, warnings, TABLE, HEADER)?;
    let column = table.require(&["file", "filename", "image", "name", "path"], HEADER)?;
    let by_name: HashMap<&str, &PathBuf> = images
        .iter()
        .filter_map(|p| Some((p.file_name()?.to_str()?, p)))
        .collect();
    let mut listed = Vec::with_capacity(ns.len());
    for (row, word) in table.words(column).enumerate() {
        let name = word.rsplit(['/', '\\']).next().unwrap_or(word);
        let image = by_name
            .get(name)
            .ok_or_else(|| table.bad(row, column, TableProblem::not(ExpectedCell::Image, word)))?;
        listed.push((*image).clone());
    }
    let unlisted = images.len().saturating_sub(listed.len());
    if unlisted > 0 {
        let unlisted = IncompleteWarning::ImagesUnlisted {
            table: TABLE,
            images: unlisted,
        };
        warnings.push(unlisted.into());
    }
    Ok((listed, ns.into_iter().map(Some).collect()))
}

/// The times in a list, one per line; there must be as many as images.
fn from_list(
    path: &Path,
    images: usize,
    config: &FolderConfig,
    warnings: &mut Vec<DataWarning>,
) -> Result<Vec<i64>> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
    let lines = text
        .lines()
        .enumerate()
        .filter(|(_, l)| !l.trim_start().starts_with('#'));
    let lines: Vec<(usize, &str)> = lines.filter(|(_, l)| !l.trim().is_empty()).collect();
    let bad = |line: usize, problem: TimeStampProblem| Error::TimeStamp {
        path: path.to_owned(),
        line: line + 1,
        problem,
    };
    if lines.len() != images {
        return Err(Error::Columns {
            path: path.to_owned(),
            problem: ColumnsProblem::TimesOfImages {
                times: lines.len(),
                images,
            },
        });
    }
    let number = |text: &str| text.trim().parse::<f64>().ok();
    // The first line determines whether the times are numbers or dates, as in KITTI or in other forms.
    let dates = lines.first().is_some_and(|(_, l)| number(l).is_none());
    let numbers: Vec<f64> = lines.iter().map_while(|(_, l)| number(l)).collect();
    let unit = match &config.time_unit {
        _ if dates => None,
        Some(name) => TimeUnit::named(name),
        None => TimeUnit::of_numbers(&numbers),
    };
    if unit.is_none() && !dates && numbers.len() == lines.len() {
        return Err(Error::Columns {
            path: path.to_owned(),
            problem: ColumnsProblem::NoUnitOfTimes,
        });
    }
    let mut times = Vec::with_capacity(lines.len());
    let mut zoned = None;
    for (line, text) in &lines {
        let ns = if dates {
            let plain = || Some((date_time::parse(text).ok()?, false));
            // Dates with and without a time zone would be on two clocks.
            let alike = |(_, own): &(i64, bool)| *zoned.get_or_insert(*own) == *own;
            let date = plain().or_else(|| parse_date(text)).filter(alike);
            date.map(|(ns, _)| ns)
        } else {
            // If the unit is unknown because a line is not a number, report that line.
            number(text).and_then(|_| unit.unwrap_or(TimeUnit::Seconds).nanoseconds(text))
        };
        let text = text.trim();
        let ns = ns.ok_or_else(|| {
            let text = text.chars().take(40).collect();
            bad(*line, TimeStampProblem::NotATime { text })
        })?;
        if times.last().is_some_and(|last| ns <= *last) {
            let text = text.to_owned();
            return Err(bad(*line, TimeStampProblem::NotAfter { text }));
        }
        times.push(ns);
    }
    if zoned == Some(false) {
        let log = path.file_name().unwrap_or_default();
        let log = log.to_string_lossy().into_owned();
        warnings.push(TimesWarning::NoZone { log }.into());
    }
    Ok(times)
}

#[cfg(test)]
#[path = "frame_times_tests.rs"]
mod tests;
