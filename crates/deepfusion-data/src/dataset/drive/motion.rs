//! Motion of a drive's vehicle and camera, with what images and a GPS receiver add to it.

use super::Dataset;
use crate::dataset::ego::{Ego, Receiver};
use crate::dataset::heading::Heading;
use crate::dataset::seen_turn::{self, SeenTurn};
use crate::dataset::warning::{DataWarning, MotionWarning, MountWarning};
use crate::{MotionModel, Result, VehicleTrack};
use deepfusion_geometry::Se3;

/// Interval between the samples of a track whose yaw rate comes from the course over ground, in seconds.
const COURSE_STEP_S: f64 = 0.1;

impl Dataset {
    /// The same data set, with its mount marked as assumed (the camera then looks straight ahead) or not.
    #[must_use]
    pub fn with_mount_assumed(mut self, assumed: bool) -> Self {
        self.mount_assumed = assumed;
        self
    }

    /// Whether the camera's viewing direction is only assumed: neither given nor [estimated from the images](Self::aim).
    #[must_use]
    pub fn mount_assumed(&self) -> bool {
        self.mount_assumed
    }

    /// Turns the camera on its vehicle to the viewing direction that its images show, also for motions between frames.
    /// Does nothing unless the mount is [assumed](Self::mount_assumed). A bag's scans are still moved to the frames' times with the
    /// assumed mount. The difference is millimetres for a few milliseconds, and centimetres for points with their own times, which may
    /// be a tenth of a second apart.
    pub fn aim(&mut self, heading: &Heading) {
        if let Some(cam_from_vehicle) = self.parts.cam_from_vehicle {
            self.aim_beside(heading, &cam_from_vehicle);
        }
    }

    /// Like [`Self::aim`], with the heading of another camera on the vehicle, whose mount was `cam_from_vehicle` before it was turned.
    /// The transform between the two cameras does not change.
    pub fn aim_beside(&mut self, heading: &Heading, cam_from_vehicle: &Se3) {
        if !self.mount_assumed {
            return;
        }
        let mount = self.parts.cam_from_vehicle.as_mut();
        if let Some(own_from_vehicle) = mount {
            let own_from_cam = *own_from_vehicle * cam_from_vehicle.inverse();
            *own_from_vehicle = own_from_cam * heading.turn() * *cam_from_vehicle;
            self.mount_assumed = false;
            self.warnings.retain(|warning| {
                !matches!(
                    warning,
                    DataWarning::Mount(MountWarning::NotGiven | MountWarning::CameraUnknown)
                )
            });
            self.warnings.push(MountWarning::Aimed(*heading).into());
        }
    }

    /// Whether the vehicle's speed is known, but not its roll and pitch.
    #[must_use]
    pub fn tilt_unknown(&self) -> bool {
        let track = self.parts.track.as_ref();
        track.is_some_and(MotionModel::lacks_tilt)
    }

    /// Adds the vehicle's turns estimated from its images, in the order of time: roll and pitch, and also yaw if no yaw rate was
    /// recorded. Does nothing if roll and pitch [are known](Self::tilt_unknown), if no turns are given, or if there is no yaw rate and
    /// turns are missing for a tenth of the pairs that moved, because a yaw with gaps is of no use.
    pub fn take_turns(&mut self, turns: &[SeenTurn]) {
        let yaw_known = self.parts.yaw_known;
        let enough = yaw_known || self.has_enough(turns);
        if !self.tilt_unknown() || turns.is_empty() || !enough {
            return;
        }
        let track = self.parts.track.take();
        self.parts.track = track.map(|track| seen_turn::with_turns(track, turns, yaw_known));
        self.parts.yaw_known = true;
        self.warnings.retain(|warning| {
            !matches!(
                warning,
                DataWarning::Motion(
                    MotionWarning::NoYawRate { .. } | MotionWarning::YawNotMeasured
                )
            )
        });
        let images = self.frames().len();
        let warning = seen_turn::warning(turns, images, yaw_known);
        self.warnings.push(warning.into());
    }

    /// Whether there are turns for at least nine tenths of the neighbouring pairs in which the vehicle moved.
    fn has_enough(&self, turns: &[SeenTurn]) -> bool {
        /// Below this speed the vehicle counts as standing still, m/s.
        const STANDING: f64 = 0.5;
        let Ok(ego) = self.ego() else { return false };
        let moves = |(from_s, to_s): (f64, f64)| {
            let motion = ego.vehicle_motion(from_s, to_s);
            motion.is_some_and(|motion| motion.distance_m.abs() > STANDING * (to_s - from_s))
        };
        let pairs = self.frames().windows(2);
        let pairs = pairs.filter_map(|pair| pair[0].time_s.zip(pair[1].time_s));
        let moving = pairs.filter(|pair| moves(*pair)).count();
        let seen = turns.iter().filter(|turn| moves((turn.from_s, turn.to_s)));
        10 * seen.count() >= 9 * moving
    }

    /// The same data set with a GPS receiver's measurements other than speed.
    #[must_use]
    pub fn with_receiver(mut self, receiver: Receiver) -> Self {
        self.receiver = receiver;
        self
    }

    /// The same data set with the yaw rate from its GPS receiver's course, if it has no other. Only for comparing clocks, not for
    /// training, since a course is smoothed over about a second. `None` if it already has a yaw rate, or has no course.
    #[must_use]
    pub fn turning_as_its_course(&self) -> Option<Self> {
        let track = self.parts.track.as_ref().filter(|_| !self.yaw_known())?;
        let course = self.receiver.course_rate_radps.as_ref()?;
        let times = course.times_s();
        let (first, last) = (*times.first()?, *times.last()?);
        let steps = ((last - first) / COURSE_STEP_S).floor().max(0.0) as usize;
        let sample = |step: usize| {
            let time_s = first + step as f64 * COURSE_STEP_S;
            Some((time_s, track.speed_at(time_s)?, course.at(time_s)?))
        };
        let samples: Vec<_> = (0..=steps).filter_map(sample).collect();
        let mut turning = self.clone();
        turning.parts.track = Some(VehicleTrack::new(&samples).into());
        turning.parts.yaw_known = true;
        Some(turning)
    }

    /// A GPS receiver's measurements other than speed; all absent without a receiver.
    #[must_use]
    pub fn receiver(&self) -> &Receiver {
        &self.receiver
    }

    /// The transform from the camera of frame `to` to the camera of frame `from` (`from_from_to`, metres), from the vehicle's speed and
    /// yaw rate; `None` if either was not recorded, or the frames have no times.
    ///
    /// # Panics
    /// If there is no frame with one of the indices.
    #[must_use]
    pub fn camera_motion(&self, from: usize, to: usize) -> Option<Se3> {
        let motion = self.ego().ok()?.between(self.frames(), to, from).ok()?;
        motion.source_from_target
    }

    /// The vehicle's track and the camera's mount, from which the camera's motion is computed.
    ///
    /// # Errors
    /// [`crate::Error::Missing`] or [`crate::Error::NoTrack`] if one of them is missing.
    pub fn ego(&self) -> Result<Ego<'_>> {
        let timed = self.frames().iter().any(|f| f.time_s.is_some());
        match (&self.parts.track, self.parts.cam_from_vehicle) {
            (Some(track), Some(cam_from_vehicle)) if timed => Ok(Ego {
                track,
                yaw_known: self.parts.yaw_known,
                cam_from_vehicle,
                speed_sigma_mps: self.receiver.speed_sigma_mps.as_ref(),
                rolls_and_pitches: true,
            }),
            _ => Err(self.recording.no_motion()),
        }
    }
}
