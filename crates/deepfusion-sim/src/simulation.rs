use crate::can::{SPEED_RATE_HZ, STEERING_RATE_HZ, SpeedReading, SteeringReading};
use crate::config::{Scene, Sensors, SimConfig};
use crate::fmcw::{self, FmcwScan, MovingSolids, SCAN_RATE_HZ, VELOCITY_STEP_S};
use crate::imu::{self, BodyMotion, ImuReading};
use crate::light::GroundLight;
use crate::motion::Drive;
use crate::oxts::OxtsReading;
use crate::primitive::Primitive;
use crate::render::Cores;
use crate::riders::Riders;
use crate::rig::{Rig, kitti_like_intrinsics, umad_like_intrinsics};
use crate::road::Road;
use crate::scene::{SceneObject, Variety, World};
use crate::texture::noise::hash;
use crate::traffic::Traffic;
use crate::varied::{DrawnDrive, DriveLook};
use crate::{Result, render, velodyne};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use image::RgbImage;
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The street begins this far behind the car's start and ends this far beyond the end of the drive, metres.
const LEAD_IN: f64 = 60.0;
const LEAD_OUT: f64 = 430.0;

/// The camera's picture at one time, with its ground truth.
#[derive(Debug, Clone)]
pub struct SimFrame {
    /// H×W 8-bit RGB.
    pub rgb: RgbImage,
    /// Exact camera z of each pixel's centre, metres; 0 = sky.
    pub depth: DepthMap,
    /// H·W flags, row by row: the pixel's centre is on a dynamic object.
    pub moving: Vec<bool>,
    /// Camera (x right, y down, z forward) to world (z up), metres.
    pub world_from_cam: Se3,
    /// Time of the picture, seconds since the start of the drive.
    pub time_s: f64,
    /// Speed of the car (of its IMU), m/s.
    pub speed_mps: f64,
}

/// A drive through a procedural street. Equal configurations give equal drives, byte for byte.
///
/// Frames are numbered from 0 to [`Simulation::frames`] − 1. The methods that take a frame's number
/// panic beyond that, as slices do.
pub struct Simulation {
    config: SimConfig,
    world: World,
    light: GroundLight,
    drive: Drive,
    traffic: Traffic,
    riders: Riders,
    rig: Rig,
    intrinsics: Intrinsics,
    /// What a varied drive drew; `None` for a plain one.
    look: Option<DriveLook>,
    times: Vec<f64>,
}

impl Simulation {
    /// Lays out the street and the drive; the world is varied if [`SimConfig::varied`] is set.
    ///
    /// # Errors
    /// [`crate::Error::Config`] for a setting out of range; [`crate::Error::Varied`] for a scene that a drive cannot lead through, and for
    /// a setting that a varied drive cannot have.
    pub fn new(config: &SimConfig) -> Result<Self> {
        config.check_scene()?;
        let variety = if config.varied {
            DriveLook::variety(config.seed)
        } else {
            Variety::none()
        };
        Self::varied(config, &variety)
    }

    /// As [`Simulation::new`], through a world of any scene that is varied in this way. With [`Variety::none`] and without
    /// [`SimConfig::varied`] both are the same, for the scenes that `new` takes.
    ///
    /// # Errors
    /// [`crate::Error::Config`] for a setting out of range; [`crate::Error::Varied`] for a setting that a varied drive cannot have.
    pub fn varied(config: &SimConfig, variety: &Variety) -> Result<Self> {
        config.validate()?;
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
        let times = frame_times(&mut rng, config);
        let duration_s = times[times.len() - 1];
        let longest = 14.0 * (duration_s + 3.0);
        let mut road = match config.scene {
            Scene::Motorway | Scene::Country => {
                Road::gentle(&mut rng, -LEAD_IN, longest + LEAD_OUT)
            }
            Scene::Indoor => Road::straight(-LEAD_IN, longest + LEAD_OUT),
            _ => Road::generate(&mut rng, -LEAD_IN, longest + LEAD_OUT),
        };
        let drive = Drive::simulate(&mut rng, &road, duration_s, config.scene.pace());
        road.truncate(drive.progress(duration_s).0 + LEAD_OUT);
        let mut world = World::furnish_varied(road, config.seed, config.scene, variety);
        let look = config
            .varied
            .then(|| DriveLook::draw(config, variety, &mut world));
        let people = if config.riders > 0 {
            world.people()
        } else {
            Vec::new()
        };
        let light = GroundLight::bake(&world, Cores::All);
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed ^ 0x7AFF_1C00);
        let mut traffic = Traffic::new(&mut rng, &world, &drive, duration_s, config.moving_cars);
        if config.varied {
            traffic.keep_passing(&world, &drive, &observation_times(&times));
        }
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed ^ 0x0B1C_E5A0);
        let driven = (&drive, duration_s);
        let riders = Riders::along(&mut rng, &world, &people, driven, &traffic, config.riders);
        let (width, height) = (config.width, config.height);
        let above_road = look.as_ref().map(DriveLook::height_m);
        let above_road = above_road.unwrap_or(config.camera_height_m);
        let (level, usual) = match config.sensors {
            Sensors::Kitti => (
                Rig::kitti_like(above_road),
                kitti_like_intrinsics(width, height),
            ),
            Sensors::Umad => (
                Rig::umad_like(above_road),
                umad_like_intrinsics(width, height),
            ),
        };
        let (rig, intrinsics) = look
            .as_ref()
            .map_or((level, usual), |look| look.mount(level));
        Ok(Self {
            config: config.clone(),
            world,
            light,
            drive,
            traffic,
            riders,
            rig,
            intrinsics,
            look,
            times,
        })
    }

    /// The configuration of this drive.
    #[must_use]
    pub fn config(&self) -> &SimConfig {
        &self.config
    }

    /// What a varied drive drew from its seed: camera, light, weather, world and imaging; `None` for a plain one.
    #[must_use]
    pub fn drawn(&self) -> Option<&DrawnDrive> {
        self.look.as_ref().map(DriveLook::drawn)
    }

    /// Number of moving cars: [`SimConfig::moving_cars`], but a varied drive leaves out cars whose way is blocked.
    #[must_use]
    pub fn moving_cars(&self) -> usize {
        self.traffic.count()
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.times.len()
    }

    /// The camera, in pixels of the pictures.
    #[must_use]
    pub fn intrinsics(&self) -> Intrinsics {
        self.intrinsics
    }

    /// The mounts of the sensors on the car.
    #[must_use]
    pub fn rig(&self) -> Rig {
        self.rig
    }

    /// Time of a frame, seconds since the first.
    ///
    /// # Panics
    /// If the drive has no such frame.
    #[must_use]
    pub fn time_s(&self, frame: usize) -> f64 {
        self.times[frame]
    }

    /// World (x east, y north, z up, metres) from the camera at a frame.
    ///
    /// # Panics
    /// If the drive has no such frame.
    #[must_use]
    pub fn world_from_cam(&self, frame: usize) -> Se3 {
        self.world_from_imu(frame) * self.rig.cam_from_imu().inverse()
    }

    /// World from the IMU (x forward, y left, z up) at a frame.
    ///
    /// # Panics
    /// If the drive has no such frame.
    #[must_use]
    pub fn world_from_imu(&self, frame: usize) -> Se3 {
        self.drive
            .world_from_imu(&self.world.road, self.times[frame])
    }

    /// World from the velodyne (x forward, y left, z up) at a frame.
    ///
    /// # Panics
    /// If the drive has no such frame.
    #[must_use]
    pub fn world_from_velo(&self, frame: usize) -> Se3 {
        self.world_from_imu(frame) * self.rig.velo_from_imu.inverse()
    }

    /// The inertial unit's reading at a frame.
    ///
    /// # Panics
    /// If the drive has no such frame.
    #[must_use]
    pub fn oxts(&self, frame: usize) -> OxtsReading {
        OxtsReading::at(&self.drive, &self.world.road, self.times[frame])
    }

    /// The picture of a frame with its exact depth.
    ///
    /// # Panics
    /// If the drive has no such frame.
    #[must_use]
    pub fn frame(&self, frame: usize) -> SimFrame {
        self.seen_from(frame, self.world_from_cam(frame))
    }

    /// The picture of the second camera at a frame, with its exact depth. Without a [`SimConfig::stereo_baseline_m`] it is that of the
    /// first camera.
    ///
    /// # Panics
    /// If the drive has no such frame.
    #[must_use]
    pub fn right_frame(&self, frame: usize) -> SimFrame {
        let to_the_right = Vector3::new(self.config.stereo_baseline_m, 0.0, 0.0);
        let cam_from_right = Se3::from_axis_angle(Vector3::zeros(), to_the_right);
        self.seen_from(frame, self.world_from_cam(frame) * cam_from_right)
    }

    /// What a camera with this pose sees at the time of a frame.
    fn seen_from(&self, frame: usize, world_from_cam: Se3) -> SimFrame {
        let time_s = self.times[frame];
        let solids = self.moving_solids(time_s);
        let objects = self.moving_objects(time_s);
        let picture = match &self.look {
            None => render::render(
                &self.world,
                &self.light,
                &solids,
                &objects,
                &world_from_cam,
                &self.intrinsics,
            ),
            Some(look) => look.picture(
                (&self.world, &self.light),
                (&solids, &objects),
                &world_from_cam,
                frame,
            ),
        };
        SimFrame {
            rgb: picture.rgb,
            depth: picture.depth,
            moving: picture.moving,
            world_from_cam,
            time_s,
            speed_mps: self.oxts(frame).forward_speed(),
        }
    }

    /// One turn of the velodyne at a frame's instant: points in its axes, metres, with intensity.
    ///
    /// # Panics
    /// If the drive has no such frame.
    #[must_use]
    pub fn velodyne(&self, frame: usize) -> PointCloud {
        let solids = self.moving_solids(self.times[frame]);
        let key = hash(frame as i32, 29, self.world.seed);
        velodyne::scan(
            &self.world,
            &self.light,
            &solids,
            &self.world_from_velo(frame),
            self.config.scan_step_deg,
            key,
        )
    }

    /// One scan of an FMCW LiDAR at the velodyne's position, with each point's ground truth. `time_s` is in seconds since the start of the
    /// drive.
    #[must_use]
    pub fn fmcw(&self, time_s: f64) -> FmcwScan {
        self.fmcw_with_columns(time_s, fmcw::COLUMN_STEP_DEG)
    }

    /// As [`Self::fmcw`], with a column every `column_step_deg`.
    pub(crate) fn fmcw_with_columns(&self, time_s: f64, column_step_deg: f32) -> FmcwScan {
        let velo_from_imu = self.rig.velo_from_imu;
        let motion = BodyMotion::at(|t| self.imu_at(t) * velo_from_imu.inverse(), time_s);
        let later_s = time_s + VELOCITY_STEP_S;
        // A velocity is the difference between an object's positions now and a moment later, so both lists contain the objects present now.
        let cars = |at_s| self.traffic.solids_at(&self.world, at_s, time_s);
        let (mut now, mut later) = (cars(time_s), cars(later_s));
        let people = |at_s| self.riders.solids(&self.world, at_s, time_s);
        now.extend(people(time_s));
        later.extend(people(later_s));
        let moving = MovingSolids { now, later };
        let key = hash((time_s * 1e3).round() as i32, 31, self.world.seed);
        fmcw::scan(
            &self.world,
            &self.light,
            &moving,
            (&motion.pose, &motion.velocity),
            column_step_deg,
            key,
        )
    }

    /// The readings of the sensor head's 6-axis unit over the drive, with bias and noise.
    #[must_use]
    pub fn imu_readings(&self) -> Vec<ImuReading> {
        let head = self.rig.head_imu_from_imu.inverse();
        let seed = self.world.seed;
        let reading = |index: usize| {
            let time_s = index as f64 / imu::RATE_HZ;
            let motion = BodyMotion::at(|t| self.imu_at(t) * head, time_s);
            ImuReading::of(&motion, time_s, (index, seed))
        };
        (0..self.readings(imu::RATE_HZ)).map(reading).collect()
    }

    /// The CAN bus's speeds over the drive.
    #[must_use]
    pub fn speed_readings(&self) -> Vec<SpeedReading> {
        let reading = |index: usize| {
            let time_s = index as f64 / SPEED_RATE_HZ;
            SpeedReading::of(
                time_s,
                self.speed_and_yaw_rate(time_s).0,
                index,
                self.world.seed,
            )
        };
        (0..self.readings(SPEED_RATE_HZ)).map(reading).collect()
    }

    /// The CAN bus's road-wheel angles over the drive.
    #[must_use]
    pub fn steering_readings(&self) -> Vec<SteeringReading> {
        let reading = |index: usize| {
            let time_s = index as f64 / STEERING_RATE_HZ;
            let motion = self.speed_and_yaw_rate(time_s);
            SteeringReading::of(time_s, motion, index, self.world.seed)
        };
        (0..self.readings(STEERING_RATE_HZ)).map(reading).collect()
    }

    /// Number of readings at a rate that cover the drive.
    fn readings(&self, rate_hz: f64) -> usize {
        (self.times[self.times.len() - 1] * rate_hz).ceil() as usize + 1
    }

    /// World from the IMU at any time.
    fn imu_at(&self, time_s: f64) -> Se3 {
        self.drive.world_from_imu(&self.world.road, time_s)
    }

    /// Forward speed (m/s) and yaw rate (rad/s) of the rear axle, without noise.
    fn speed_and_yaw_rate(&self, time_s: f64) -> (f64, f64) {
        let motion = BodyMotion::at(|t| self.imu_at(t), time_s);
        let yaw_rate = motion.pose.rotate(&motion.angular_rate).z;
        (motion.velocity.xy().norm(), yaw_rate)
    }

    /// All objects on the street at a frame, static or dynamic, with exact boxes. In a varied drive the boxes cover whole objects,
    /// including parts that were cut away over the camera's lane, such as a part of a tree's crown.
    ///
    /// # Panics
    /// If the drive has no such frame.
    #[must_use]
    pub fn objects(&self, frame: usize) -> Vec<SceneObject> {
        let mut objects = self.world.objects.clone();
        objects.extend(self.moving_objects(self.times[frame]));
        objects
    }

    /// The solids of all dynamic objects at a time.
    fn moving_solids(&self, time_s: f64) -> Vec<Primitive> {
        let mut solids = self.traffic.solids(&self.world, time_s);
        solids.extend(self.riders.solids(&self.world, time_s, time_s));
        solids
    }

    /// The boxes of all dynamic objects at a time.
    fn moving_objects(&self, time_s: f64) -> Vec<SceneObject> {
        let mut objects = self.traffic.objects(&self.world, time_s);
        // Their ids follow those of the static objects and of the cars.
        let first_id = self.world.objects.len() + self.traffic.count();
        objects.extend(self.riders.objects(&self.world, time_s, first_id));
        objects
    }
}

/// Frame times: 1 / fps apart, ±1 ms.
fn frame_times(rng: &mut ChaCha8Rng, config: &SimConfig) -> Vec<f64> {
    let jitter = 0.001f64.min(0.05 / config.fps);
    (0..config.frames)
        .map(|i| {
            let shift = if i == 0 {
                0.0
            } else {
                rng.random_range(-jitter..jitter)
            };
            i as f64 / config.fps + shift
        })
        .collect()
}

/// Times at which the drive is observed, seconds: its frames, and the scans of a bag.
fn observation_times(frames: &[f64]) -> Vec<f64> {
    let end_s = frames.last().copied().unwrap_or_default();
    let scans = (0u32..)
        .map(|scan| f64::from(scan) / SCAN_RATE_HZ)
        .take_while(|time_s| *time_s < end_s + 1e-9);
    frames.iter().copied().chain(scans).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_times_of_scans_between_frames_are_included() {
        let found = observation_times(&[0.0, 0.25]);
        assert_eq!(found, [0.0, 0.25, 0.0, 0.1, 0.2]);
        let found = observation_times(&[0.0, 0.3]);
        assert_eq!(found, [0.0, 0.3, 0.0, 0.1, 0.2, 0.3]);
    }

    /// A car ahead of the camera at one scan is also there at the next one, although frames are half a second apart.
    #[test]
    fn no_car_disappears_from_scan_to_scan() {
        let simulation = Simulation::new(&SimConfig {
            seed: 2,
            frames: 8,
            fps: 2.0,
            moving_cars: 9,
            varied: true,
            ..SimConfig::default()
        })
        .unwrap();
        let near = |time_s: f64| -> Vec<u64> {
            let imu_from_world = simulation.imu_at(time_s).inverse();
            let mut cars = simulation.moving_objects(time_s);
            cars.retain(|car| {
                let p = imu_from_world.transform(&car.world_from_object.translation());
                p.x > 4.0 && p.norm() < 60.0
            });
            cars.iter().map(|car| car.id).collect()
        };
        let all = |time_s: f64| -> Vec<u64> {
            let cars = simulation.moving_objects(time_s);
            cars.iter().map(|car| car.id).collect()
        };
        let mut met = 0;
        for scan in 0..34 {
            let (now, next) = (
                f64::from(scan) / SCAN_RATE_HZ,
                f64::from(scan + 1) / SCAN_RATE_HZ,
            );
            for id in near(now) {
                met += 1;
                assert!(all(next).contains(&id), "{id} at {now}");
            }
            for id in near(next) {
                assert!(all(now).contains(&id), "{id} at {next}");
            }
        }
        assert!(met > 20, "only {met} cars in scans");
    }
}
