//! What of a bag of ROS 2 cannot be read.

use deepfusion_rosbag::SourceDamage;
use std::fmt;
use std::path::PathBuf;

/// What of a bag of ROS 2 cannot be read: what the [`SourceDamage`] of such a bag holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BagDamage {
    /// Its files that cannot be read, or not all of them; at least one.
    pub files: Vec<FileDamage>,
}

impl fmt::Display for BagDamage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said: Vec<String> = self.files.iter().map(FileDamage::to_string).collect();
        f.write_str(&said.join("; "))
    }
}

impl std::error::Error for BagDamage {}

/// What of a bag's file cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FileDamage {
    /// Not all of it: what its reader found, a [`McapDamage`](crate::McapDamage) or, with the feature `ros2-sqlite`, a `DatabaseDamage`.
    #[error(transparent)]
    Unreadable(SourceDamage),
    /// `metadata.yaml` names it, and it is not there.
    #[error("{} is not there", .0.display())]
    NotThere(PathBuf),
}
