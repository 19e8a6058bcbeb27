//! From depth to 3D targets.

use deepfusion::geometry::{DepthMap, Se3};
use deepfusion::perception::{
    Collision, Perception as Perceiver, PerceptionConfig, Stamp, Surroundings, Target,
    VehicleShape, scale_bounds, time_to_collision, working_depth,
};
use nalgebra::{Matrix3, Vector3};
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde::Serialize;
use std::sync::{Mutex, PoisonError};

use crate::camera::{GivenCamera, checked};
use crate::error::{raise, with_hint};

/// Tracks targets from image to image.
#[pyclass(frozen, module = "deepfusion._native")]
pub(crate) struct Perception {
    inner: Mutex<Perceiver>,
}

/// The detections as JSON, for Python's dataclasses.
#[derive(Serialize)]
struct Detections<'a> {
    targets: Vec<DetectedTarget<'a>>,
    ground: Option<Ground>,
    collision: Option<Collision>,
}

#[derive(Serialize)]
struct DetectedTarget<'a> {
    #[serde(flatten)]
    target: &'a Target,
    corners_m: [[f64; 3]; 8],
}

#[derive(Serialize)]
struct Ground {
    normal: [f32; 3],
    offset_m: f32,
}

#[pymethods]
impl Perception {
    /// `settings`: a JSON object with changes to the defaults for predicted depth, or for `exact` depth.
    #[new]
    fn new(settings: &str, exact: bool) -> PyResult<Self> {
        let base = if exact {
            PerceptionConfig::default()
        } else {
            PerceptionConfig::predicted()
        };
        let config = over(&base.with_parking_rows(), settings)?;
        config.validate().map_err(raise)?;
        Ok(Self {
            inner: Mutex::new(Perceiver::new(config)),
        })
    }

    fn reset(&self) {
        self.inner
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .reset();
    }

    #[pyo3(signature = (depth, intrinsics, sigma, time_s, world_from_cam, speed_mps, yaw_rate_radps, camera_yaw_rad))]
    #[expect(clippy::too_many_arguments, reason = "by name in Python")]
    fn detect(
        &self,
        py: Python<'_>,
        depth: PyReadonlyArray2<'_, f32>,
        intrinsics: GivenCamera,
        sigma: Option<PyReadonlyArray2<'_, f32>>,
        time_s: Option<f64>,
        world_from_cam: Option<PyReadonlyArray2<'_, f64>>,
        speed_mps: Option<f64>,
        yaw_rate_radps: f64,
        camera_yaw_rad: Option<f64>,
    ) -> PyResult<String> {
        let depth = depth_map(&depth);
        let sigma = sigma.map(|sigma| depth_map(&sigma));
        let size = |n: usize| u32::try_from(n).map_err(|e| PyValueError::new_err(e.to_string()));
        let camera = checked(
            intrinsics.numbers()?,
            (size(depth.width)?, size(depth.height)?),
        )?;
        let pose = world_from_cam.map(|pose| transform(&pose)).transpose()?;
        let stamp = match (time_s, pose) {
            (Some(time_s), Some(world_from_cam)) => Some(Stamp {
                time_s,
                world_from_cam,
            }),
            (None, None) => None,
            _ => {
                let message =
                    "tracking targets needs both the time and the camera's pose".to_owned();
                let hint = "give both time_s and world_from_cam, or neither".to_owned();
                return Err(with_hint(message, Some(hint)));
            }
        };
        let detect = |perceiver: &mut Perceiver| {
            let (small, k) = working_depth(&depth, &camera);
            let sigma = sigma.map(|sigma| working_depth(&sigma, &camera).0);
            let mut found = perceiver.detect_with_sigma(&small, sigma.as_ref(), &k, stamp, &[])?;
            let whole = [camera.width, camera.height];
            scale_bounds(&mut found.targets, [small.width, small.height], whole);
            Ok::<_, deepfusion::perception::Error>(found)
        };
        let found = py.detach(|| {
            // The lock is taken outside of the pool, as in `Model::predict`.
            let mut perceiver = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            let perceiver = &mut *perceiver;
            deepfusion_cli::in_this_process(|| detect(perceiver))
        });
        let found = found.map_err(raise)?;
        let collision = speed_mps.and_then(|speed| {
            let vehicle = VehicleShape {
                camera_yaw_rad: camera_yaw_rad.filter(|yaw| yaw.cos() > LOOKS_ASIDE)?,
                ..VehicleShape::default()
            };
            time_to_collision(&found.targets, speed, yaw_rate_radps, &vehicle)
        });
        to_json(&found, collision)
    }
}

/// Cosine of 60 degrees, the angle from which on a camera does not look ahead and no collision is computed.
const LOOKS_ASIDE: f64 = 0.5;

fn to_json(found: &Surroundings, collision: Option<Collision>) -> PyResult<String> {
    let targets = found.targets.iter();
    let found = Detections {
        targets: targets
            .map(|target| DetectedTarget {
                target,
                corners_m: target.corners(),
            })
            .collect(),
        ground: found.ground.as_ref().map(|ground| Ground {
            normal: ground.up,
            offset_m: ground.camera_height_m,
        }),
        collision,
    };
    serde_json::to_string(&found).map_err(|e| PyValueError::new_err(e.to_string()))
}

/// The base settings, changed by those in JSON.
fn over(base: &PerceptionConfig, settings: &str) -> PyResult<PerceptionConfig> {
    let wrong = |e: serde_json::Error| {
        let known = serde_json::to_value(base).ok();
        let known = known.and_then(|known| Some(known.as_object()?.keys().cloned().collect()));
        let known: Vec<String> = known.unwrap_or_default();
        let hint = format!("known settings: {}", known.join(", "));
        with_hint(format!("settings: {e}"), Some(hint))
    };
    let mut all = serde_json::to_value(base).map_err(wrong)?;
    let given: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(settings).map_err(wrong)?;
    if let Some(all) = all.as_object_mut() {
        all.extend(given);
    }
    serde_json::from_value(all).map_err(wrong)
}

/// An array of H x W metres as a depth map.
pub(crate) fn depth_map(array: &PyReadonlyArray2<'_, f32>) -> DepthMap {
    DepthMap {
        width: array.shape()[1],
        height: array.shape()[0],
        data: array.as_array().iter().copied().collect(),
    }
}

/// A 4×4 matrix as a rigid transform.
fn transform(matrix: &PyReadonlyArray2<'_, f64>) -> PyResult<Se3> {
    let m = matrix.as_array();
    if m.shape() != [4, 4] {
        let message = format!("world_from_cam: expected 4 x 4, found {:?}", m.shape());
        return Err(PyValueError::new_err(message));
    }
    let at = |row, column| m[(row, column)];
    let rotation = Matrix3::from_fn(at);
    let identity = rotation * rotation.transpose() - Matrix3::identity();
    if !(identity.norm() < 1e-3 && rotation.determinant() > 0.0) {
        let message = "world_from_cam: its upper left 3 x 3 matrix is not a rotation";
        return Err(PyValueError::new_err(message));
    }
    let translation = Vector3::from_fn(|row, _| at(row, 3));
    Ok(Se3::from_parts(&rotation, translation))
}
