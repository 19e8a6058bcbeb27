//! Which topic is which: by message type, unless the file beside the bag names it.

use super::config::BagConfig;
use crate::{Error, Result};
use deepfusion_rosbag::msg::{
    AckermannDriveStamped, CameraInfo, CompressedImage, Float32, Float64, Frame, Image, Imu,
    Odometry, PointCloud2, TwistStamped,
};
use deepfusion_rosbag::{MessageSource, RosMessage, TopicInfo};
use std::path::Path;

/// What a topic is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Image,
    CameraInfo,
    Lidar,
    Dynamic,
    Imu,
    Speed,
    Steering,
    Can,
    Truth,
}

/// The topics that are read, and what for.
#[derive(Debug, Clone)]
pub(super) struct Topics {
    pub(super) found: Vec<(Role, String)>,
}

/// Exact data of a simulated drive: never taken for a sensor.
const TRUTH: &str = "/truth/";
/// In the name of a second cloud, of what moves only.
const DYNAMIC: &str = "dynamic";

impl Topics {
    /// Looks for each role's topic.
    ///
    /// # Errors
    /// [`Error::Topic`] where the file names a topic that is not there, or several could be meant;
    /// [`Error::Bag`].
    pub(super) fn find(bag: &dyn MessageSource, config: &BagConfig) -> Result<Self> {
        let all = bag.topics()?;
        let search = Search {
            all: &all,
            bag: bag.path(),
            config: &config.path,
        };
        let names = &config.topics;
        let images = [Image::<'_>::TYPE, CompressedImage::<'_>::TYPE];
        let mut found = Vec::new();
        let mut add = |role, name: Option<String>| found.extend(name.map(|name| (role, name)));
        add(
            Role::Image,
            search.one("image", &names.image, &images, |t| !is_depth(&t.name))?,
        );
        add(
            Role::CameraInfo,
            search.one(
                "camera_info",
                &names.camera_info,
                &[CameraInfo::TYPE],
                |_| true,
            )?,
        );
        let clouds = [PointCloud2::<'_>::TYPE];
        let lidar = search.one("lidar", &names.lidar, &clouds, |t| !is_dynamic(&t.name))?;
        add(Role::Lidar, lidar.clone());
        add(
            Role::Dynamic,
            search.dynamic(&names.dynamic, lidar.as_deref())?,
        );
        add(
            Role::Imu,
            search.one("imu", &names.imu, &[Imu::TYPE], |_| true)?,
        );
        let can = config.can.as_ref();
        let steered = can.is_some_and(|can| can.steering.is_some());
        let driven = can.is_some_and(|can| can.speed.is_some());
        if !search.on_can("steering", steered, &names.steering)? {
            add(Role::Steering, search.steering(&names.steering)?);
        }
        if !search.on_can("speed", driven, &names.speed)? {
            add(Role::Speed, search.speed(&names.speed)?);
        }
        if steered || driven {
            add(Role::Can, Some(search.can(&names.can)?));
        }
        let truth = match &names.truth {
            Some(_) => search.one("truth", &names.truth, &[Odometry::TYPE], |_| true)?,
            None => all
                .iter()
                .find(|t| t.name.starts_with(TRUTH) && t.type_name == Odometry::TYPE)
                .map(|t| t.name.clone()),
        };
        add(Role::Truth, truth);
        Ok(Self { found })
    }

    /// The topic of a role.
    pub(super) fn of(&self, role: Role) -> Option<&str> {
        let found = self.found.iter().find(|(r, _)| *r == role);
        found.map(|(_, name)| name.as_str())
    }

    /// What a topic is for; one topic can have several roles (speed and steering).
    pub(super) fn roles<'a>(&'a self, topic: &'a str) -> impl Iterator<Item = Role> + 'a {
        let of_topic = self.found.iter().filter(move |(_, name)| name == topic);
        of_topic.map(|(role, _)| *role)
    }
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
}

impl Search<'_> {
    /// The topic that the file names, or the only one of these types.
    fn one(
        &self,
        key: &str,
        named: &Option<String>,
        types: &[&str],
        fits: impl Fn(&TopicInfo) -> bool,
    ) -> Result<Option<String>> {
        if let Some(name) = named {
            let Some(topic) = self.all.iter().find(|t| t.name == *name) else {
                let there: Vec<&str> = self.all.iter().map(|t| t.name.as_str()).collect();
                return Err(self.error(format!("has no topic {name}"), || {
                    format!("topics.{key} must be one of: {}", there.join(", "))
                }));
            };
            if !types.contains(&topic.type_name.as_str()) {
                let problem = format!("{name} holds {}", topic.type_name);
                return Err(self.error(problem, || {
                    format!("topics.{key} must be a topic of {}", types.join(" or "))
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
            several => {
                let list: Vec<&str> = several.iter().map(|t| t.name.as_str()).collect();
                let problem = format!(
                    "{} topics could be the {key}: {}",
                    list.len(),
                    list.join(", ")
                );
                Err(self.error(problem, || {
                    format!("name it: [topics] {key} = \"{}\"", list[0])
                }))
            }
        }
    }

    /// Whether a quantity is read from CAN frames. No topic is looked for then: the values of two sources, each with its
    /// own scale, would be read as one's.
    fn on_can(&self, key: &str, signal: bool, named: &Option<String>) -> Result<bool> {
        match named {
            Some(name) if signal => Err(Error::Topic {
                path: self.config.to_owned(),
                problem: format!(
                    "topics.{key} (\"{name}\") and can.{key} both say where the {key} is"
                ),
                remedy: format!("keep one of them: delete topics.{key} or can.{key}"),
            }),
            _ => Ok(signal),
        }
    }

    /// The topic of CAN frames, without which `[can]` would silently say nothing.
    fn can(&self, named: &Option<String>) -> Result<String> {
        self.one("can", named, &[Frame::TYPE], |_| true)?
            .ok_or_else(|| {
                let problem = format!("has no topic of {}, which [can] reads", Frame::TYPE);
                self.error(problem, || "delete [can], or record the bus".into())
            })
    }

    /// The steering angle: a message that says so by its type. A bare number must be named.
    fn steering(&self, named: &Option<String>) -> Result<Option<String>> {
        let any = [AckermannDriveStamped::TYPE, Float32::TYPE, Float64::TYPE];
        let types = match named {
            Some(_) => &any[..],
            None => &any[..1],
        };
        self.one("steering", named, types, |_| true)
    }

    /// The vehicle's speed: a TwistStamped, else an odometry, else steering messages with a speed; never two of them.
    /// A bare number must be named, since its unit must be said too.
    fn speed(&self, named: &Option<String>) -> Result<Option<String>> {
        let any = [
            TwistStamped::TYPE,
            AckermannDriveStamped::TYPE,
            Odometry::TYPE,
            Float32::TYPE,
            Float64::TYPE,
        ];
        if named.is_some() {
            return self.one("speed", named, &any, |_| true);
        }
        for kind in [
            TwistStamped::TYPE,
            Odometry::TYPE,
            AckermannDriveStamped::TYPE,
        ] {
            if let Some(topic) = self.one("speed", &None, &[kind], |_| true)? {
                return Ok(Some(topic));
            }
        }
        Ok(None)
    }

    /// The cloud of what moves: of several in the bag the one in the LiDAR's namespace. Without a LiDAR it is of no use.
    fn dynamic(&self, named: &Option<String>, lidar: Option<&str>) -> Result<Option<String>> {
        let clouds = [PointCloud2::<'_>::TYPE];
        let one = |fits: &dyn Fn(&str) -> bool| {
            self.one("dynamic", named, &clouds, |t| {
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

    fn error(&self, problem: String, remedy: impl Fn() -> String) -> Error {
        Error::Topic {
            path: self.bag.to_owned(),
            problem,
            remedy: format!("{} (in {})", remedy(), self.config.display()),
        }
    }
}
