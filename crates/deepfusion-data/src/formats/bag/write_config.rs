//! Writes the file beside a bag from what was found in the bag, for the user to correct and complete.

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

/// Header of every such file.
const HEAD: &str = concat!(
    "# What is read from the bag beside this file. Values here take precedence over those in the bag.\n",
    "# All keys: ",
    env!("CARGO_PKG_REPOSITORY"),
    "/blob/main/docs/reference/bag-toml.md\n"
);
/// Examples at the end of the file for tables that it does not have.
const VEHICLE: &str = "\n# [vehicle]\n# wheelbase_m = 2.7        # without it steering angles are not used\n\
    # speed_scale = 1.0        # true speed / measured speed\n";
const CAMERA_PLACE: &str = "\n# The camera's mount is not given: assuming that it looks straight ahead from the rear axle.\n\
    # [cam_from_vehicle]       # camera: x right, y down, z forward; vehicle: x forward, y left, z up\n\
    # translation = [0.0, 1.2, -1.6]               # metres: a camera 1.6 m ahead of the rear axle, 1.2 m above it\n\
    # rotation = [1.2092, -1.2092, 1.2092]         # an axis-angle vector in radians: it looks ahead\n";

/// Writes the file beside each bag at a path (`<bag>.toml`; `bag.toml` within a ROS 2 bag that is a folder): the topics, the
/// mounts with their sources, and the camera, topics and clock from the options. Settings of an existing file are kept, its
/// comments are not. Returns the files' paths.
///
/// # Errors
/// [`Error::Exists`] if the file exists and `overwrite` is not set; [`Error::NotABag`]; and the errors of opening the bag.
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

/// Path of the bag's own file, which is not shared with other bags of the folder.
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
    // Top-level keys belong above the first table.
    for (key, value) in own.iter().filter(|(_, value)| !is_table(value)) {
        let _ = write!(text, "\n{key} = {value}");
    }
    if own.values().any(|value| !is_table(value)) {
        text.push('\n');
    }
    text += &topics_text(&topics, &config.topics, &bag.topics()?);
    if !own.contains_key("camera") && !own.contains_key("calibration") {
        text += match &index.camera_info {
            Some(info) if info.k[0] > 0.0 => "\n# The camera is taken from CameraInfo.\n",
            _ => {
                "\n# The bag has no CameraInfo.\n# [camera]                 # in pixels of the bag's images\n\
                 # fx = 700.0\n# fy = 700.0\n# cx = 320.0\n# cy = 240.0\n# width = 640\n# height = 480\n"
            }
        };
    }
    for mount in &mounts.known {
        text += &mount_text(mount, &file);
    }
    if !mounts.known.iter().any(|m| m.name == "cam_from_vehicle") {
        text += CAMERA_PLACE;
    }
    for (key, value) in own.iter().filter(|(_, value)| is_table(value)) {
        let mut table = Table::new();
        table.insert(key.clone(), value.clone());
        text.push('\n');
        text += &toml::to_string(&table)
            .map_err(|e| config.wrong(ConfigProblem::Unwritable(Box::new(e))))?;
    }
    if !own.contains_key("vehicle") {
        text += VEHICLE;
    }
    Ok(text)
}

/// Removes the signals from `[can]` that the caller replaced by a topic or by `none`: `read` no longer has them.
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

/// `[topics]`: the topics found for each role, and the roles for which none is to be read.
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
        // As a key it would count as the user's choice, and the warning about it would disappear.
        let own_choice = is_command(name) && names.of(*role).is_none();
        let off = if own_choice && matches!(role, TopicRole::Speed | TopicRole::Steering) {
            "# a command by its name: "
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

/// A transform, with its source.
fn mount_text(mount: &Mount, file: &str) -> String {
    let three = |v: [f64; 3]| format!("[{:?}, {:?}, {:?}]", v[0], v[1], v[2]);
    let source = if mount.source == file {
        "as before in this file"
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
