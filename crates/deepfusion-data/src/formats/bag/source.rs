//! Recognises bags, and opens the reader for each kind.

use crate::{Error, Result};
use deepfusion_rosbag::{Bag, MessageSource};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Whether a path is a bag: a ROS 1 bag by its name, a ROS 2 bag if built with the feature `ros2`.
pub(crate) fn is_bag(path: &Path) -> bool {
    is_ros1_bag(path) || is_ros2_bag(path)
}

fn is_ros1_bag(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str());
    path.is_file() && extension.is_some_and(|e| e.eq_ignore_ascii_case("bag"))
}

#[cfg(feature = "ros2")]
fn is_ros2_bag(path: &Path) -> bool {
    deepfusion_ros2bag::is_ros2_bag(path)
}

#[cfg(not(feature = "ros2"))]
fn is_ros2_bag(_path: &Path) -> bool {
    false
}

/// The bags of a folder, by name.
///
/// # Errors
/// [`Error::File`].
pub(crate) fn bags_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut bags = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, e))? {
        let path = entry.map_err(|e| Error::file(folder, e))?.path();
        if is_bag(&path) {
            bags.push(path);
        }
    }
    bags.sort();
    Ok(bags)
}

/// # Errors
/// [`Error::Bag`].
pub(super) fn open(path: &Path) -> Result<Arc<dyn MessageSource>> {
    #[cfg(feature = "ros2")]
    {
        // The reader depends on the file name, which a link may lack.
        let real = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if let Some(bag) = [path, real.as_path()]
            .into_iter()
            .find(|path| is_ros2_bag(path))
        {
            return Ok(Arc::new(deepfusion_ros2bag::Ros2Bag::open(bag)?));
        }
    }
    Ok(Arc::new(Bag::open(path)?))
}

/// A bag's name: the file's name without its extension, or the folder's name.
pub(super) fn name(path: &Path) -> String {
    let name = if path.is_dir() {
        path.file_name()
    } else {
        path.file_stem()
    };
    name.unwrap_or_default().to_string_lossy().into_owned()
}
