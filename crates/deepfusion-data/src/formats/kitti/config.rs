//! `dataset.toml` of a KITTI drive: what of its clock and its speeds is known better than its files say, and whether it is simulated.

use super::layout::Drive;
use crate::dataset_toml::{Clock, check_clock_and_scale, read_or_default};
use crate::{Error, OpenOptions, Result};
use serde::Deserialize;

/// The keys that mean something beside KITTI's own files; any other is an error.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Keys {
    clock: Clock,
    vehicle: Speed,
    simulated: bool,
}

/// The vehicle's speed.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Speed {
    /// True speed over the vehicle's.
    speed_scale: Option<f64>,
}

/// A drive's clock and scale of speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DriveConfig {
    /// How far the cameras' clock is ahead of the oxts', in seconds.
    pub(super) camera_ahead_s: f64,
    /// True speed over the oxts'.
    pub(super) speed_scale: f64,
}

/// Whether `dataset.toml` of the drive's folder or of its date's says that the drive is simulated. One that cannot be read says nothing.
pub(super) fn says_simulated(drive: &Drive) -> bool {
    let places = drive.folder.ancestors().take(2);
    let mut files = places.filter_map(|p| read_or_default::<Keys>(&p.join(DriveConfig::NAME)).ok());
    files.any(|keys| keys.simulated)
}

impl DriveConfig {
    const NAME: &str = "dataset.toml";

    /// Reads `dataset.toml` in the drive's folder, else in its date's; without one nothing is said. What the options give
    /// goes before it.
    ///
    /// # Errors
    /// [`Error::Config`], [`Error::File`].
    pub(super) fn of(drive: &Drive, options: &OpenOptions) -> Result<Self> {
        let mut places = drive.folder.ancestors().take(2).map(|p| p.join(Self::NAME));
        let path = places.find(|path| path.is_file());
        let keys: Keys = match &path {
            Some(path) => read_or_default(path)?,
            None => Keys::default(),
        };
        let path = path.unwrap_or_default();
        check_clock_and_scale(keys.clock, keys.vehicle.speed_scale)
            .map_err(|problem| Error::Config { path, problem })?;
        Ok(Self {
            camera_ahead_s: options.camera_ahead_s.unwrap_or(keys.clock.camera_ahead_s),
            speed_scale: keys.vehicle.speed_scale.unwrap_or(1.0),
        })
    }
}
