//! How a drive's vehicle and camera moved, and what images and a receiver add to that.

use super::Dataset;
use crate::dataset::ego::{Ego, Receiver};
use crate::dataset::heading::Heading;
use crate::dataset::seen_turn::{self, SeenTurn};
use crate::dataset::warning::{DataWarning, MotionWarning, MountWarning};
use crate::{MotionModel, Result, VehicleTrack};
use deepfusion_geometry::Se3;

/// Between the samples of a track whose turns are those of a course, in seconds.
const COURSE_STEP_S: f64 = 0.1;

impl Dataset {
    /// With a mount that nothing says, so that the camera is taken to look straight ahead, or one that something does.
    #[must_use]
    pub fn with_mount_assumed(mut self, assumed: bool) -> Self {
        self.mount_assumed = assumed;
        self
    }

    /// Whether nothing says where the camera looks from the vehicle, nor has it been [aimed](Self::aim).
    #[must_use]
    pub fn mount_assumed(&self) -> bool {
        self.mount_assumed
    }

    /// Turns the camera on its vehicle to where its images show that it looks: motions between frames then have that direction.
    /// Nothing happens where the mount is not [assumed](Self::mount_assumed). A bag's scans are still brought to the frames' times by the
    /// motion of the mount that was assumed: over milliseconds these differ by millimetres, over the tenth of a second that a scan's points
    /// with times of their own may be apart by centimetres.
    pub fn aim(&mut self, heading: &Heading) {
        if let Some(cam_from_vehicle) = self.parts.cam_from_vehicle {
            self.aim_beside(heading, &cam_from_vehicle);
        }
    }

    /// As [`Self::aim`], by what the images of another camera on the vehicle show, whose mount was `cam_from_vehicle` before that one was aimed:
    /// where the two cameras are to each other stays as it is.
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

    /// Whether nothing says how the vehicle rolls and pitches, though its speed is known.
    #[must_use]
    pub fn tilt_unknown(&self) -> bool {
        let track = self.parts.track.as_ref();
        track.is_some_and(MotionModel::lacks_tilt)
    }

    /// With the vehicle's turns as its images show them, in the order of time: roll and pitch, and where no yaw rate was recorded the turns
    /// to the side as well. Nothing happens where [they are known](Self::tilt_unknown), where none are given, and without a yaw rate where
    /// those of a tenth of the pairs that moved are missing: a drive with holes in it is no better known.
    pub fn take_turns(&mut self, turns: &[SeenTurn]) {
        let yaw_known = self.parts.yaw_known;
        let enough = yaw_known || self.shows_enough(turns);
        if !self.tilt_unknown() || turns.is_empty() || !enough {
            return;
        }
        let track = self.parts.track.take();
        self.parts.track = track.map(|track| seen_turn::put_into(track, turns, yaw_known));
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
        let taken = seen_turn::warning(turns, images, yaw_known);
        self.warnings.push(taken.into());
    }

    /// Whether these are the turns of nine tenths of the neighbours between which the vehicle moved.
    fn shows_enough(&self, turns: &[SeenTurn]) -> bool {
        /// Slower than this it stands, m/s.
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

    /// With what a satellite receiver says beside the speeds.
    #[must_use]
    pub fn with_receiver(mut self, receiver: Receiver) -> Self {
        self.receiver = receiver;
        self
    }

    /// The same with the turns of its receiver's course for a yaw rate, where it has no other: to compare clocks by, not to train
    /// on, since a course is spread over a second or so. `None` where it has a yaw rate, or no course.
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

    /// What a satellite receiver says beside the speeds; nothing where there is none.
    #[must_use]
    pub fn receiver(&self) -> &Receiver {
        &self.receiver
    }

    /// The camera of frame `to` in the camera of frame `from` (`from_from_to`, metres), from the vehicle's speed and yaw
    /// rate; `None` where either was not recorded, or the frames have no times.
    ///
    /// # Panics
    /// If there is no frame of such an index.
    #[must_use]
    pub fn camera_motion(&self, from: usize, to: usize) -> Option<Se3> {
        let motion = self.ego().ok()?.between(self.frames(), to, from).ok()?;
        motion.source_from_target
    }

    /// What the camera's motion is made from.
    ///
    /// # Errors
    /// What is missing for it: [`crate::Error::Missing`] or [`crate::Error::NoTrack`].
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
