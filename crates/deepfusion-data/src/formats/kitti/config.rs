//! `dataset.toml` of a KITTI drive: corrections of its clock and speeds, which of its values are unknown, and whether it is simulated.

use crate::dataset_toml::{Clock, FolderConfig, check_clock_and_scale, read_or_default};
use crate::{Error, OpenOptions, Result};
use serde::Deserialize;
use std::path::Path;

/// The keys allowed beside KITTI's own files; any other is an error.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Keys {
    clock: ClockKeys,
    vehicle: VehicleKeys,
    simulated: Option<bool>,
    yaw_known: Option<bool>,
    tilt_known: Option<bool>,
    mount_known: Option<bool>,
}

/// The table `[clock]`.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct ClockKeys {
    /// How far the cameras' clock is ahead of the oxts', in seconds.
    camera_ahead_s: Option<f64>,
}

/// The table `[vehicle]`.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct VehicleKeys {
    /// True speed / measured speed.
    speed_scale: Option<f64>,
}

/// A drive's clock offset and speed scale, and which of its values are known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DriveConfig {
    /// How far the cameras' clock is ahead of the oxts', in seconds.
    pub(super) camera_ahead_s: f64,
    /// True speed / speed in the oxts.
    pub(super) speed_scale: f64,
    /// Whether the oxts' yaw rates were measured; a drive converted from another layout may have none.
    pub(super) yaw_known: bool,
    /// Whether the oxts' roll and pitch were measured.
    pub(super) tilt_known: bool,
    /// Whether the camera's mount in the calibration is known; a drive converted from another layout may have none.
    pub(super) mount_known: bool,
}

/// Whether the drive in a folder is simulated, according to `dataset.toml` in that folder, otherwise in its date's. `None` if neither sets
/// it or can be read.
pub(super) fn marked_as_simulated(drive: &Path) -> Option<bool> {
    Keys::of(drive).ok()?.simulated
}

impl Keys {
    /// Each key from `dataset.toml` in the drive's folder, otherwise from the one in its date's folder.
    ///
    /// # Errors
    /// [`Error::Config`], [`Error::File`].
    fn of(drive: &Path) -> Result<Self> {
        let own = Self::read(drive)?;
        let date = drive.parent().map(Self::read);
        let date = date.transpose()?.unwrap_or_default();
        Ok(Self {
            clock: ClockKeys {
                camera_ahead_s: own.clock.camera_ahead_s.or(date.clock.camera_ahead_s),
            },
            vehicle: VehicleKeys {
                speed_scale: own.vehicle.speed_scale.or(date.vehicle.speed_scale),
            },
            simulated: own.simulated.or(date.simulated),
            yaw_known: own.yaw_known.or(date.yaw_known),
            tilt_known: own.tilt_known.or(date.tilt_known),
            mount_known: own.mount_known.or(date.mount_known),
        })
    }

    /// The keys of one folder's file; none without a file.
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
    /// The settings from the files of the drive and of its date, if any; the options take precedence.
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
