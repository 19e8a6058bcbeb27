//! Images for depth networks.
//!
//! [`load_photo`] reads a single picture, upright, with the camera from EXIF; [`load_rgb`] reads a frame as it is stored. A truncated file
//! is refused: decoders silently fill the missing part with grey. [`to_network_input`] resizes as PIL does and
//! returns the network's input, [`read_depth_png`] and [`write_depth_png`] read and write depth as KITTI does.

mod depth_png;
mod error;
mod exif_camera;
mod files;
mod jpeg;
mod known_cameras;
mod photo;
mod resize;

pub use deepfusion_fs::FileError;
pub use depth_png::{read_depth_png, write_depth_png};
pub use error::{Error, ImageProblem, Result};
pub use exif_camera::{ExifCamera, exif_block_camera, exif_camera};
pub use files::{
    IMAGE_ENDINGS, check_complete, decode, decode_bytes, decode_rgb, image_size, is_image,
    load_rgb, save_png,
};
pub use image::RgbImage;
pub use photo::{Photo, load_photo};
pub use resize::{resize_rgb, to_chw, to_network_input};
