//! A bag as a [`Recording`].

use super::config::{BagConfig, LidarConfig};
use super::doppler::ego_velocity;
use super::dynamic::{DynamicPoints, Listed};
use super::index::{Index, Place};
use super::profile;
use super::scan::{Scan, SeenScan};
use super::topics::{Role, Topics};
use super::{image, sensors, source};
use crate::clock::{on_the_vehicles_clock, seconds};
use crate::kitti::GtKind;
use crate::recording::{CalibrationPlace, Recording};
use crate::{
    Camera, CameraCalibration, CameraPath, Dataset, DatasetKind, DatasetParts, DynamicAgreement,
    Error, Frame, FrameImage, Lens, LidarMotion, MotionModel, MovingLabels, MovingSource,
    OpenOptions, Result, ScanTruth, Stream,
};
use ::image::RgbImage;
use deepfusion_geometry::{DepthMap, Distortion, Intrinsics, Se3, StampedPose, Trajectory};
use deepfusion_rosbag::MessageSource;
use deepfusion_rosbag::msg::CameraInfo;
use nalgebra::{Matrix3, Vector3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Half the interval over which a yaw rate is measured, seconds.
const YAW_RATE_REACH_S: f64 = 0.05;

/// Opens bags, a data set each.
///
/// # Errors
/// As [`Dataset::open`].
pub(crate) fn open(path: &Path, bags: &[PathBuf], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let (mut datasets, mut without_camera) = (Vec::<Dataset>::new(), Vec::new());
    let mut refused = None;
    for bag in bags {
        let opened = open_bag(source::open(bag)?, options);
        match opened.and_then(|dataset| dataset.select(path, options)) {
            Ok(dataset) => datasets.push(dataset),
            Err(error @ Error::SplitSelectsNothing { .. }) => refused = Some(error),
            // A recorder may give each computer of the vehicle its bag; the others can still be used.
            Err(error @ Error::NoFrames { .. }) => {
                without_camera.push(source::name(bag));
                refused = refused.or(Some(error));
            }
            Err(other) => return Err(other),
        }
    }
    match (datasets.first_mut(), refused) {
        (None, Some(error)) => Err(error),
        (Some(first), _) if !without_camera.is_empty() => {
            let names = without_camera.join(", ");
            first.remark(format!(
                "left out, as none of their topics holds images: {names}"
            ));
            Ok(datasets)
        }
        _ => Ok(datasets),
    }
}

/// A bag with a camera.
#[derive(Debug)]
pub(crate) struct BagRecording {
    folder: PathBuf,
    bag: Arc<dyn MessageSource>,
    topics: Topics,
    images: Vec<Place>,
    lens: Lens,
    streams: Vec<Stream>,
    remarks: Vec<String>,
    /// Where the vehicle was, exactly, on the vehicle's clock.
    truth: Trajectory,
    cam_from_vehicle: Se3,
    scans: Option<Arc<BagScans>>,
    calibration: CalibrationPlace,
}

/// The scans of a bag as its camera sees them.
#[derive(Debug)]
pub(crate) struct BagScans {
    bag: Arc<dyn MessageSource>,
    topic: String,
    /// Each scan's place and its time on the frames' clock.
    places: Vec<(Place, f64)>,
    /// Those points of the scans that move, by another topic.
    dynamic: Option<DynamicPoints>,
    lidar: LidarConfig,
    within_s: f64,
    cam_from_lidar: Se3,
    cam_from_vehicle: Se3,
    intrinsics: Intrinsics,
    track: Option<MotionModel>,
}

/// A recording of messages as a data set, with what the file beside it says.
///
/// # Errors
/// As [`Dataset::open`].
pub(crate) fn open_bag(bag: Arc<dyn MessageSource>, options: &OpenOptions) -> Result<Dataset> {
    let path = bag.path();
    let config = BagConfig::beside(path)?;
    let topics = Topics::find(bag.as_ref(), &config)?;
    let index = Index::read(bag.as_ref(), &topics, &config)?;
    let Some(first) = index.images.first().copied() else {
        let list: Vec<String> = bag.topics()?.into_iter().map(|t| t.name).collect();
        return Err(Error::NoFrames {
            path: path.to_owned(),
            why: format!("none of its topics holds images: {}", list.join(", ")),
            remedy: "topics.image in the file beside the bag names the camera's topic".into(),
        });
    };
    let mut remarks = remarks_on(bag.as_ref(), &index);
    let camera_ahead_s = options
        .camera_ahead_s
        .unwrap_or(config.clock.camera_ahead_s);
    let origin_ns = on_the_vehicles_clock(first.stamp_ns, camera_ahead_s);
    // Of camera and LiDAR, which have one clock.
    let seconds =
        |stamp_ns: i64| seconds(on_the_vehicles_clock(stamp_ns, camera_ahead_s), origin_ns);

    let topic = topics.of(Role::Image).unwrap_or_default();
    let picture = image::decode(bag.as_ref(), &image::message(bag.as_ref(), topic, &first)?)?;
    let rectified = topic.contains("rect");
    let (lens, calibration) = camera(
        path,
        &config,
        &index,
        options,
        picture.dimensions(),
        rectified,
    )?;
    remarks.extend(lens.intrinsics().implausible());
    let cam_from_vehicle = match config.cam_from_vehicle {
        Some(transform) => transform.se3(),
        None => {
            remarks.push(
                "nothing says where the camera is on the vehicle: it is taken to look ahead and to move as the rear axle does".into(),
            );
            looking_ahead()
        }
    };
    let motion = sensors::motion(path, &index, &config, origin_ns)?;
    let yaw_known = motion.as_ref().is_some_and(|m| m.yaw_known);
    let track = motion.map(|m| m.track);
    let name = source::name(path);
    let frames = index.images.iter().enumerate().map(|(number, place)| {
        let time_s = seconds(place.stamp_ns);
        Frame {
            drive: name.clone(),
            number: number as u64,
            time_s: Some(time_s),
            image: FrameImage::Within {
                file: path.to_owned(),
                index: number as u64,
            },
            speed_mps: track.as_ref().and_then(|t| t.speed_at(time_s)),
        }
    });
    let parts = DatasetParts {
        name: name.clone(),
        split_name: name.clone(),
        camera: Camera::Left,
        frames: frames.collect(),
        intrinsics: lens.intrinsics(),
        cam_from_vehicle: Some(cam_from_vehicle),
        track: track.clone(),
        yaw_known,
        origin_ns: Some(origin_ns),
        camera_ahead_s,
        scenario: config.scenario.clone(),
    };
    let cam_from_lidar = match (&config.cam_from_lidar, config.profile.as_deref()) {
        (Some(transform), _) => Some(transform.se3()),
        (None, Some("umad")) => Some(profile::umad_cam_from_lidar().se3()),
        _ => None,
    };
    let timed = |places: &[Place]| {
        let timed = places.iter().map(|p| (*p, seconds(p.stamp_ns)));
        timed.collect::<Vec<_>>()
    };
    let scans = match (topics.of(Role::Lidar), cam_from_lidar) {
        (Some(topic), Some(cam_from_lidar)) => Some(Arc::new(BagScans {
            bag: Arc::clone(&bag),
            topic: topic.to_owned(),
            places: timed(&index.scans),
            dynamic: topics.of(Role::Dynamic).map(|topic| DynamicPoints {
                topic: topic.to_owned(),
                places: timed(&index.dynamic),
            }),
            lidar: config.lidar.clone(),
            within_s: config.clock.scan_within_s,
            cam_from_lidar,
            cam_from_vehicle,
            intrinsics: lens.intrinsics(),
            track,
        })),
        (Some(_), None) => {
            remarks.push(
                "nothing says where the LiDAR is (cam_from_lidar): its scans give no ground truth"
                    .into(),
            );
            None
        }
        _ => None,
    };
    let truth = index.truth.iter().map(|(ns, pose)| StampedPose {
        // The truth is on the vehicle's clock.
        time_s: (ns - origin_ns) as f64 * 1e-9,
        world_from_body: *pose,
    });
    let recording = BagRecording {
        streams: streams(bag.as_ref(), &topics, &index)?,
        folder: match path.is_dir() {
            true => path.to_owned(),
            false => path.parent().unwrap_or(path).to_owned(),
        },
        bag: Arc::clone(&bag),
        topics: topics.clone(),
        truth: Trajectory::new(truth.collect()),
        images: index.images,
        lens,
        remarks,
        cam_from_vehicle,
        scans,
        calibration,
    };
    Ok(Dataset::new(parts, Arc::new(recording)))
}

/// What of a bag cannot be read, in sentences.
pub(super) fn remarks_on(bag: &dyn MessageSource, index: &Index) -> Vec<String> {
    let mut remarks = Vec::new();
    let damage = bag.damage();
    remarks.extend(damage.map(|damage| format!("the bag is damaged: {damage}")));
    if let Some(lost) = index.lost.first() {
        remarks.push(format!(
            "{} messages or chunks cannot be read; the first: {lost}",
            index.lost.len()
        ));
    }
    remarks.extend(index.silent.iter().cloned());
    let unstamped = index.unstamped.iter();
    remarks.extend(unstamped.map(|(topic, messages)| {
        format!(
            "{topic}: {messages} messages have no time in their header; that of their recording is taken, which is as late as the \
             message was on its way"
        )
    }));
    remarks
}

/// The camera by what is given, by the file beside the bag, by CameraInfo, or as the profile prints it.
fn camera(
    bag: &Path,
    config: &BagConfig,
    index: &Index,
    options: &OpenOptions,
    (width, height): (u32, u32),
    rectified: bool,
) -> Result<(Lens, CalibrationPlace)> {
    let place = |file: &Path, field| CalibrationPlace {
        file: file.to_owned(),
        field,
    };
    let pinhole = |intrinsics: Intrinsics| Lens::new(intrinsics, &Distortion::default());
    let (lens, place) = if let Some(numbers) = options.intrinsics {
        let given = Intrinsics::from_numbers(numbers, (width, height));
        (pinhole(given), place(bag, "--intrinsics"))
    } else if let Some(camera) = config.camera {
        (pinhole(camera.intrinsics()), place(&config.path, "camera"))
    } else if let Some(file) = &config.calibration {
        let (lens, place) = calibrated(config, file, (width, height), rectified)?;
        (Ok(lens), place)
    } else if let Some(info) = index.camera_info.as_ref().filter(|info| info.k[0] > 0.0) {
        (of_camera_info(info, rectified), place(bag, "CameraInfo"))
    } else if config.profile.as_deref() == Some("umad") {
        let printed = profile::UMAD_CAMERA.intrinsics();
        (pinhole(printed), place(&config.path, "profile"))
    } else {
        return Err(Error::CameraFile {
            path: bag.to_owned(),
            problem: "nothing says what the camera is: no CameraInfo with a K".into(),
            remedy: format!(
                "[camera] fx, fy, cx, cy, width, height or calibration = \"camera.yaml\" in {}, or --intrinsics fx,fy,cx,cy",
                config.path.display()
            ),
        });
    };
    let lens = lens.map_err(|problem| Error::CameraFile {
        path: place.file.clone(),
        problem,
        remedy: "calibrate the camera at the size of these images".into(),
    })?;
    let found = lens.intrinsics();
    if (found.width, found.height) != (width, height) {
        return Err(Error::FrameSize {
            image: format!("{}, image 0", bag.display()),
            drive: source::name(bag),
            frame: 0,
            found: (width, height),
            expected: (found.width, found.height),
            field: place.field,
            calibration: place.file,
        });
    }
    Ok((lens, place))
}

/// The camera of the calibration file that the file beside the bag names.
fn calibrated(
    config: &BagConfig,
    file: &Path,
    size: (u32, u32),
    rectified: bool,
) -> Result<(Lens, CalibrationPlace)> {
    let path = config.folder().join(file);
    if !path.is_file() {
        return Err(config.wrong(format!("calibration: there is no {}", path.display())));
    }
    let calibration = CameraCalibration::read(&path, size)?;
    // Such a file is of the raw images: rectified ones have another matrix, and no distortion left to take out.
    if rectified && !calibration.distortion.is_none() {
        return Err(Error::CameraFile {
            path,
            problem: "it has a distortion, and the images are of a topic with `rect` in its name, rectified already".into(),
            remedy: format!(
                "name the raw images' topic (topics.image), or give the rectified camera as [camera], both in {}",
                config.path.display()
            ),
        });
    }
    Ok((calibration.lens()?, calibration.place()))
}

/// Of rectified images P without distortion, of raw ones K with it.
fn of_camera_info(info: &CameraInfo, rectified: bool) -> std::result::Result<Lens, String> {
    let size = (info.width, info.height);
    let of = |fx, fy, cx, cy| Intrinsics::from_numbers([fx, fy, cx, cy], size);
    if rectified && info.p[0] > 0.0 {
        let p = &info.p;
        return Lens::new(of(p[0], p[5], p[2], p[6]), &Distortion::default());
    }
    let known = ["plumb_bob", "rational_polynomial", ""];
    if !known.contains(&info.distortion_model.as_str()) && info.d.iter().any(|d| *d != 0.0) {
        let model = &info.distortion_model;
        return Err(format!(
            "distortion_model {model} is not known: plumb_bob and rational_polynomial are"
        ));
    }
    let distortion = match info.d.as_slice() {
        [] => Distortion::default(),
        d => Distortion::from_opencv(d)?,
    };
    let k = &info.k;
    Lens::new(of(k[0], k[4], k[2], k[5]), &distortion)
}

/// A camera at the rear axle that looks ahead.
fn looking_ahead() -> Se3 {
    let axes = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    Se3::from_parts(&axes, Vector3::zeros())
}

pub(super) fn streams(
    bag: &dyn MessageSource,
    topics: &Topics,
    index: &Index,
) -> Result<Vec<Stream>> {
    let all = bag.topics()?;
    let streams = all.iter().map(|topic| {
        let role = topics.roles(&topic.name).next();
        let (kind, times): (_, Vec<i64>) = match role {
            Some(Role::Image) => ("image", index.images.iter().map(|p| p.stamp_ns).collect()),
            Some(Role::Lidar) => (
                "point_cloud",
                index.scans.iter().map(|p| p.stamp_ns).collect(),
            ),
            Some(Role::Dynamic) => (
                "point_cloud",
                index.dynamic.iter().map(|p| p.stamp_ns).collect(),
            ),
            Some(Role::Imu) => ("imu", index.imu.iter().map(|s| s.0).collect()),
            Some(Role::Speed) => ("speed", index.speed_mps.iter().map(|s| s.0).collect()),
            Some(Role::Steering) => ("steering", index.steering_rad.iter().map(|s| s.0).collect()),
            Some(Role::Truth) => ("pose", index.truth.iter().map(|s| s.0).collect()),
            Some(Role::CameraInfo) => ("camera_info", Vec::new()),
            Some(Role::Can) => ("can", Vec::new()),
            None => ("other", Vec::new()),
        };
        let origin = times.first().copied().unwrap_or_default();
        let seconds: Vec<f64> = times.iter().map(|t| (t - origin) as f64 * 1e-9).collect();
        let mut stream = Stream::new(&topic.name, kind, topic.count as usize, &seconds);
        stream.rate_hz = stream.rate_hz.or(topic.rate_hz());
        stream
    });
    Ok(streams.collect())
}

impl BagScans {
    /// The scan nearest in time to a frame, if it is near enough, and its time.
    ///
    /// # Errors
    /// As [`Scan::decode`].
    fn scan(&self, frame_s: f64) -> Result<Option<(Scan, f64)>> {
        let Some((place, time_s)) = nearest(&self.places, frame_s, self.within_s) else {
            return Ok(None);
        };
        Ok(Some((self.decode(place)?, *time_s)))
    }

    fn decode(&self, place: &Place) -> Result<Scan> {
        let message = image::message(self.bag.as_ref(), &self.topic, place)?;
        Scan::decode(self.bag.as_ref(), &message, &self.lidar)
    }

    /// A scan as a frame's camera sees it: what stands still is brought to the frame's time by the vehicle's motion
    /// meanwhile.
    fn seen(&self, scan: &Scan, frame_s: f64, scan_s: f64) -> SeenScan {
        let cam_from_lidar = self.frame_from_scan(frame_s, scan_s) * self.cam_from_lidar;
        scan.seen(&cam_from_lidar, &self.intrinsics)
    }

    /// Each point's speed over ground along its ray, m/s; `None` without radial velocities.
    fn ground(&self, scan: &Scan, scan_s: f64) -> Option<Vec<f32>> {
        scan.ground_radial(self.sensor_velocity(scan_s), self.lidar.over_ground)
    }

    /// Which points move by their speeds over ground.
    fn fast(&self, ground: &[f32]) -> Vec<bool> {
        let limit = self.lidar.moving_mps as f32;
        ground.iter().map(|v| v.abs() > limit).collect()
    }

    /// Which points the topic of dynamic points lists; `None` without it, or where it is not of this scan.
    fn listed(&self, scan: &Scan, scan_s: f64) -> Result<Option<Listed>> {
        let Some(dynamic) = &self.dynamic else {
            return Ok(None);
        };
        dynamic.of(self.bag.as_ref(), &scan.xyz, scan_s, self.within_s)
    }

    /// Camera at the frame's time from camera at the scan's.
    fn frame_from_scan(&self, frame_s: f64, scan_s: f64) -> Se3 {
        let (from_s, to_s) = (frame_s.min(scan_s), frame_s.max(scan_s));
        let motion = self.track.as_ref().and_then(|t| t.motion(from_s, to_s));
        let Some(motion) = motion else {
            return Se3::identity();
        };
        let earlier_from_later = motion.camera0_from_camera1(&self.cam_from_vehicle);
        match frame_s <= scan_s {
            true => earlier_from_later,
            false => earlier_from_later.inverse(),
        }
    }

    /// The LiDAR's velocity over ground at a time, its axes, m/s, by the vehicle: v and ω × r.
    fn sensor_velocity(&self, time_s: f64) -> Option<Vector3<f64>> {
        let track = self.track.as_ref()?;
        let speed = track.speed_at(time_s)?;
        let turn = track.motion(time_s - YAW_RATE_REACH_S, time_s + YAW_RATE_REACH_S);
        let yaw_rate = turn.map_or(0.0, |m| m.yaw_rad / (2.0 * YAW_RATE_REACH_S));
        let vehicle_from_lidar = self.cam_from_vehicle.inverse() * self.cam_from_lidar;
        let arm = vehicle_from_lidar.translation();
        let velocity = Vector3::new(speed, 0.0, 0.0) + Vector3::new(0.0, 0.0, yaw_rate).cross(&arm);
        Some(vehicle_from_lidar.inverse().rotate(&velocity))
    }

    /// Whether a frame has a scan near enough.
    pub(crate) fn has(&self, frame_s: f64) -> bool {
        nearest(&self.places, frame_s, self.within_s).is_some()
    }

    /// A frame's ground truth, H×W; `None` without a scan.
    ///
    /// # Errors
    /// As [`Self::scan`].
    fn depth(&self, frame_s: f64) -> Result<Option<DepthMap>> {
        let scan = self.scan(frame_s)?;
        Ok(scan.map(|(scan, scan_s)| self.seen(&scan, frame_s, scan_s).depth))
    }

    /// As [`Recording::scan_truth`].
    fn truth(&self, frame_s: f64) -> Result<Option<ScanTruth>> {
        let Some((scan, scan_s)) = self.scan(frame_s)? else {
            return Ok(None);
        };
        let seen = self.seen(&scan, frame_s, scan_s);
        let ground = self.ground(&scan, scan_s);
        Ok(Some(ScanTruth {
            velocity_mps: ground.map(|ground| seen.pixels(&ground, f32::NAN)),
            depth: seen.depth,
        }))
    }

    /// Which pixels of a frame's ground truth move: by the radial velocities, or, where the scan has none, by the topic
    /// of dynamic points. `None` without a scan or without either.
    ///
    /// # Errors
    /// As [`Self::scan`].
    pub(crate) fn moving(&self, frame_s: f64) -> Result<Option<Vec<bool>>> {
        let Some((scan, scan_s)) = self.scan(frame_s)? else {
            return Ok(None);
        };
        let moves = match self.ground(&scan, scan_s) {
            Some(ground) => Some(self.fast(&ground)),
            None => self
                .listed(&scan, scan_s)?
                .filter(Listed::is_of_scan)
                .map(|listed| listed.moves),
        };
        let seen = self.seen(&scan, frame_s, scan_s);
        Ok(moves.map(|moves| seen.pixels(&moves, false)))
    }

    /// As [`Recording::dynamic_agreement`].
    fn agreement(&self, most: usize) -> Result<Option<DynamicAgreement>> {
        let mut sum = DynamicAgreement::default();
        let step = self.places.len().div_ceil(most.max(1)).max(1);
        for (place, scan_s) in self.places.iter().step_by(step).take(most) {
            let scan = self.decode(place)?;
            let Some(ground) = self.ground(&scan, *scan_s) else {
                continue;
            };
            let Some(listed) = self.listed(&scan, *scan_s)? else {
                continue;
            };
            let fast = self.fast(&ground);
            sum.scans += 1;
            sum.listed += listed.points;
            sum.in_scan += listed.found;
            sum.fast += fast.iter().filter(|fast| **fast).count();
            let both = fast.iter().zip(&listed.moves).filter(|(a, b)| **a && **b);
            sum.both += both.count();
        }
        Ok((sum.scans > 0).then_some(sum))
    }

    /// As [`Recording::lidar_motion`].
    fn motion(&self, most: usize) -> Result<Vec<LidarMotion>> {
        if self.lidar.over_ground || most == 0 {
            return Ok(Vec::new());
        }
        let vehicle_from_lidar = self.cam_from_vehicle.inverse() * self.cam_from_lidar;
        let step = self.places.len().div_ceil(most).max(1);
        let mut motions = Vec::new();
        for (place, time_s) in self.places.iter().step_by(step) {
            let scan = self.decode(place)?;
            let (Some(radial), Some(by_vehicle)) = (&scan.radial, self.sensor_velocity(*time_s))
            else {
                continue;
            };
            // Without a start: what the vehicle says must not colour what the scan says.
            let ego = ego_velocity(&scan.xyz, radial, None);
            if let Some(ego) = ego.filter(|ego| ego.static_share >= super::scan::LEAST_STATIC) {
                motions.push(LidarMotion {
                    time_s: *time_s,
                    by_scan_mps: vehicle_from_lidar.rotate(&ego.velocity),
                    by_vehicle_mps: vehicle_from_lidar.rotate(&by_vehicle),
                });
            }
        }
        Ok(motions)
    }

    /// Whether its points carry velocities: by the first scan.
    fn has_velocities(&self) -> Result<bool> {
        let Some((place, _)) = self.places.first() else {
            return Ok(false);
        };
        Ok(self.decode(place)?.radial.is_some())
    }
}

/// The message nearest to a time, no farther than `within_s`; `places` by time.
pub(super) fn nearest(
    places: &[(Place, f64)],
    time_s: f64,
    within_s: f64,
) -> Option<&(Place, f64)> {
    let after = places.partition_point(|p| p.1 < time_s);
    let around = places[after.saturating_sub(1)..].iter().take(2);
    let apart = |p: &&(Place, f64)| (p.1 - time_s).abs();
    let nearest = around.min_by(|a, b| apart(a).total_cmp(&apart(b)));
    nearest.filter(|p| apart(p) <= within_s)
}

impl Recording for BagRecording {
    fn kind(&self) -> DatasetKind {
        DatasetKind::Bag
    }

    fn folder(&self) -> &Path {
        &self.folder
    }

    fn load_image(&self, frame: &Frame) -> Result<RgbImage> {
        let topic = self.topics.of(Role::Image).unwrap_or_default();
        let place = usize::try_from(frame.number)
            .ok()
            .and_then(|n| self.images.get(n));
        let Some(place) = place else {
            return Err(Error::Image {
                path: self.bag.path().to_owned(),
                problem: format!("there is no image {}", frame.number),
                truncated: false,
            });
        };
        let message = image::message(self.bag.as_ref(), topic, place)?;
        self.lens
            .correct(image::decode(self.bag.as_ref(), &message)?)
    }

    fn calibration(&self) -> CalibrationPlace {
        self.calibration.clone()
    }

    fn streams(&self) -> Result<Vec<Stream>> {
        Ok(self.streams.clone())
    }

    fn no_motion(&self) -> Error {
        Error::NoTrack {
            drive: self.bag.path().display().to_string(),
            why: "the bag has no speed of the vehicle (TwistStamped, Odometry, a CAN signal)".into(),
            remedy: "topics.speed in the file beside the bag names its topic; [can] reads it from CAN frames".into(),
        }
    }

    fn remarks(&self) -> &[String] {
        &self.remarks
    }

    fn has_ground_truth(&self, frame: &Frame) -> bool {
        let scans = self.scans.as_ref();
        scans.is_some_and(|scans| frame.time_s.is_some_and(|t| scans.has(t)))
    }

    fn ground_truth(&self, frame: &Frame, kind: GtKind) -> Result<Option<DepthMap>> {
        if kind != GtKind::Z {
            return Err(Error::DepthKind {
                drive: frame.drive.clone(),
            });
        }
        let (Some(scans), Some(time_s)) = (&self.scans, frame.time_s) else {
            return Ok(None);
        };
        scans.depth(time_s)
    }

    fn scan_truth(&self, frame: &Frame, kind: GtKind) -> Result<Option<ScanTruth>> {
        if kind != GtKind::Z {
            return Err(Error::DepthKind {
                drive: frame.drive.clone(),
            });
        }
        match (&self.scans, frame.time_s) {
            (Some(scans), Some(time_s)) => scans.truth(time_s),
            _ => Ok(None),
        }
    }

    fn lidar_motion(&self, most: usize) -> Result<Vec<LidarMotion>> {
        self.scans
            .as_ref()
            .map_or(Ok(Vec::new()), |scans| scans.motion(most))
    }

    fn dynamic_agreement(&self, most: usize) -> Result<Option<DynamicAgreement>> {
        let scans = self.scans.as_ref();
        let scans = scans.filter(|scans| scans.dynamic.is_some());
        scans.map_or(Ok(None), |scans| scans.agreement(most))
    }

    fn moving_labels(&self, dataset: &Dataset) -> Result<Option<MovingLabels>> {
        let Some(scans) = &self.scans else {
            return Ok(None);
        };
        let source = match (scans.has_velocities()?, &scans.dynamic) {
            (true, _) => MovingSource::RadialVelocity,
            (false, Some(_)) => MovingSource::DynamicPoints,
            (false, None) => return Ok(None),
        };
        let times = dataset
            .frames()
            .iter()
            .filter_map(|f| Some((f.number, f.time_s?)));
        Ok(Some(MovingLabels::of_scans(
            Arc::clone(scans),
            times.collect(),
            source,
        )))
    }

    fn camera_paths(&self, dataset: &Dataset) -> Result<Vec<CameraPath>> {
        let vehicle_from_cam = self.cam_from_vehicle.inverse();
        let mut paths = Vec::new();
        for stretch in dataset.stretches() {
            let known: Vec<(usize, f64, Se3)> = stretch
                .into_iter()
                .filter_map(|frame| {
                    let time_s = dataset.frames()[frame].time_s?;
                    Some((frame, time_s, self.truth.at(time_s)? * vehicle_from_cam))
                })
                .collect();
            if known.len() > 1 {
                paths.push(CameraPath {
                    frames: known.iter().map(|k| k.0).collect(),
                    times_s: known.iter().map(|k| k.1).collect(),
                    world_from_cam: known.iter().map(|k| k.2).collect(),
                });
            }
        }
        match paths.is_empty() {
            true => Err(Error::NoPath {
                drive: dataset.name().to_owned(),
                layout: self.kind().label(),
            }),
            false => Ok(paths),
        }
    }
}
