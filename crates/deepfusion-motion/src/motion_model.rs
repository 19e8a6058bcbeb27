use crate::{FusedTrack, VehicleMotion, VehicleTrack};

/// A vehicle's motion over a recording, whichever sensors it has.
#[derive(Debug, Clone, PartialEq)]
pub enum MotionModel {
    /// One unit that measures speed and yaw rate (KITTI's oxts).
    Track(Box<VehicleTrack>),
    /// Speed, steering and inertial unit, each with its own sample rate.
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

    /// Roll (the left side up) and pitch (the nose down) at a time, in radians; `None` if not measured.
    #[must_use]
    pub fn tilt(&self, time_s: f64) -> Option<[f64; 2]> {
        match self {
            Self::Track(track) => track.tilt(time_s),
            Self::Fused(track) => track.tilt(time_s),
        }
    }

    /// Whether roll and pitch are unknown and may be taken from another source. For several sensors: whether none of them measures
    /// rotation.
    #[must_use]
    pub fn lacks_tilt(&self) -> bool {
        match self {
            Self::Track(track) => !track.has_tilt(),
            Self::Fused(track) => !track.knows_yaw(),
        }
    }

    /// Its speed as the track of one unit, with the yaw rate if one unit measures both.
    #[must_use]
    pub fn into_track(self) -> VehicleTrack {
        match self {
            Self::Track(track) => *track,
            Self::Fused(track) => {
                let speed = track.speed();
                let samples = speed.times_s().iter().zip(speed.values());
                let samples: Vec<_> = samples.map(|(t, v)| (*t, *v, 0.0)).collect();
                VehicleTrack::new(&samples)
            }
        }
    }

    /// The vehicle's motion between two times; `None` across gaps, outside the recording, and backwards in time.
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
