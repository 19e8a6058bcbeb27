//! Pictures: read from files and written to them, resized, drawn over.

mod depth_png;
mod exif_camera;
mod files;
mod jpeg;
mod known_cameras;
mod overlay;
mod photo;
mod resize;

pub use depth_png::{read_depth_png, write_depth_png};
pub(crate) use exif_camera::{ExifCamera, exif_camera};
pub(crate) use files::decode;
pub use files::{decode_rgb, image_size, load_rgb, save_png};
pub use overlay::overlay;
pub use photo::{Photo, load_photo};
pub use resize::{resize_rgb, to_chw, to_network_input};
