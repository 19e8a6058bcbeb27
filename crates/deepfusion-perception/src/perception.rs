use crate::detect::detect_turned;
use crate::edges::without_flying_pixels;
use crate::parking::{Parking, View};
use crate::tracking::{FrameContext, Tracker};
use crate::{
    Detection, Error, Ground, Instance, Obstacles, PerceptionConfig, Rays, Result, Target,
};
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};

/// Time and pose of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamp {
    /// Seconds, on any monotonic clock.
    pub time_s: f64,
    /// Pose of the camera in a fixed frame, in metres; the fixed frame may be that of the first camera.
    pub world_from_cam: Se3,
}

/// The result for one frame.
#[derive(Debug, Clone, Default)]
pub struct Surroundings {
    /// The ground; `None` if none was found, and then there are no targets.
    pub ground: Option<Ground>,
    /// The boxes of this image alone.
    pub detections: Vec<Detection>,
    /// The targets, in order of distance.
    pub targets: Vec<Target>,
}

/// Turns a sequence of depth images into tracked targets.
///
/// Its buffers grow to an image's size once. Its only state is the last ground, the tracks and the rows of parked cars.
#[derive(Debug, Default)]
pub struct Perception {
    config: PerceptionConfig,
    tracker: Tracker,
    ground: Option<Ground>,
    rays: Option<(Intrinsics, Rays)>,
    obstacles: Obstacles,
    /// The rows of parked cars, if [`PerceptionConfig::parking_rows`] is set.
    parking: Parking,
}

impl Perception {
    /// A perception with these settings.
    #[must_use]
    pub fn new(config: PerceptionConfig) -> Self {
        Self {
            config,
            ..Self::default()
        }
    }

    /// Its settings.
    #[must_use]
    pub fn config(&self) -> &PerceptionConfig {
        &self.config
    }

    /// Heights of the obstacles in the last image.
    #[must_use]
    pub fn obstacles(&self) -> &Obstacles {
        &self.obstacles
    }

    /// Drops all tracks and remembered cars: the next image does not continue the last one.
    pub fn reset(&mut self) {
        self.tracker.reset();
        self.parking.reset();
        self.ground = None;
    }

    /// Finds the targets in a depth image from a camera `k` (of the same size). Without a `stamp` the image is independent of others: every
    /// target has a new id and no velocity.
    ///
    /// Pixels without depth, or with NaN or infinity, are ignored.
    ///
    /// # Errors
    /// [`Error::Size`] if the depth does not have the camera's size, [`Error::Camera`] if `k` is implausible.
    pub fn detect(
        &mut self,
        depth: &DepthMap,
        k: &Intrinsics,
        stamp: Option<Stamp>,
    ) -> Result<Surroundings> {
        self.detect_with_instances(depth, k, stamp, &[])
    }

    /// As [`Self::detect`], with instances from a segmentation model. Each becomes a target with its class, if its depth allows it; all
    /// other targets are found by depth alone.
    ///
    /// # Errors
    /// As [`Self::detect`], and [`Error::Instance`] for pixels outside the depth image.
    pub fn detect_with_instances(
        &mut self,
        depth: &DepthMap,
        k: &Intrinsics,
        stamp: Option<Stamp>,
        instances: &[Instance],
    ) -> Result<Surroundings> {
        self.detect_with_sigma(depth, None, k, stamp, instances)
    }

    /// As [`Self::detect_with_instances`], with each pixel's standard deviation of depth (metres, same size). The uncertainty of a target's
    /// position, and with it the tracker's gate, follows from its own pixels; [`PerceptionConfig::relative_error`] is used for pixels
    /// without a standard deviation.
    ///
    /// # Errors
    /// As [`Self::detect_with_instances`].
    pub fn detect_with_sigma(
        &mut self,
        depth: &DepthMap,
        sigma: Option<&DepthMap>,
        k: &Intrinsics,
        stamp: Option<Stamp>,
        instances: &[Instance],
    ) -> Result<Surroundings> {
        check(depth, sigma, k, instances)?;
        if self.rays.as_ref().is_none_or(|(before, _)| before != k) {
            self.rays = Some((*k, Rays::of(k)));
            self.ground = None;
        }
        let Some((_, rays)) = &self.rays else {
            return Ok(Surroundings::default());
        };
        let cleaned;
        let depth = if self.config.edge_jump > 0.0 {
            cleaned = without_flying_pixels(depth, self.config.edge_radius, self.config.edge_jump);
            &cleaned
        } else {
            depth
        };
        // The last ground is an initial guess only if the camera's motion is continuous.
        let before = self.ground.take().filter(|_| stamp.is_some());
        let Some(ground) = Ground::find(&depth.data, rays, before.as_ref(), &self.config) else {
            self.obstacles.height.clear();
            return Ok(Surroundings::default());
        };
        self.obstacles
            .find(&depth.data, rays, &ground, &self.config);
        let pose = stamp.as_ref().map(|stamp| &stamp.world_from_cam);
        if self.config.parking_rows {
            self.parking.begin_frame(&ground, pose);
        }
        let mut detections = detect_turned(
            &depth.data,
            &self.obstacles,
            instances,
            rays,
            &ground,
            &|at| self.parking.usual_turn(at),
            &self.config,
        );
        if self.config.parking_rows {
            let moving: Vec<_> = self.tracker.moving().collect();
            let view = View {
                depth: &depth.data,
                obstacles: &self.obstacles,
                rays,
                ground: &ground,
                config: &self.config,
            };
            detections = self.parking.complete(detections, &moving, view, pose);
        }
        if let Some(sigma) = sigma {
            for detection in &mut detections {
                detection.weigh(&depth.data, &sigma.data, depth.width);
            }
        }
        let frame = stamp.map(|stamp| FrameContext {
            time_s: stamp.time_s,
            world_from_cam: stamp.world_from_cam,
            depth: &depth.data,
            rays,
            ground: &ground,
        });
        let mut targets = match frame {
            Some(frame) => self.tracker.step(&detections, &frame, &self.config),
            None => unfollowed(&mut self.tracker, &detections, &ground, &self.config),
        };
        targets.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
        self.ground = Some(ground.clone());
        Ok(Surroundings {
            ground: Some(ground),
            detections,
            targets,
        })
    }
}

/// Checks that the camera is plausible and the depth images have its size.
fn check(
    depth: &DepthMap,
    sigma: Option<&DepthMap>,
    k: &Intrinsics,
    instances: &[Instance],
) -> Result<()> {
    if let Some(problem) = k.implausible() {
        return Err(problem.into());
    }
    let size = (k.width as usize, k.height as usize);
    for map in [Some(depth), sigma].into_iter().flatten() {
        if (map.width, map.height) != size || map.data.len() != size.0 * size.1 {
            return Err(Error::Size {
                found: (map.width, map.height),
                expected: size,
            });
        }
    }
    for instance in instances {
        instance.check(size)?;
    }
    Ok(())
}

/// The targets of an image that is independent of others: each has a new id and no velocity.
fn unfollowed(
    tracker: &mut Tracker,
    detections: &[Detection],
    ground: &Ground,
    config: &PerceptionConfig,
) -> Vec<Target> {
    detections
        .iter()
        .enumerate()
        .filter(|(_, found)| f64::from(found.confidence) >= config.min_confidence)
        .map(|(i, detection)| detection.target(ground, tracker.new_id(), i))
        .collect()
}
