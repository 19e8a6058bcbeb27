//! `dataset.toml` of a KITTI drive: what of its clock and its speeds is known better than its files say, what was not measured or is not known, and whether it is simulated.

use crate::dataset_toml::{Clock, FolderConfig, check_clock_and_scale, read_or_default};
use crate::{Error, OpenOptions, Result};
use serde::Deserialize;
use std::path::Path;

/// The keys that mean something beside KITTI's own files; any other is an error.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Keys {
    clock: Ahead,
    vehicle: Speed,
    simulated: Option<bool>,
    yaw_known: Option<bool>,
    tilt_known: Option<bool>,
    mount_known: Option<bool>,
}

/// The cameras' clock.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Ahead {
    /// How far it is ahead of the oxts', in seconds.
    camera_ahead_s: Option<f64>,
}

/// The vehicle's speed.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Speed {
    /// True speed over the vehicle's.
    speed_scale: Option<f64>,
}

/// A drive's clock and scale of speed, and what of its oxts was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DriveConfig {
    /// How far the cameras' clock is ahead of the oxts', in seconds.
    pub(super) camera_ahead_s: f64,
    /// True speed over the oxts'.
    pub(super) speed_scale: f64,
    /// Whether the oxts' yaw rates were measured: another layout's drive may have had none.
    pub(super) yaw_known: bool,
    /// Whether its roll and pitch were.
    pub(super) tilt_known: bool,
    /// Whether its calibration says where the camera is: another layout's drive may have said nothing of it.
    pub(super) mount_known: bool,
}

/// Whether the drive in a folder is simulated, as `dataset.toml` of that folder or else of its date's says. Files that cannot be read say nothing.
pub(super) fn says_simulated(drive: &Path) -> Option<bool> {
    Keys::of(drive).ok()?.simulated
}

impl Keys {
    /// Each as `dataset.toml` in the drive's folder has it, else as the one in its date's.
    ///
    /// # Errors
    /// [`Error::Config`], [`Error::File`].
    fn of(drive: &Path) -> Result<Self> {
        let own = Self::read(drive)?;
        let date = drive.parent().map(Self::read);
        let date = date.transpose()?.unwrap_or_default();
        Ok(Self {
            clock: Ahead {
                camera_ahead_s: own.clock.camera_ahead_s.or(date.clock.camera_ahead_s),
            },
            vehicle: Speed {
                speed_scale: own.vehicle.speed_scale.or(date.vehicle.speed_scale),
            },
            simulated: own.simulated.or(date.simulated),
            yaw_known: own.yaw_known.or(date.yaw_known),
            tilt_known: own.tilt_known.or(date.tilt_known),
            mount_known: own.mount_known.or(date.mount_known),
        })
    }

    /// Those of one folder; without a file none.
    fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(FolderConfig::NAME);
        let keys: Self = read_or_default(&path)?;
        let clock = Clock {
            camera_ahead_s: keys.clock.camera_ahead_s.unwrap_or_default(),
        };
        check_clock_and_scale(clock, keys.vehicle.speed_scale)
            .map_err(|problem| Error::Config { path, problem })?;
        Ok(keys)
    }
}

impl DriveConfig {
    /// What the files of the drive and of its date say; without one nothing is said. What the options give goes before them.
    ///
    /// # Errors
    /// [`Error::Config`], [`Error::File`].
    pub(super) fn of(drive: &Path, options: &OpenOptions) -> Result<Self> {
        let keys = Keys::of(drive)?;
        let ahead = options.camera_ahead_s.or(keys.clock.camera_ahead_s);
        Ok(Self {
            camera_ahead_s: ahead.unwrap_or_default(),
            speed_scale: keys.vehicle.speed_scale.unwrap_or(1.0),
            yaw_known: keys.yaw_known.unwrap_or(true),
            tilt_known: keys.tilt_known.unwrap_or(true),
            mount_known: keys.mount_known.unwrap_or(true),
        })
    }
}
