//! Finds the camera and lens of a bag.

use super::config::BagConfig;
use super::index::Index;
use super::source;
use super::topics::Topics;
use crate::camera::FISHEYE;
use crate::{
    CalibrationPlace, CalibrationSource, CameraCalibration, CameraInfoProblem, CameraProblem,
    ConfigProblem, Error, Lens, OpenOptions, Result, TopicRole,
};
use deepfusion_geometry::{Distortion, Intrinsics};
use deepfusion_rosbag::MessageSource;
use deepfusion_rosbag::msg::CameraInfo;
use std::path::{Path, PathBuf};

/// The camera from the options, the file beside the bag, CameraInfo, the profile or the assumed camera, in this order. The returned flag
/// is true for an assumed camera.
///
/// # Errors
/// [`Error::NoBagCamera`] if there is none of these, [`Error::CameraFile`] if the camera is invalid, [`Error::FrameSize`] if its size
/// differs from that of the first image.
pub(super) fn find(
    messages: &dyn MessageSource,
    topics: &Topics,
    index: &Index,
    (width, height): (u32, u32),
    config: &BagConfig,
    options: &OpenOptions,
) -> Result<(Lens, CalibrationPlace, bool)> {
    let bag = messages.path();
    let topic = topics.of(TopicRole::Image).unwrap_or_default();
    let rectified = is_rectified(topic);
    let place = |file: &Path, field| CalibrationPlace {
        source: file.into(),
        field,
    };
    let pinhole = |intrinsics: Intrinsics| Ok((intrinsics, Distortion::default()));
    let mut assumed = false;
    let (camera, place) = if let Some(numbers) = options.given_camera((width, height)) {
        let given = Intrinsics::from_numbers(numbers, (width, height));
        let place = CalibrationPlace {
            source: CalibrationSource::Given,
            field: "the first image's size, as none is given",
        };
        (pinhole(given), place)
    } else if let Some(file) = &options.calibration {
        let camera = calibrated(config, file, (width, height), rectified)?;
        let place = camera.place();
        (Ok((camera.intrinsics, camera.distortion)), place)
    } else if let Some(camera) = config.camera {
        (pinhole(camera.intrinsics()), place(&config.path, "camera"))
    } else if let Some(file) = &config.calibration {
        let file = named(config, file)?;
        let camera = calibrated(config, &file, (width, height), rectified)?;
        let place = camera.place();
        (Ok((camera.intrinsics, camera.distortion)), place)
    } else if let Some(info) = index.camera_info.as_ref().filter(|info| info.k[0] > 0.0) {
        let camera = of_camera_info(info, (width, height), rectified);
        (camera, place(bag, "CameraInfo"))
    } else if let Some(camera) = config.profile_camera {
        (pinhole(camera.intrinsics()), place(&config.path, "profile"))
    } else if let Some(numbers) = options.assumed_numbers((width, height)) {
        assumed = true;
        let camera = Intrinsics::from_numbers(numbers, (width, height));
        (pinhole(camera), place(bag, "the assumed camera"))
    } else {
        return Err(Error::NoBagCamera {
            path: bag.to_owned(),
            config: config.path.clone(),
        });
    };
    let wrong = |problem: CameraInfoProblem| Error::CameraFile {
        by: place.source.clone(),
        problem: problem.into(),
    };
    let (camera, distortion) = camera.map_err(wrong)?;
    // Check before the lens is built, which needs memory for each pixel.
    if (camera.width, camera.height) != (width, height) {
        return Err(Error::FrameSize {
            image: format!("{}, image 0", bag.display()),
            drive: source::name(bag),
            frame: 0,
            found: (width, height),
            expected: (camera.width, camera.height),
            field: place.field,
            calibration: place.source,
        });
    }
    let lens = Lens::new(camera, &distortion).map_err(|problem| wrong(problem.into()))?;
    Ok((lens, place, assumed))
}

/// The calibration file that the file beside the bag names.
fn named(config: &BagConfig, file: &Path) -> Result<PathBuf> {
    let path = config.folder().join(file);
    if path.is_file() {
        Ok(path)
    } else {
        Err(config.wrong(ConfigProblem::NoFile {
            key: "calibration",
            path,
        }))
    }
}

/// The camera of a calibration file.
fn calibrated(
    config: &BagConfig,
    file: &Path,
    size: (u32, u32),
    rectified: bool,
) -> Result<CameraCalibration> {
    let calibration = CameraCalibration::read(file, size)?;
    // Such a file describes the raw images. Rectified ones have another matrix and no distortion.
    if rectified && !calibration.distortion.is_none() {
        return Err(Error::CameraFile {
            by: file.into(),
            problem: CameraProblem::Rectified {
                config: config.path.clone(),
            },
        });
    }
    Ok(calibration)
}

/// Whether a topic has rectified images according to its name: `/camera/image_rect_color`, `/rectified/image`, but not `/direct/image`.
fn is_rectified(topic: &str) -> bool {
    let mut words = topic.split(['/', '_', '-', '.']);
    words.any(|word| word == "rect" || word.starts_with("rectif"))
}

/// The camera in a CameraInfo message: P without distortion for rectified images, K with distortion for raw ones. A message without a
/// size has that of the images.
fn of_camera_info(
    info: &CameraInfo,
    image_size: (u32, u32),
    rectified: bool,
) -> std::result::Result<(Intrinsics, Distortion), CameraInfoProblem> {
    let size = match (info.width, info.height) {
        (0, 0) => image_size,
        stated => stated,
    };
    let of = |fx, fy, cx, cy| Intrinsics::from_numbers([fx, fy, cx, cy], size);
    if rectified && info.p[0] > 0.0 {
        let p = &info.p;
        return Ok((of(p[0], p[5], p[2], p[6]), Distortion::default()));
    }
    if rectified && info.d.iter().any(|d| *d != 0.0) {
        // K and D describe the raw images, so the distortion would be corrected twice.
        return Err(CameraInfoProblem::NoProjection);
    }
    let known = ["plumb_bob", "rational_polynomial", ""];
    let model = info.distortion_model.as_str();
    let fisheye = FISHEYE.contains(&model);
    if !(fisheye || known.contains(&model)) && info.d.iter().any(|d| *d != 0.0) {
        let name = model.to_owned();
        return Err(CameraInfoProblem::Model { name });
    }
    let distortion = match info.d.as_slice() {
        d if fisheye => Distortion::from_fisheye(d)?,
        [] => Distortion::default(),
        d => Distortion::from_opencv(d)?,
    };
    let k = &info.k;
    Ok((of(k[0], k[4], k[2], k[5]), distortion))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectified_images_are_recognised_by_their_topic() {
        for topic in [
            "/camera/image_rect",
            "/camera/image_rect_color/compressed",
            "/left/rectified",
            "/a/rect-image",
        ] {
            assert!(is_rectified(topic), "{topic}");
        }
        for topic in [
            "/cam_direct/image_raw",
            "/camera/image_unrectified",
            "/camera/image_raw",
            "",
        ] {
            assert!(!is_rectified(topic), "{topic}");
        }
    }

    fn info(model: &str, d: &[f64]) -> CameraInfo {
        CameraInfo {
            width: 64,
            height: 48,
            distortion_model: model.into(),
            d: d.to_vec(),
            k: [40.0, 0.0, 31.5, 0.0, 41.0, 23.5, 0.0, 0.0, 1.0],
            header: deepfusion_rosbag::msg::Header::default(),
            r: [0.0; 9],
            p: [0.0; 12],
            binning_x: 0,
            binning_y: 0,
            roi: deepfusion_rosbag::msg::RegionOfInterest::default(),
        }
    }

    #[test]
    fn the_distortion_model_determines_the_coefficients() {
        let d = [0.1, -0.02, 0.003, -0.0004];
        let k = Intrinsics::from_numbers([40.0, 41.0, 31.5, 23.5], (64, 48));
        let by = |distortion| Lens::new(k, &distortion).unwrap().intrinsics();
        let fisheye = by(Distortion::from_fisheye(&d).unwrap());
        let brown = by(Distortion::from_opencv(&d).unwrap());
        assert_ne!(fisheye, brown);
        let read = |model, d: &[f64]| of_camera_info(&info(model, d), (64, 48), false);
        let lens = |model, d: &[f64]| {
            let (camera, distortion) = read(model, d).unwrap();
            Lens::new(camera, &distortion).unwrap()
        };
        assert_eq!(lens("equidistant", &d).intrinsics(), fisheye);
        assert_eq!(lens("plumb_bob", &d).intrinsics(), brown);
        // An equidistant lens is a fisheye even with all coefficients 0; a camera without distortion is a pinhole.
        assert!(lens("equidistant", &[0.0; 4]).distorts());
        assert!(!lens("plumb_bob", &[]).distorts());
        let sizeless = CameraInfo {
            width: 0,
            height: 0,
            ..info("plumb_bob", &d)
        };
        assert_eq!(of_camera_info(&sizeless, (64, 48), false).unwrap().0, k);
        for (model, d, why) in [
            ("equidistant", &d[..0], "k1, k2, k3, k4"),
            ("equidistant", &[f64::NAN; 4], "NaN"),
            ("division", &d, "distortion_model is division, expected"),
        ] {
            let error = read(model, d).unwrap_err().to_string();
            assert!(error.contains(why), "{error}");
        }
    }
}
