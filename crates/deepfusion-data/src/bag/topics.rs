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
        add(
            Role::Lidar,
            search.one("lidar", &names.lidar, &clouds, |t| {
                !t.name.to_lowercase().contains(DYNAMIC)
            })?,
        );
        add(
            Role::Imu,
            search.one("imu", &names.imu, &[Imu::TYPE], |_| true)?,
        );
        add(
            Role::Steering,
            search.one(
                "steering",
                &names.steering,
                &[AckermannDriveStamped::TYPE],
                |_| true,
            )?,
        );
        add(Role::Speed, search.speed(&names.speed)?);
        if config.can.is_some() {
            add(
                Role::Can,
                search.one("can", &names.can, &[Frame::TYPE], |_| true)?,
            );
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

    /// The vehicle's speed: a TwistStamped, else steering messages with a speed, else an odometry. A bare number
    /// must be named, since its unit must be said too.
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

    fn error(&self, problem: String, remedy: impl Fn() -> String) -> Error {
        Error::Topic {
            path: self.bag.to_owned(),
            problem,
            remedy: format!("{} (in {})", remedy(), self.config.display()),
        }
    }
}
