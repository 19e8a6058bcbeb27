//! What perception wants to know of a frame: depth at its working size, time, and the camera's way.

use std::sync::Arc;

use deepfusion_data::{Dataset, RgbImage, grey_image};
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use deepfusion_motion::{GreyImage, GroundPair, ScaleMonitor, ScaleReading};
use deepfusion_perception::{Ground, Perception, Stamp};
use nalgebra::Vector3;

use super::super::predict::inputs::Input;

/// Widest depth image that is looked at: more pixels cost time and say no more than the network knew.
const WIDTH: usize = 640;

/// The depth at its working size, the nearest pixel of each (a mean would put points between near and far), with its
/// camera.
pub fn working_depth(depth: &DepthMap, k: &Intrinsics) -> (DepthMap, Intrinsics) {
    if depth.width <= WIDTH {
        return (depth.clone(), *k);
    }
    let height = (depth.height * WIDTH).div_ceil(depth.width).max(1);
    let k = k.resized(WIDTH as u32, height as u32);
    (depth.nearest(WIDTH, height), k)
}

/// When and from where a frame was taken, and how the vehicle went then.
#[derive(Debug, Clone, Copy, Default)]
pub struct Motion {
    /// `None` for a frame that stands for itself.
    pub stamp: Option<Stamp>,
    /// m/s.
    pub speed_mps: Option<f64>,
    /// rad/s, positive to the left.
    pub yaw_rate: f64,
    /// The camera in the last frame's camera, where this frame goes on from it.
    pub last_from_this: Option<Se3>,
    /// Which way is down in the camera, where its mount is known.
    pub down_in_cam: Option<Vector3<f64>>,
}

/// Adds up the camera's way over the frames of a recording.
#[derive(Debug, Default)]
pub struct MotionTracker {
    last: Option<(Arc<Dataset>, usize, Se3)>,
}

impl MotionTracker {
    /// The motion of the next frame. Where it does not go on from the last one, `perception` forgets its tracks.
    pub fn next(&mut self, input: &Input, perception: &mut Perception) -> Motion {
        let Some((dataset, index)) = &input.frame else {
            self.last = None;
            perception.forget();
            return Motion::default();
        };
        self.of(dataset, *index, perception)
    }

    /// As [`Self::next`], of a recording's frame.
    pub fn of(
        &mut self,
        dataset: &Arc<Dataset>,
        index: usize,
        perception: &mut Perception,
    ) -> Motion {
        let frame = &dataset.frames()[index];
        let step = self.last.take().and_then(|(before, last, world_from_cam)| {
            let same = Arc::ptr_eq(&before, dataset) && index > last;
            let motion = same.then(|| dataset.camera_motion(last, index))??;
            let dt = frame.time_s? - dataset.frames()[last].time_s?;
            Some((world_from_cam * motion, motion, dt))
        });
        if step.is_none() {
            perception.forget();
        }
        // The first frame of a recording whose motion is known begins a way.
        let known = dataset.track().is_some() && dataset.yaw_known();
        let world_from_cam = step.map(|(pose, ..)| pose).or(known.then(Se3::identity));
        let stamp = world_from_cam
            .zip(frame.time_s)
            .map(|(world_from_cam, time_s)| Stamp {
                time_s,
                world_from_cam,
            });
        if let Some(stamp) = stamp {
            self.last = Some((dataset.clone(), index, stamp.world_from_cam));
        }
        Motion {
            stamp,
            speed_mps: frame.speed_mps,
            // The camera's y points down: a turn to the left is a negative one about it.
            yaw_rate: step.map_or(0.0, |(_, motion, dt)| -motion.axis_angle().y / dt),
            last_from_this: step.map(|(_, motion, _)| motion),
            down_in_cam: dataset
                .cam_from_vehicle()
                .map(|cam| -cam.rotate(&Vector3::z())),
        }
    }
}

/// Width of the images that the scale is watched in.
const WATCHED_WIDTH: u32 = 320;

/// Watches the metres of a recording: [`ScaleMonitor`] over its frames.
pub struct ScaleWatch {
    monitor: ScaleMonitor,
    last: Option<GreyImage>,
}

impl ScaleWatch {
    /// From the first frame on.
    pub fn new(monitor: ScaleMonitor) -> Self {
        Self {
            monitor,
            last: None,
        }
    }

    /// Takes the next frame in; `None` where it does not go on from the last one.
    pub fn add(
        &mut self,
        image: &RgbImage,
        camera: &Intrinsics,
        motion: &Motion,
        ground: Option<&Ground>,
    ) -> Option<ScaleReading> {
        let (width, height) = (
            WATCHED_WIDTH.min(camera.width),
            (WATCHED_WIDTH.min(camera.width) * camera.height)
                .div_ceil(camera.width)
                .max(1),
        );
        let later = grey_image(image, width, height);
        let earlier = self.last.replace(later.clone());
        let earlier = earlier?;
        // The mount knows better than a single image's ground where down is.
        let seen = || ground.map(|ground| -Vector3::from(ground.up.map(f64::from)));
        let pair = GroundPair {
            earlier,
            later,
            intrinsics: camera.resized(width, height),
            earlier_from_later: motion.last_from_this?,
            down_in_cam: motion.down_in_cam.or_else(seen)?,
        };
        let depth_height_m = ground.map(|ground| f64::from(ground.camera_height_m));
        Some(self.monitor.add(&pair, depth_height_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_working_size_keeps_pixels_where_the_camera_sees_them() {
        let (width, height) = (1242, 375);
        let k = Intrinsics {
            fx: 721.5,
            fy: 721.5,
            cx: 609.6,
            cy: 172.9,
            width: 1242,
            height: 375,
        };
        // Depth that tells its own column and row.
        let data = (0..width * height).map(|i| 1.0 + i as f32).collect();
        let depth = DepthMap {
            width,
            height,
            data,
        };
        let (small, small_k) = working_depth(&depth, &k);
        assert_eq!((small.width, small.height), (640, 194));
        for (u, v) in [(0, 0), (320, 97), (639, 193)] {
            let from = small.data[v * 640 + u] as usize - 1;
            let (x, y) = ((from % width) as f64, (from / width) as f64);
            let ray = (x - k.cx) / k.fx - (u as f64 - small_k.cx) / small_k.fx;
            assert!(ray.abs() < 1.0 / small_k.fx, "{u}: {ray}");
            let ray = (y - k.cy) / k.fy - (v as f64 - small_k.cy) / small_k.fy;
            assert!(ray.abs() < 1.0 / small_k.fy, "{v}: {ray}");
        }
        let tiny = DepthMap::empty(64, 32);
        assert_eq!(working_depth(&tiny, &k).0, tiny);
    }
}
