//! The scale of a depth image, from how the scene moves in a neighbouring image while the vehicle drives.
//!
//! How far a point at depth Z moves in the image depends on the camera's translation t and on Z. The translation is measured in metres, so
//! the motion in the image gives Z in metres. [`align`] first finds the camera's rotation and direction of motion between the two images. A
//! vehicle's sensors measure these too coarsely: a tenth of a degree of pitch moves the image as much as a metre of driving. Then, for
//! patches all over the image, [`scene_points`] finds the factor on their depth at which they match the other image:
//!
//! s\* = argmax over s of ZNCC(I₁(p), I₀(π(K (R s·D(p) K⁻¹ p + t))))
//!
//! with the length of t as *measured*. Depth is right in metres if ln s\* is 0, and too near if it is positive. Nothing is averaged over
//! the image before the factor is found, so a dynamic object is an outlier and not a bias. For a camera that looks in the direction of
//! motion, the motion in the image does not depend on its focal length: a wrong calibration shows as a wrong scale of the depth.

mod align;
mod points;
mod pyramid;

pub use align::{Alignment, align};
pub use points::{DepthImage, SceneFactor, View, scene_points};
pub use pyramid::GreyPyramid;
