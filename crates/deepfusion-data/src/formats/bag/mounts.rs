//! The mounts of camera, LiDAR and inertial unit: from the file beside the bag, otherwise from the frames of `/tf_static` and `/tf`,
//! otherwise from the profile.

use super::config::BagConfig;
use super::frames::{Chain, Change, Lookup};
use super::index::Index;
use crate::{
    ConfigProblem, DataWarning, Error, FramesProblem, Mount, MountWarning, NotByFrames, Result,
};
use deepfusion_geometry::Se3;
use nalgebra::Vector3;
use std::path::Path;

/// Names of the vehicle's frame, starting with those most likely at the rear axle; only the last part of a name is compared. REP 105
/// allows `base_link` anywhere on the base, but software for vehicles puts it below the middle of the rear axle.
const VEHICLES: [&[&str]; 4] = [
    &["rear_axle", "rear_axle_link", "rear_axis_middle"],
    &["base_link"],
    &["base_footprint"],
    &["vehicle", "ego_vehicle", "ego", "car"],
];
/// If the component of "up" along the z axis of the images' frame is at least this, the frame is not an optical one (REP 103: an
/// optical frame's z points into the scene, its y down).
const BODY_AXES: f64 = 0.7;

/// The sensors' mounts.
#[derive(Debug)]
pub(super) struct Mounts {
    pub(super) cam_from_vehicle: Se3,
    /// Whether `cam_from_vehicle` is only assumed.
    pub(super) camera_assumed: bool,
    /// `None` if unknown.
    pub(super) cam_from_lidar: Option<Se3>,
    /// `None` if unknown.
    pub(super) vehicle_from_imu: Option<Se3>,
    /// All known mounts, with their sources.
    pub(super) known: Vec<Mount>,
}

impl Mounts {
    /// The mounts of a bag. Assumptions and contradictions between sources are added to the warnings.
    ///
    /// # Errors
    /// [`Error::Frames`] if the frames contradict each other on a mount that is not in the file.
    pub(super) fn find(
        bag: &Path,
        config: &BagConfig,
        index: &Index,
        warnings: &mut Vec<DataWarning>,
    ) -> Result<Self> {
        let by_frames = ByFrames::new(bag, config, index)?;
        let mut search = Search {
            config,
            warnings,
            mounts: Vec::new(),
        };
        let transforms = index.frames.broken;
        if transforms > 0 {
            search.warn(MountWarning::BrokenTransforms { transforms });
        }
        let (own, profile) = (config, &config.profile_mounts);
        let place = |t: Option<super::config::Transform>| t.map(|t| t.se3());
        let cam_from_vehicle = search.one(
            "cam_from_vehicle",
            [place(own.cam_from_vehicle), place(profile.cam_from_vehicle)],
            || by_frames.cam_from_vehicle(),
        )?;
        let cam_from_lidar = search.one(
            "cam_from_lidar",
            [place(own.cam_from_lidar), place(profile.cam_from_lidar)],
            || by_frames.cam_from_lidar(),
        )?;
        let vehicle_from_imu = search.one(
            "vehicle_from_imu",
            [place(own.vehicle_from_imu), place(profile.vehicle_from_imu)],
            || by_frames.vehicle_from_imu(),
        )?;
        let by_tf = search
            .mounts
            .iter()
            .any(|m| m.source.starts_with(BY_FRAMES) && m.name.starts_with("cam"));
        if let Some(name) = by_frames
            .camera
            .as_ref()
            .filter(|_| by_frames.body_axes && by_tf)
        {
            search.warn(MountWarning::BodyAxes {
                frame: name.clone(),
            });
        }
        if cam_from_vehicle.is_none() {
            search.warn(MountWarning::CameraUnknown);
        }
        Ok(Self {
            camera_assumed: cam_from_vehicle.is_none(),
            // At the rear axle, looking ahead.
            cam_from_vehicle: cam_from_vehicle.unwrap_or_else(Se3::cam_from_body_axes),
            cam_from_lidar,
            vehicle_from_imu,
            known: search.mounts,
        })
    }
}

/// Prefix of the source of a mount from the frames.
const BY_FRAMES: &str = "frames ";

/// The sources of mounts, in order of precedence.
struct Search<'a> {
    config: &'a BagConfig,
    warnings: &'a mut Vec<DataWarning>,
    mounts: Vec<Mount>,
}

impl Search<'_> {
    /// One mount: from the bag's own file, otherwise from the frames, otherwise from the profile.
    fn one(
        &mut self,
        name: &'static str,
        [own, profile]: [Option<Se3>; 2],
        by_frames: impl FnOnce() -> Result<MountByFrames>,
    ) -> Result<Option<Se3>> {
        let found = match by_frames() {
            Ok(found) => found,
            // The file takes precedence, so errors in the frames do not matter.
            Err(_) if own.is_some() => MountByFrames::NotExpected,
            Err(error) => return Err(error),
        };
        let in_file = self.config.path.display().to_string();
        let of_profile = self.config.profile.clone().unwrap_or_default();
        let (transform, source) = match (own, found) {
            (Some(own), found) => {
                if let MountByFrames::Found(by_frames, chain) = found {
                    self.compare(name, (&own, &in_file), (&by_frames, &chain));
                }
                (own, in_file)
            }
            (None, MountByFrames::Found(by_frames, chain)) => {
                if let Some(profile) = profile {
                    let source = format!("the profile {of_profile}");
                    self.compare(name, (&by_frames, &chain), (&profile, &source));
                }
                (by_frames, chain)
            }
            (None, other) => {
                if let MountByFrames::Unknown(why) = other {
                    self.warn(MountWarning::NotByFrames { mount: name, why });
                }
                match profile {
                    Some(profile) => (profile, format!("profile {of_profile}")),
                    None => return Ok(None),
                }
            }
        };
        self.mounts.push(Mount {
            name,
            source,
            translation: transform.translation().into(),
            rotation: transform.axis_angle().into(),
        });
        Ok(Some(transform))
    }

    /// Warns if two sources disagree; the first is used.
    fn compare(&mut self, mount: &'static str, taken: (&Se3, &str), other: (&Se3, &str)) {
        let change = Change::between(taken.0, other.0);
        if !change.is_small() {
            self.warn(MountWarning::Apart {
                mount,
                taken: taken.1.to_owned(),
                other: other.1.to_owned(),
                metres: change.metres,
                radians: change.radians,
            });
        }
    }

    fn warn(&mut self, warning: MountWarning) {
        self.warnings.push(warning.into());
    }
}

/// A mount according to the frames.
enum MountByFrames {
    /// The mount, and the chain of frames that gives it.
    Found(Se3, String),
    /// Why the frames do not give the mount, although they should.
    Unknown(NotByFrames),
    /// The frames do not give the mount, and need not.
    NotExpected,
}

/// The frames with the sensors' names in them.
struct ByFrames<'a> {
    bag: &'a Path,
    config: &'a BagConfig,
    index: &'a Index,
    /// The images' frame, if it is among the frames.
    camera: Option<String>,
    lidar: Option<String>,
    imu: Option<String>,
    /// Whether the images' frame has body axes: x forward, y left, z up.
    body_axes: bool,
}

impl<'a> ByFrames<'a> {
    fn new(bag: &'a Path, config: &'a BagConfig, index: &'a Index) -> Result<Self> {
        let (frames, named) = (&index.frames, &config.frames);
        for (key, name) in [
            ("vehicle", &named.vehicle),
            ("camera", &named.camera),
            ("lidar", &named.lidar),
            ("imu", &named.imu),
        ] {
            if let Some(name) = name
                && !frames.has(name)
            {
                return Err(config.wrong(ConfigProblem::NoFrame {
                    key,
                    name: name.clone(),
                    there: frames.names().into_iter().map(str::to_owned).collect(),
                }));
            }
        }
        let among = |named: &Option<String>, of_messages: &[&Option<String>]| {
            let of_messages = of_messages.iter().filter_map(|name| (*name).clone());
            let mut names = named.iter().cloned().chain(of_messages);
            names.find(|name| frames.has(name))
        };
        let mut all = Self {
            bag,
            config,
            index,
            camera: among(
                &named.camera,
                &[&index.image_frame, &index.camera_info_frame],
            ),
            lidar: among(&named.lidar, &[&index.lidar_frame]),
            imu: among(&named.imu, &[&index.imu_frame]),
            body_axes: false,
        };
        all.body_axes = all.has_body_axes();
        Ok(all)
    }

    fn cam_from_vehicle(&self) -> Result<MountByFrames> {
        let Some(camera) = &self.camera else {
            let of_images = &self.index.image_frame;
            return Ok(self.absent(of_images, "the images", "camera"));
        };
        let Some(vehicle) = self.vehicle(camera)? else {
            let frames = self.index.frames.names().into_iter();
            return Ok(MountByFrames::Unknown(NotByFrames::NoVehicle {
                frames: frames.map(str::to_owned).collect(),
                known: VEHICLES.concat(),
                config: self.config.path.clone(),
            }));
        };
        Ok(self.upright(self.between("cam_from_vehicle", camera, &vehicle)?))
    }

    fn cam_from_lidar(&self) -> Result<MountByFrames> {
        let Some(camera) = &self.camera else {
            return Ok(MountByFrames::NotExpected);
        };
        let Some(lidar) = &self.lidar else {
            let of_scans = &self.index.lidar_frame;
            return Ok(self.absent(of_scans, "the scans", "lidar"));
        };
        Ok(self.upright(self.between("cam_from_lidar", camera, lidar)?))
    }

    fn vehicle_from_imu(&self) -> Result<MountByFrames> {
        let Some(imu) = &self.imu else {
            let of_imu = &self.index.imu_frame;
            return Ok(self.absent(of_imu, "the inertial unit", "imu"));
        };
        // Use the same vehicle frame for all sensors.
        let anchor = self.camera.as_ref().unwrap_or(imu);
        match self.vehicle(anchor)? {
            Some(vehicle) => self.between("vehicle_from_imu", &vehicle, imu),
            None => Ok(MountByFrames::NotExpected),
        }
    }

    /// The result for a sensor's frame that is in no transform.
    fn absent(
        &self,
        frame: &Option<String>,
        whose: &'static str,
        key: &'static str,
    ) -> MountByFrames {
        if self.index.frames.is_empty() {
            return MountByFrames::NotExpected;
        }
        // A sensor that was not recorded has no messages, so no warning is needed.
        let Some(frame) = frame else {
            return MountByFrames::NotExpected;
        };
        MountByFrames::Unknown(NotByFrames::Absent {
            whose,
            frame: frame.clone(),
            key,
            config: self.config.path.clone(),
        })
    }

    /// The vehicle's frame: the one named in the file, otherwise the likeliest one to which a sensor's frame is fixed.
    fn vehicle(&self, anchor: &str) -> Result<Option<String>> {
        if let Some(named) = &self.config.frames.vehicle {
            return Ok(Some(named.clone()));
        }
        let frames = &self.index.frames;
        let names = frames.names();
        let last = |name: &str| name.rsplit('/').next().unwrap_or(name).to_owned();
        let mut tiers: Vec<Vec<&str>> = VEHICLES
            .iter()
            .map(|tier| {
                let of_tier = |name: &&&str| tier.contains(&last(name).as_str());
                names.iter().filter(of_tier).copied().collect()
            })
            .collect();
        let of_speed = self.index.speed_frame.as_deref();
        tiers.push(
            of_speed
                .filter(|name| frames.has(name))
                .into_iter()
                .collect(),
        );
        let mut moving = None;
        for tier in tiers {
            let mut found: Option<(&str, Chain)> = None;
            for name in tier {
                match frames.lookup(anchor, name) {
                    Lookup::Fixed(chain) => match &found {
                        Some((first, other)) if !same(other, &chain) => {
                            return Err(self.error(FramesProblem::TwoVehicles {
                                first: (*first).to_owned(),
                                other: name.to_owned(),
                                config: self.config.path.clone(),
                            }));
                        }
                        Some(_) => {}
                        None => found = Some((name, chain)),
                    },
                    // The caller looks up this transform again, and reports the contradiction.
                    Lookup::Several(_) => return Ok(Some(name.to_owned())),
                    Lookup::Moves(..) => moving = moving.or(Some(name)),
                    Lookup::Unknown => {}
                }
            }
            if let Some((name, _)) = found {
                return Ok(Some(name.to_owned()));
            }
        }
        Ok(moving.map(str::to_owned))
    }

    /// The transform from the source's frame to the target's.
    fn between(&self, mount: &'static str, target: &str, source: &str) -> Result<MountByFrames> {
        Ok(match self.index.frames.lookup(target, source) {
            Lookup::Fixed(chain) => {
                let source = format!("{BY_FRAMES}{chain}");
                MountByFrames::Found(chain.target_from_source, source)
            }
            Lookup::Several(both) => {
                let [a, b] = *both;
                let apart = Change::between(&a.target_from_source, &b.target_from_source);
                return Err(self.error(FramesProblem::TwoWays {
                    mount,
                    ways: Box::new([a.names, b.names]),
                    metres: apart.metres,
                    radians: apart.radians,
                    config: self.config.path.clone(),
                }));
            }
            Lookup::Moves(moving, change) => MountByFrames::Unknown(NotByFrames::Moves {
                from: source.to_owned(),
                to: target.to_owned(),
                moving,
                metres: change.metres,
                radians: change.radians,
            }),
            Lookup::Unknown => MountByFrames::Unknown(NotByFrames::NoWay {
                from: source.to_owned(),
                to: target.to_owned(),
            }),
        })
    }

    /// Whether the images' frame is not an optical one, because "up" is along its z. The up direction is the vehicle frame's, otherwise
    /// the LiDAR frame's.
    fn has_body_axes(&self) -> bool {
        let Some(camera) = &self.camera else {
            return false;
        };
        let vehicle = self.vehicle(camera).ok().flatten();
        let upright = vehicle.iter().chain(&self.lidar);
        let mut ups = upright.filter_map(|name| match self.index.frames.lookup(camera, name) {
            Lookup::Fixed(chain) => Some(chain.target_from_source.rotate(&Vector3::z())),
            _ => None,
        });
        ups.next().is_some_and(|up| up.z > BODY_AXES)
    }

    /// Turns a transform into the images' frame into one into the camera's optical axes.
    fn upright(&self, mount: MountByFrames) -> MountByFrames {
        match mount {
            MountByFrames::Found(body_from, source) if self.body_axes => {
                MountByFrames::Found(Se3::cam_from_body_axes() * body_from, source)
            }
            other => other,
        }
    }

    fn error(&self, problem: FramesProblem) -> Error {
        Error::Frames {
            path: self.bag.to_owned(),
            problem,
        }
    }
}

fn same(a: &Chain, b: &Chain) -> bool {
    Change::between(&a.target_from_source, &b.target_from_source).is_small()
}
