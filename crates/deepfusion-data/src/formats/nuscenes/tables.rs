//! Reads the tables of nuScenes that are needed for one camera and the LiDAR.

use super::rows::{Row, each_row};
use crate::{Error, JsonProblem, Result};
use deepfusion_geometry::Se3;
use nalgebra::Vector3;
use serde::de::Visitor;
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::fmt;
use std::path::Path;

pub(super) const CAMERA: &str = "CAM_FRONT";
pub(super) const LIDAR: &str = "LIDAR_TOP";
pub(super) const SAMPLE_DATA: &str = "sample_data.json";
pub(super) const CALIBRATED_SENSOR: &str = "calibrated_sensor.json";

/// A row's token: 32 hexadecimal digits, kept as a number to save memory, since there are millions.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Token(u128);

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl<'de> Deserialize<'de> for Token {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        /// Parses the digits without copying the text.
        struct Digits;
        impl Visitor<'_> for Digits {
            type Value = Token;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a token")
            }

            fn visit_str<E: serde::de::Error>(self, text: &str) -> std::result::Result<Token, E> {
                let digits = text.len() == 32 && text.bytes().all(|b| b.is_ascii_hexdigit());
                let number = u128::from_str_radix(text, 16).ok().filter(|_| digits);
                number.map(Token).ok_or_else(|| {
                    let shown: String = text.chars().take(40).collect();
                    E::custom(format!("'{shown}' is not a token (32 hexadecimal digits)"))
                })
            }
        }
        deserializer.deserialize_str(Digits)
    }
}

#[derive(Deserialize)]
struct SensorRow<'a> {
    token: Token,
    #[serde(borrow)]
    channel: Cow<'a, str>,
}

#[derive(Deserialize)]
struct CalibratedRow {
    token: Token,
    sensor_token: Token,
    translation: [f64; 3],
    rotation: [f64; 4],
    camera_intrinsic: Vec<[f64; 3]>,
}

#[derive(Deserialize)]
struct SceneRow {
    token: Token,
    name: String,
}

#[derive(Deserialize)]
struct SampleRow {
    token: Token,
    scene_token: Token,
}

#[derive(Deserialize)]
struct DataRow<'a> {
    sample_token: Token,
    ego_pose_token: Token,
    calibrated_sensor_token: Token,
    /// Microseconds since 1970.
    timestamp: i64,
    #[serde(borrow)]
    filename: Cow<'a, str>,
}

#[derive(Deserialize)]
struct PoseRow {
    token: Token,
    translation: [f64; 3],
    rotation: [f64; 4],
}

/// A sensor's mount on the vehicle, and its intrinsics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mounted {
    /// The transform from the sensor to the vehicle (x forward, y left, z up, origin above the middle of the rear axle).
    pub(super) vehicle_from_sensor: Se3,
    /// fx, fy, cx, cy, if the sensor is a camera.
    pub(super) pinhole: Option<[f64; 4]>,
}

/// An image or a scan, with the vehicle's pose.
#[derive(Debug, Clone)]
pub(super) struct SensorFrame {
    /// Time, nanoseconds since 1970.
    pub(super) ns: i64,
    /// Path of the file, relative to the root.
    pub(super) file: String,
    pub(super) world_from_vehicle: Se3,
    pub(super) sensor: Mounted,
}

/// The images and scans of a scene, ordered by time.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    pub(super) name: String,
    pub(super) images: Vec<SensorFrame>,
    pub(super) scans: Vec<SensorFrame>,
}

#[derive(Clone, Copy, PartialEq)]
enum SensorKind {
    Camera,
    Lidar,
}

/// A row of `sample_data.json` whose pose has not been looked up yet.
struct UnposedFrame {
    scene: usize,
    kind: SensorKind,
    ns: i64,
    file: String,
    sensor: Mounted,
    pose: Token,
    /// Line of its pose's token.
    line: usize,
}

/// Reads the tables in a folder. Returns the scenes, ordered by name.
///
/// # Errors
/// [`Error::Missing`] for a missing table, [`Error::Json`] for one that cannot be read or refers to a missing row of
/// another.
pub(super) fn read_scenes(folder: &Path) -> Result<Vec<Scene>> {
    let sensors = calibrated_sensors(folder)?;
    let (mut scenes, mut scene_of) = (Vec::new(), HashMap::new());
    each_row(&folder.join("scene.json"), |row| {
        let scene: SceneRow = row.read()?;
        scene_of.insert(scene.token, scenes.len());
        scenes.push(Scene {
            name: scene.name,
            images: Vec::new(),
            scans: Vec::new(),
        });
        Ok(())
    })?;
    let mut samples = HashMap::new();
    each_row(&folder.join("sample.json"), |row| {
        let sample: SampleRow = row.read()?;
        let scene = named(
            row,
            "scene_token",
            sample.scene_token,
            &scene_of,
            "scene.json",
        )?;
        samples.insert(sample.token, scene);
        Ok(())
    })?;
    let mut found = Vec::new();
    each_row(&folder.join(SAMPLE_DATA), |row| {
        let data: DataRow = row.read()?;
        let (field, token) = ("calibrated_sensor_token", data.calibrated_sensor_token);
        let Some((kind, sensor)) = named(row, field, token, &sensors, CALIBRATED_SENSOR)? else {
            return Ok(());
        };
        found.push(UnposedFrame {
            scene: named(
                row,
                "sample_token",
                data.sample_token,
                &samples,
                "sample.json",
            )?,
            kind,
            ns: data.timestamp.saturating_mul(1000),
            file: data.filename.into_owned(),
            sensor,
            pose: data.ego_pose_token,
            line: row.line_of("ego_pose_token"),
        });
        Ok(())
    })?;
    let poses = ego_poses(folder, found.iter().map(|f| f.pose).collect())?;
    for one in found {
        let pose = poses.get(&one.pose).ok_or_else(|| Error::Json {
            path: folder.join(SAMPLE_DATA),
            line: one.line,
            field: "ego_pose_token".into(),
            problem: JsonProblem::NoRow {
                table: "ego_pose.json",
                token: one.pose.to_string(),
            },
        })?;
        let scene = &mut scenes[one.scene];
        let list = match one.kind {
            SensorKind::Camera => &mut scene.images,
            SensorKind::Lidar => &mut scene.scans,
        };
        list.push(SensorFrame {
            ns: one.ns,
            file: one.file,
            world_from_vehicle: *pose,
            sensor: one.sensor,
        });
    }
    for scene in &mut scenes {
        scene.images.sort_by_key(|taken| taken.ns);
        scene.scans.sort_by_key(|taken| taken.ns);
    }
    scenes.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(scenes)
}

/// The row of another table to which a field refers.
fn named<T: Copy>(
    row: &Row<'_>,
    field: &str,
    token: Token,
    rows: &HashMap<Token, T>,
    table: &'static str,
) -> Result<T> {
    let found = rows.get(&token).copied();
    found.ok_or_else(|| {
        let token = token.to_string();
        row.bad(field, JsonProblem::NoRow { table, token })
    })
}

/// The sensors' mounts by token; `None` for sensors other than the camera and the LiDAR.
fn calibrated_sensors(folder: &Path) -> Result<HashMap<Token, Option<(SensorKind, Mounted)>>> {
    let mut channels = HashMap::new();
    let path = folder.join("sensor.json");
    each_row(&path, |row| {
        let sensor: SensorRow = row.read()?;
        let kind = match sensor.channel.as_ref() {
            CAMERA => Some(SensorKind::Camera),
            LIDAR => Some(SensorKind::Lidar),
            _ => None,
        };
        channels.insert(sensor.token, kind);
        Ok(())
    })?;
    if !channels
        .values()
        .any(|kind| *kind == Some(SensorKind::Camera))
    {
        return Err(Error::Json {
            path,
            line: 1,
            field: "channel".into(),
            problem: JsonProblem::NoSensor { name: CAMERA },
        });
    }
    let mut sensors = HashMap::new();
    each_row(&folder.join(CALIBRATED_SENSOR), |row| {
        let sensor: CalibratedRow = row.read()?;
        let (field, token) = ("sensor_token", sensor.sensor_token);
        let kind = named(row, field, token, &channels, "sensor.json")?;
        let mounted = match kind {
            None => None,
            Some(kind) => {
                let pinhole = match kind {
                    SensorKind::Camera => Some(pinhole(row, &sensor.camera_intrinsic)?),
                    SensorKind::Lidar => None,
                };
                let mounted = Mounted {
                    vehicle_from_sensor: motion(row, sensor.rotation, sensor.translation)?,
                    pinhole,
                };
                Some((kind, mounted))
            }
        };
        sensors.insert(sensor.token, mounted);
        Ok(())
    })?;
    Ok(sensors)
}

/// `world_from_vehicle` of the rows in `wanted`.
fn ego_poses(folder: &Path, wanted: HashSet<Token>) -> Result<HashMap<Token, Se3>> {
    let mut poses = HashMap::with_capacity(wanted.len());
    each_row(&folder.join("ego_pose.json"), |row| {
        let pose: PoseRow = row.read()?;
        if wanted.contains(&pose.token) {
            poses.insert(pose.token, motion(row, pose.rotation, pose.translation)?);
        }
        Ok(())
    })?;
    Ok(poses)
}

/// A rigid transform from a unit quaternion w, x, y, z and a translation in metres.
fn motion(row: &Row<'_>, rotation: [f64; 4], translation: [f64; 3]) -> Result<Se3> {
    let norm = rotation.iter().map(|q| q * q).sum::<f64>().sqrt();
    if (norm - 1.0).abs() > 1e-2 {
        return Err(row.bad("rotation", JsonProblem::NotARotation { length: norm }));
    }
    Ok(Se3::from_quaternion(rotation, Vector3::from(translation)))
}

fn pinhole(row: &Row<'_>, k: &[[f64; 3]]) -> Result<[f64; 4]> {
    let [[fx, _, cx], [_, fy, cy], _] = k else {
        let rows = k.len();
        return Err(row.bad("camera_intrinsic", JsonProblem::NotAMatrix { rows }));
    };
    Ok([*fx, *fy, *cx, *cy])
}
