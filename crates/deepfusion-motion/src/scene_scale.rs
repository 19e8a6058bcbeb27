//! The scale of a depth image, from how the scene moves in a neighbouring image as the vehicle drives.
//!
//! A point at depth Z moves in the image by what the camera's way t and Z give; the way is measured in metres, so the movement
//! tells Z in metres. [`align`] first finds how the camera turned and where it headed between the two images. A vehicle's sensors know that
//! too coarsely: a tenth of a degree of pitch moves the picture as much as a metre of driving. [`scene_points`] then finds, for
//! patches all over the image, the factor on their depth with which they are found again in the other image:
//!
//! s\* = argmax over s of ZNCC(I₁(p), I₀(π(K (R s·D(p) K⁻¹ p + t))))
//!
//! with the length of t that was *measured*. Depth is right in metres where ln s\* is 0, and too near where it is positive. Nothing is
//! averaged over the image before the factor is found, so that a dynamic object is an outlier and not a bias. For a camera that
//! goes where it looks, the movement does not depend on its focal length: a wrong calibration shows as a wrong scale of the depth.

mod align;
mod points;
mod pyramid;

pub use align::{Alignment, align};
pub use points::{DepthImage, SceneFactor, View, scene_points};
pub use pyramid::GreyPyramid;
