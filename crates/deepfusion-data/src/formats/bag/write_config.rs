//! The file beside a bag, written of what was found in the bag: a beginning to correct and to complete.

use super::can_config::CanConfig;
use super::commands::is_command;
use super::config::{BagConfig, TopicNames};
use super::index::Index;
use super::mounts::Mounts;
use super::open::open_bag;
use super::source;
use super::topics::Topics;
use crate::formats::layout::Layout;
use crate::{ConfigProblem, Error, Mount, NamedTopic, OpenOptions, Result, TopicRole};
use deepfusion_hint::count_of;
use std::fmt::Write as _;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// What stands above every such file.
const HEAD: &str = concat!(
    "# What is read of the bag beside this file, as it was found there. What stands here goes before what the\n",
    "# bag itself says. Every key: ",
    env!("CARGO_PKG_REPOSITORY"),
    "/blob/main/docs/reference/bag-toml.md\n"
);
/// What the tables of the file that was there already are followed by, where they have no such thing.
const VEHICLE: &str = "\n# [vehicle]\n# wheelbase_m = 2.7        # without it steering angles are not used\n\
    # speed_scale = 1.0        # true speed over the vehicle's\n";
const CAMERA_PLACE: &str = "\n# Nothing says where the camera is on the vehicle: it is taken to look ahead and to move as the rear axle does.\n\
    # [cam_from_vehicle]       # camera: x right, y down, z forward; vehicle: x forward, y left, z up\n\
    # translation = [0.0, 1.2, -1.6]               # metres: a camera 1.6 m ahead of the rear axle, 1.2 m above it\n\
    # rotation = [1.2092, -1.2092, 1.2092]         # an axis-angle vector in radians: it looks ahead\n";

/// Writes the file beside each bag at a path (`<bag>.toml`; `bag.toml` within a ROS 2 bag that is a folder): the topics, the
/// mounts and who says them, and of the options the camera, the topics and the clock. What a file had to say before stays, its
/// comments do not. Gives the files.
///
/// # Errors
/// [`Error::Exists`] where there is such a file and `overwrite` is not set; [`Error::NotABag`]; what opening says.
pub fn write_bag_config(
    path: &Path,
    options: &OpenOptions,
    overwrite: bool,
) -> Result<Vec<PathBuf>> {
    let layout = Layout::of(path)?;
    let Layout::Bags(bags) = &layout else {
        return Err(Error::NotABag {
            path: path.to_owned(),
            layout: layout.kind().label(),
        });
    };
    let mut texts = Vec::new();
    for bag in bags {
        let target = target(bag)?;
        if target.exists() && !overwrite {
            return Err(Error::Exists { path: target });
        }
        texts.push((described(bag, options)?, target));
    }
    for (text, target) in &texts {
        deepfusion_fs::write(target, text).map_err(|e| Error::file(target, e))?;
    }
    Ok(texts.into_iter().map(|(_, target)| target).collect())
}

/// The bag's own file, which no other bag of its folder reads.
fn target(bag: &Path) -> Result<PathBuf> {
    let first = BagConfig::candidates(bag).into_iter().next();
    first.ok_or_else(|| Error::file(bag, ErrorKind::NotFound.into()))
}

/// The text of a bag's file.
fn described(path: &Path, options: &OpenOptions) -> Result<String> {
    let bag = source::open(path)?;
    let config = BagConfig::of(path, options)?;
    let topics = Topics::find(bag.as_ref(), &config)?;
    let index = Index::read(bag.as_ref(), &topics, &config)?;
    let mounts = Mounts::find(path, &config, &index, &mut Vec::new())?;
    let mut own: Table = crate::dataset_toml::read_or_default(&config.path)?;
    for key in [
        "topics",
        "cam_from_lidar",
        "cam_from_vehicle",
        "vehicle_from_imu",
    ] {
        own.remove(key);
    }
    if let Some(can) = own.get_mut("can").and_then(Value::as_table_mut) {
        remove_named_signals(can, config.can.as_ref());
    }
    let given = options.calibration.as_ref();
    let given = given.filter(|_| options.intrinsics.is_none() && options.hfov_deg.is_none());
    if let Some(file) = given {
        let file = std::path::absolute(file).map_err(|e| Error::file(file, e))?;
        own.remove("camera");
        let file = file.to_string_lossy().into_owned();
        own.insert("calibration".into(), file.into());
    } else if options.gives_camera() {
        let k = open_bag(bag.clone(), options)?.intrinsics(0);
        let mut camera = Table::new();
        for (key, value) in [("fx", k.fx), ("fy", k.fy), ("cx", k.cx), ("cy", k.cy)] {
            camera.insert(key.into(), value.into());
        }
        for (key, value) in [("width", k.width), ("height", k.height)] {
            camera.insert(key.into(), i64::from(value).into());
        }
        own.remove("calibration");
        own.insert("camera".into(), camera.into());
    }
    if let Some(ahead_s) = options.camera_ahead_s {
        let clock = own.entry("clock").or_insert_with(|| Table::new().into());
        if let Some(clock) = clock.as_table_mut() {
            clock.insert("camera_ahead_s".into(), ahead_s.into());
        }
    }
    let file = config.path.display().to_string();
    let mut text = String::from(HEAD);
    let is_table = |value: &Value| matches!(value, Value::Table(_));
    // Bare keys belong above the first table.
    for (key, value) in own.iter().filter(|(_, value)| !is_table(value)) {
        let _ = write!(text, "\n{key} = {value}");
    }
    if own.values().any(|value| !is_table(value)) {
        text.push('\n');
    }
    text += &topics_text(&topics, &config.topics, &bag.topics()?);
    if !own.contains_key("camera") && !own.contains_key("calibration") {
        text += match &index.camera_info {
            Some(info) if info.k[0] > 0.0 => "\n# The camera is as CameraInfo has it.\n",
            _ => {
                "\n# The bag has no CameraInfo.\n# [camera]                 # pixels, of the images as they are\n\
                 # fx = 700.0\n# fy = 700.0\n# cx = 320.0\n# cy = 240.0\n# width = 640\n# height = 480\n"
            }
        };
    }
    for mount in &mounts.said {
        text += &mount_text(mount, &file);
    }
    if !mounts.said.iter().any(|m| m.name == "cam_from_vehicle") {
        text += CAMERA_PLACE;
    }
    for (key, value) in own.iter().filter(|(_, value)| is_table(value)) {
        let mut alone = Table::new();
        alone.insert(key.clone(), value.clone());
        text.push('\n');
        text += &toml::to_string(&alone)
            .map_err(|e| config.wrong(ConfigProblem::Unwritable(Box::new(e))))?;
    }
    if !own.contains_key("vehicle") {
        text += VEHICLE;
    }
    Ok(text)
}

/// Takes the signals out of `[can]` that a caller's topic, or none of the caller's, stands for now: `read` has them no more.
fn remove_named_signals(can: &mut Table, read: Option<&CanConfig>) {
    let signals = [
        (TopicRole::Speed, read.and_then(|can| can.speed.as_ref())),
        (
            TopicRole::Steering,
            read.and_then(|can| can.steering.as_ref()),
        ),
    ];
    for (role, signal) in signals {
        if signal.is_none() {
            can.remove(role.name());
        }
    }
}

/// `[topics]`: which was found for what, and for what none is to be read.
fn topics_text(
    topics: &Topics,
    names: &TopicNames,
    all: &[deepfusion_rosbag::TopicInfo],
) -> String {
    let mut text = String::from("\n[topics]\n");
    for (role, name) in &topics.found {
        let about = all.iter().find(|t| t.name == *name);
        let about = about.map_or(String::new(), |t| {
            format!("   # {}, {}", t.type_name, count_of(t.count, "message"))
        });
        // Written as a key it would stand for a choice of the user's, and nothing would warn of it any more.
        let own_choice = is_command(name) && names.of(*role).is_none();
        let off = if own_choice && matches!(role, TopicRole::Speed | TopicRole::Steering) {
            "# by its name a command: "
        } else {
            ""
        };
        let name = Value::String(name.clone());
        let _ = writeln!(text, "{off}{role} = {name}{about}");
    }
    for role in TopicRole::ALL
        .into_iter()
        .filter(|role| names.is_none(*role))
    {
        let _ = writeln!(text, "{role} = \"{}\"", NamedTopic::NONE);
    }
    text
}

/// A transform, and who says it.
fn mount_text(mount: &Mount, file: &str) -> String {
    let three = |v: [f64; 3]| format!("[{:?}, {:?}, {:?}]", v[0], v[1], v[2]);
    let source = if mount.source == file {
        "as it was here before"
    } else {
        &mount.source
    };
    format!(
        "\n[{}]   # {source}\ntranslation = {}\nrotation = {}\n",
        mount.name,
        three(mount.translation),
        three(mount.rotation)
    )
}
