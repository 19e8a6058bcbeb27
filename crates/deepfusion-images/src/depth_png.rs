//! KITTI's annotated depth: 16-bit grey PNG, depth = value / 256 metres, 0 = none.

use super::files;
use crate::{Error, ImageProblem, Result};
use deepfusion_geometry::DepthMap;
use image::{DynamicImage, ImageBuffer, ImageFormat, Luma};
use std::path::Path;

const STEPS_PER_M: f32 = 256.0;

/// Reads a 16-bit depth PNG, in metres.
///
/// # Errors
/// As [`crate::load_rgb`], and [`Error::Image`] for an image that is not 16-bit grey: in 8-bit pictures
/// of depth the metres are lost.
pub fn read_depth_png(path: &Path) -> Result<DepthMap> {
    let DynamicImage::ImageLuma16(image) = files::decode(path)? else {
        return Err(Error::Image {
            path: path.to_owned(),
            problem: ImageProblem::NotAnnotatedDepth,
        });
    };
    Ok(DepthMap {
        width: image.width() as usize,
        height: image.height() as usize,
        data: image
            .as_raw()
            .iter()
            .map(|value| f32::from(*value) / STEPS_PER_M)
            .collect(),
    })
}

/// Writes depth as a 16-bit PNG in steps of 1/256 m, atomically. Depths beyond 255.99 m are clamped to it;
/// those below a step become one step, since 0 means none.
///
/// # Errors
/// [`Error::File`] if writing fails.
pub fn write_depth_png(depth: &DepthMap, path: &Path) -> Result<()> {
    let steps = |d: &f32| {
        if *d > 0.0 {
            (d * STEPS_PER_M).round().clamp(1.0, 65_535.0) as u16
        } else {
            0
        }
    };
    let values: Vec<u16> = depth.data.iter().map(steps).collect();
    let (width, height) = (depth.width as u32, depth.height as u32);
    let image = ImageBuffer::<Luma<u16>, _>::from_raw(width, height, values).ok_or_else(|| {
        let problem = format!("{} depths are not a {width}x{height} map", depth.data.len());
        Error::file(path, std::io::Error::other(problem))
    })?;
    files::write_png(path, |out| image.write_to(out, ImageFormat::Png))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        /// Depth is read as it was written, to half a step; missing depth stays missing.
        #[test]
        fn depth_survives_the_file(depths in proptest::collection::vec(prop_oneof![Just(0.0f32), 0.01..255.9f32], 12)) {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("d.png");
            let map = DepthMap { width: 4, height: 3, data: depths };
            write_depth_png(&map, &path).unwrap();
            let read = read_depth_png(&path).unwrap();
            prop_assert_eq!((read.width, read.height), (4, 3));
            for (a, b) in map.data.iter().zip(&read.data) {
                prop_assert!((a - b).abs() <= 0.5 / 256.0, "{} {}", a, b);
                prop_assert_eq!(*a > 0.0, *b > 0.0);
            }
        }
    }

    #[test]
    fn values_beyond_the_format_are_clamped_to_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.png");
        let map = DepthMap {
            width: 4,
            height: 1,
            data: vec![1000.0, 0.001, f32::NAN, f32::INFINITY],
        };
        write_depth_png(&map, &path).unwrap();
        let read = read_depth_png(&path).unwrap().data;
        let farthest = 65_535.0 / 256.0;
        assert_eq!(read, [farthest, 1.0 / 256.0, 0.0, farthest]);
    }

    #[test]
    fn a_colour_picture_is_not_depth() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("colour.png");
        crate::save_png(&image::RgbImage::new(3, 2), &path).unwrap();
        let error = read_depth_png(&path).unwrap_err();
        assert!(error.to_string().contains("16-bit"), "{error}");
    }
}
