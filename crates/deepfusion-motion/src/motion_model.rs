use crate::{FusedTrack, VehicleMotion, VehicleTrack};

/// A vehicle's motion over a recording, whichever sensors it has.
#[derive(Debug, Clone, PartialEq)]
pub enum MotionModel {
    /// One unit that measures speed and yaw rate (KITTI's oxts).
    Track(Box<VehicleTrack>),
    /// Speed, steering and inertial unit, each with its own clock rate.
    Fused(Box<FusedTrack>),
}

impl MotionModel {
    /// Times of the speed's samples, in seconds, ascending.
    #[must_use]
    pub fn times_s(&self) -> &[f64] {
        match self {
            Self::Track(track) => track.times_s(),
            Self::Fused(track) => track.times_s(),
        }
    }

    /// Forward speed at a time, in m/s; `None` if unknown.
    #[must_use]
    pub fn speed_at(&self, time_s: f64) -> Option<f64> {
        match self {
            Self::Track(track) => track.speed_at(time_s),
            Self::Fused(track) => track.speed_at(time_s),
        }
    }

    /// Roll (the left side up) and pitch (the nose down) at a time, in radians; `None` if nothing measures them.
    #[must_use]
    pub fn tilt(&self, time_s: f64) -> Option<[f64; 2]> {
        match self {
            Self::Track(track) => track.tilt(time_s),
            Self::Fused(track) => track.tilt(time_s),
        }
    }

    /// Whether it is a track of one unit that does not measure roll and pitch. Of several sensors that is an inertial unit's part, and
    /// nothing is put in its place.
    #[must_use]
    pub fn lacks_tilt(&self) -> bool {
        matches!(self, Self::Track(track) if !track.has_tilt())
    }

    /// A track of one unit with these samples of roll and pitch (time in s, then as [`Self::tilt`]); others stay as they are.
    #[must_use]
    pub fn with_tilt(self, samples: &[(f64, f64, f64)]) -> Self {
        match self {
            Self::Track(track) => Self::Track(Box::new(track.with_tilt(samples))),
            Self::Fused(_) => self,
        }
    }

    /// A track of one unit with these samples of its yaw rate (time in s, rad/s, positive to the left); others stay as they are.
    #[must_use]
    pub fn with_yaw_rate(self, samples: &[(f64, f64)]) -> Self {
        match self {
            Self::Track(track) => Self::Track(Box::new(track.with_yaw_rate(samples))),
            Self::Fused(_) => self,
        }
    }

    /// The vehicle's motion between two times; `None` across gaps, outside the recording, and
    /// backwards in time.
    #[must_use]
    pub fn motion(&self, from_s: f64, to_s: f64) -> Option<VehicleMotion> {
        match self {
            Self::Track(track) => track.motion(from_s, to_s),
            Self::Fused(track) => track.motion(from_s, to_s),
        }
    }
}

impl From<VehicleTrack> for MotionModel {
    fn from(track: VehicleTrack) -> Self {
        Self::Track(Box::new(track))
    }
}

impl From<FusedTrack> for MotionModel {
    fn from(track: FusedTrack) -> Self {
        Self::Fused(Box::new(track))
    }
}
