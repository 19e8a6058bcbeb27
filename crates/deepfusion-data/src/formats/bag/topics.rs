//! Assigns topics to roles: by message type, unless the file beside the bag names them.

use super::commands::is_command;
use super::config::BagConfig;
use crate::{DataWarning, Error, MotionWarning, NamedTopic, Result, TopicProblem, TopicRole};
use deepfusion_rosbag::msg::{
    AckermannDriveStamped, CameraInfo, CompressedImage, Float32, Float64, Frame, Image, Imu,
    NavSatFix, Odometry, OldTFMessage, PointCloud2, TFMessage, TwistStamped,
    TwistWithCovarianceStamped,
};
use deepfusion_rosbag::{MessageSource, RosMessage, TopicInfo};
use std::path::{Path, PathBuf};

/// The topics that are read, with their roles.
#[derive(Debug, Clone)]
pub(super) struct Topics {
    pub(super) found: Vec<(TopicRole, String)>,
    /// All topics of transforms; these have no key in `[topics]`.
    pub(super) frames: Vec<String>,
    /// Whether there are topics that only a simulator can write.
    pub(super) simulated: bool,
    /// Warnings about topics that were used for lack of better ones.
    pub(super) warnings: Vec<DataWarning>,
}

/// Prefix of topics with exact data of a simulated drive, which are never used as a sensor.
const TRUTH: &str = "/truth/";
/// Topics of `simulate` with data that cannot be recorded: the exact motion, and the exact depth of every pixel.
const EXACT_MOTION: &str = "/truth/odometry";
const EXACT_DEPTH: &str = "/truth/depth/compressed";
/// Part of the name of a second point cloud, with only the dynamic points.
const DYNAMIC: &str = "dynamic";

impl Topics {
    /// Finds each role's topic.
    ///
    /// # Errors
    /// [`Error::Topic`] if a named topic does not exist, or several are possible; [`Error::Bag`].
    pub(super) fn find(bag: &dyn MessageSource, config: &BagConfig) -> Result<Self> {
        let all = bag.topics()?;
        let search = Search {
            all: &all,
            bag: bag.path(),
            config: &config.path,
            given: &config.given_topics,
        };
        let names = &config.topics;
        let pictures = [Image::<'_>::TYPE, CompressedImage::<'_>::TYPE];
        let images = [&pictures[..], &super::packet::TYPES].concat();
        let mut found = Vec::new();
        let mut add = |role, name: Option<String>| found.extend(name.map(|name| (role, name)));
        let image = |types: &[&str]| {
            search.one(TopicRole::Image, &names.image, types, |t| {
                !is_depth(&t.name)
            })
        };
        // If a camera was recorded both as images and as a video, use the images, which can be read one by one.
        let image = match names.image {
            None => image(&pictures)?
                .map_or_else(|| image(&super::packet::TYPES), |found| Ok(Some(found)))?,
            Some(_) => image(&images)?,
        };
        add(TopicRole::Image, image.clone());
        add(
            TopicRole::CameraInfo,
            search.camera_info(&names.camera_info, image.as_deref())?,
        );
        let clouds = [PointCloud2::<'_>::TYPE];
        let lidar = search.one(TopicRole::Lidar, &names.lidar, &clouds, |t| {
            !is_dynamic(&t.name)
        })?;
        add(TopicRole::Lidar, lidar.clone());
        add(
            TopicRole::Dynamic,
            search.dynamic(&names.dynamic, lidar.as_deref())?,
        );
        add(
            TopicRole::Imu,
            search.one(TopicRole::Imu, &names.imu, &[Imu::TYPE], |_| true)?,
        );
        let can = config.can.as_ref();
        let steered = can.is_some_and(|can| can.steering.is_some());
        let driven = can.is_some_and(|can| can.speed.is_some());
        if !search.on_can(TopicRole::Steering, steered, &names.steering)? {
            add(TopicRole::Steering, search.steering(&names.steering)?);
        }
        if !search.on_can(TopicRole::Speed, driven, &names.speed)? {
            add(TopicRole::Speed, search.speed(&names.speed)?);
        }
        if steered || driven {
            add(TopicRole::Can, Some(search.can(&names.can)?));
        }
        let truth = match &names.truth {
            Some(_) => search.one(TopicRole::Truth, &names.truth, &[Odometry::TYPE], |_| true)?,
            None => all
                .iter()
                .find(|t| t.name.starts_with(TRUTH) && t.type_name == Odometry::TYPE)
                .map(|t| t.name.clone()),
        };
        add(TopicRole::Truth, truth);
        let transforms = [TFMessage::TYPE, OldTFMessage::TYPE];
        let of_frames = all
            .iter()
            .filter(|t| transforms.contains(&t.type_name.as_str()));
        let frames = of_frames.map(|t| t.name.clone()).collect();
        let warnings = commands(&found, config);
        Ok(Self {
            found,
            frames,
            simulated: are_simulated(&all),
            warnings,
        })
    }

    /// The topic of a role.
    pub(super) fn of(&self, role: TopicRole) -> Option<&str> {
        let found = self.found.iter().find(|(r, _)| *r == role);
        found.map(|(_, name)| name.as_str())
    }

    /// The roles of a topic, which can be several (speed and steering).
    pub(super) fn roles<'a>(&'a self, topic: &'a str) -> impl Iterator<Item = TopicRole> + 'a {
        let of_topic = self.found.iter().filter(move |(_, name)| name == topic);
        of_topic.map(|(role, _)| *role)
    }

    /// Whether a topic has transforms of frames.
    pub(super) fn has_frames(&self, topic: &str) -> bool {
        self.frames.iter().any(|name| name == topic)
    }

    /// The names of all topics that are read.
    pub(super) fn names(&self) -> Vec<&str> {
        let found = self.found.iter().map(|(_, name)| name);
        let mut names: Vec<&str> = found.chain(&self.frames).map(String::as_str).collect();
        names.dedup();
        names
    }
}

/// Whether a bag has topics that only a simulator can write.
fn are_simulated(all: &[TopicInfo]) -> bool {
    let has = |fits: &dyn Fn(&TopicInfo) -> bool| all.iter().any(fits);
    has(&|t| t.name == EXACT_MOTION && t.type_name == Odometry::TYPE)
        && has(&|t| t.name == EXACT_DEPTH)
}

/// A warning for each command that is used as a measurement for lack of a better topic, unless the topic was named.
fn commands(found: &[(TopicRole, String)], config: &BagConfig) -> Vec<DataWarning> {
    let names = &config.topics;
    let steers = config.vehicle.wheelbase_m.is_some();
    let taken = found.iter().filter_map(|(role, topic)| {
        let is_used = match role {
            TopicRole::Speed => names.speed.is_none(),
            // Without a wheelbase no steering angle is used.
            TopicRole::Steering => names.steering.is_none() && steers,
            _ => false,
        };
        let (topic, role) = (topic.clone(), *role);
        (is_used && is_command(&topic))
            .then(|| DataWarning::from(MotionWarning::Commanded { topic, role }))
    });
    taken.collect()
}

fn is_depth(name: &str) -> bool {
    name.to_lowercase().contains("depth")
}

fn is_dynamic(name: &str) -> bool {
    name.to_lowercase().contains(DYNAMIC)
}

/// A topic's name up to its last slash.
fn namespace(name: &str) -> &str {
    name.rsplit_once('/').map_or("", |(space, _)| space)
}

struct Search<'a> {
    all: &'a [TopicInfo],
    bag: &'a Path,
    config: &'a Path,
    /// Roles whose topics were named by the caller instead of the file.
    given: &'a [TopicRole],
}

impl Search<'_> {
    /// Path of the file beside the bag, if it names the role's topic.
    fn named_in(&self, role: TopicRole) -> Option<PathBuf> {
        (!self.given.contains(&role)).then(|| self.config.to_owned())
    }

    /// The named topic, or the only one of these types; `None` if none is to be read, or none is found.
    fn one(
        &self,
        role: TopicRole,
        named: &Option<String>,
        types: &[&str],
        fits: impl Fn(&TopicInfo) -> bool,
    ) -> Result<Option<String>> {
        if role.is_optional() && named.as_deref() == Some(NamedTopic::NONE) {
            return Ok(None);
        }
        if let Some(name) = named {
            let Some(topic) = self.all.iter().find(|t| t.name == *name) else {
                return Err(self.error(TopicProblem::NoTopic {
                    role,
                    name: name.clone(),
                    there: self.all.iter().map(|t| t.name.clone()).collect(),
                    config: self.named_in(role),
                }));
            };
            if !types.contains(&topic.type_name.as_str()) {
                return Err(self.error(TopicProblem::OtherType {
                    role,
                    name: name.clone(),
                    found: topic.type_name.clone(),
                    expected: types.iter().map(|&name| name.to_owned()).collect(),
                    config: self.named_in(role),
                }));
            }
            return Ok(Some(name.clone()));
        }
        let candidates: Vec<&TopicInfo> = self
            .all
            .iter()
            .filter(|t| types.contains(&t.type_name.as_str()) && t.count > 0)
            .filter(|t| !t.name.starts_with(TRUTH) && fits(t))
            .collect();
        match candidates.as_slice() {
            [] => Ok(None),
            [only] => Ok(Some(only.name.clone())),
            several => Err(self.error(TopicProblem::Several {
                role,
                topics: several.iter().map(|t| t.name.clone()).collect(),
                config: self.config.to_owned(),
            })),
        }
    }

    /// Whether a quantity is read from CAN frames. Then no topic is looked for, because the values of two sources with
    /// different scales would be mixed. A topic named `none` does not contradict a signal.
    fn on_can(&self, role: TopicRole, signal: bool, named: &Option<String>) -> Result<bool> {
        match named {
            Some(name) if signal && name != NamedTopic::NONE => Err(Error::Topic {
                path: self.config.to_owned(),
                problem: Box::new(TopicProblem::AndSignal {
                    role,
                    name: name.clone(),
                }),
                choice: None,
            }),
            _ => Ok(signal),
        }
    }

    /// The topic of CAN frames; an error if there is none, because `[can]` would silently have no effect.
    fn can(&self, named: &Option<String>) -> Result<String> {
        self.one(TopicRole::Can, named, &[Frame::TYPE], |_| true)?
            .ok_or_else(|| {
                self.error(TopicProblem::NoCan {
                    config: self.config.to_owned(),
                })
            })
    }

    /// The topic of the steering angle, by its message type. A topic of plain numbers must be named.
    fn steering(&self, named: &Option<String>) -> Result<Option<String>> {
        let any = [AckermannDriveStamped::TYPE, Float32::TYPE, Float64::TYPE];
        if named.is_some() {
            return self.one(TopicRole::Steering, named, &any, |_| true);
        }
        self.measured(TopicRole::Steering, &any[..1])
    }

    /// The topic of the first of these types in the bag; one with commands only if there is no other.
    fn measured(&self, role: TopicRole, types: &[&str]) -> Result<Option<String>> {
        for commanded in [false, true] {
            for kind in types {
                let fits = |t: &TopicInfo| is_command(&t.name) == commanded;
                if let Some(topic) = self.one(role, &None, &[*kind], fits)? {
                    return Ok(Some(topic));
                }
            }
        }
        Ok(None)
    }

    /// The topic of the vehicle's speed: a twist, otherwise an odometry, otherwise steering messages with a speed, otherwise GPS
    /// positions; never two of them. A topic of plain numbers must be named, since its unit is needed too.
    fn speed(&self, named: &Option<String>) -> Result<Option<String>> {
        let any = [
            TwistStamped::TYPE,
            TwistWithCovarianceStamped::TYPE,
            AckermannDriveStamped::TYPE,
            Odometry::TYPE,
            NavSatFix::TYPE,
            Float32::TYPE,
            Float64::TYPE,
        ];
        if named.is_some() {
            return self.one(TopicRole::Speed, named, &any, |_| true);
        }
        let kinds = [
            TwistStamped::TYPE,
            TwistWithCovarianceStamped::TYPE,
            Odometry::TYPE,
            AckermannDriveStamped::TYPE,
            NavSatFix::TYPE,
        ];
        self.measured(TopicRole::Speed, &kinds)
    }

    /// The topic of dynamic points; if there are several, the one in the LiDAR's namespace. None without a LiDAR.
    fn dynamic(&self, named: &Option<String>, lidar: Option<&str>) -> Result<Option<String>> {
        let clouds = [PointCloud2::<'_>::TYPE];
        let one = |fits: &dyn Fn(&str) -> bool| {
            self.one(TopicRole::Dynamic, named, &clouds, |t| {
                is_dynamic(&t.name) && Some(t.name.as_str()) != lidar && fits(&t.name)
            })
        };
        let Some(space) = lidar.map(namespace) else {
            return if named.is_some() {
                one(&|_| true)
            } else {
                Ok(None)
            };
        };
        match one(&|name| namespace(name) == space)? {
            Some(beside) => Ok(Some(beside)),
            None => one(&|_| true),
        }
    }

    /// The topic of the camera's calibration; if there are several, the one in the images' namespace.
    fn camera_info(&self, named: &Option<String>, image: Option<&str>) -> Result<Option<String>> {
        let kinds = [CameraInfo::TYPE];
        let one = |fits: &dyn Fn(&str) -> bool| {
            self.one(TopicRole::CameraInfo, named, &kinds, |t| fits(&t.name))
        };
        // `/camera/image_raw/compressed` and the transport's `/camera/image_raw/ffmpeg` belong to the same camera as `/camera/image_raw`.
        let transported = |name: &'static str| image.and_then(|i| i.strip_suffix(name));
        let raw = transported("/compressed")
            .or(transported("/ffmpeg"))
            .or(image);
        if let Some(space) = raw.map(namespace)
            && let Some(beside) = one(&|name| namespace(name) == space)?
        {
            return Ok(Some(beside));
        }
        one(&|_| true)
    }

    fn error(&self, problem: TopicProblem) -> Error {
        Error::Topic {
            path: self.bag.to_owned(),
            choice: problem.choice(),
            problem: Box::new(problem),
        }
    }
}
