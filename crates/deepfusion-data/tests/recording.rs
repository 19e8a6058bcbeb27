//! A layout from another crate: what it must implement to be a [`Dataset`].

use deepfusion_data::{
    CalibrationPlace, Camera, DataWarning, Dataset, DatasetKind, DatasetParts, Error, Frame,
    FrameImage, GtKind, MovingLabels, MovingPixels, MovingSource, NoTrackReason, Recording, Result,
    RgbImage, Stream, VehicleTrack, speed_unit_warning,
};
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A warning that none of this library's variants covers.
static WARNINGS: [DataWarning; 1] = [DataWarning::Other(Cow::Borrowed("its gyroscope was warm"))];

/// Images that are computed on request, like a bag's are decoded.
#[derive(Debug, Default)]
struct Messages {
    decoded: Arc<AtomicUsize>,
    width: u32,
}

impl Recording for Messages {
    fn kind(&self) -> DatasetKind {
        DatasetKind::Folder
    }

    fn folder(&self) -> &Path {
        Path::new("/recordings")
    }

    fn load_image(&self, frame: &Frame) -> Result<RgbImage> {
        self.decoded.fetch_add(1, Ordering::Relaxed);
        let level = frame.number as u8;
        Ok(RgbImage::from_pixel(self.width, 30, image::Rgb([level; 3])))
    }

    fn calibration(&self) -> CalibrationPlace {
        CalibrationPlace {
            source: PathBuf::from("/recordings/a.bag").into(),
            field: "/camera/camera_info",
        }
    }

    fn streams(&self) -> Result<Vec<Stream>> {
        Ok(vec![Stream::new("/camera", "image", 5, &[0.0, 0.1, 0.2])])
    }

    fn no_motion(&self) -> Error {
        Error::NoTrack {
            drive: "a".into(),
            reason: NoTrackReason::Other {
                why: "no topic of speeds".into(),
                hint: "record one".into(),
            },
        }
    }

    fn warnings(&self) -> &[DataWarning] {
        &WARNINGS
    }

    fn moving_labels(&self, _: &Dataset) -> Result<Option<MovingLabels>> {
        Ok(Some(MovingLabels::new(MovingSource::Masks, Near)))
    }
}

/// Pixels nearer than 10 m move; the last frame has no labels.
#[derive(Debug)]
struct Near;

impl MovingPixels for Near {
    fn pixels(&self, frame: u64, truth: &DepthMap, _: GtKind) -> Result<Option<Vec<bool>>> {
        let moves = || truth.data.iter().map(|z| *z < 10.0).collect();
        Ok((frame < 4).then(moves))
    }
}

fn dataset(recording: Messages, track: Option<VehicleTrack>) -> Dataset {
    let frame = |n: u64| Frame {
        drive: "a".into(),
        number: n,
        time_s: Some(n as f64 * 0.1),
        image: FrameImage::Within {
            file: PathBuf::from("/recordings/a.bag"),
            index: n,
        },
        speed_mps: None,
    };
    let parts = DatasetParts {
        name: "a".into(),
        split_name: "a".into(),
        camera: Camera::Left,
        frames: (0..5).map(frame).collect(),
        intrinsics: Intrinsics {
            fx: 40.0,
            fy: 40.0,
            cx: 19.5,
            cy: 14.5,
            width: 40,
            height: 30,
        },
        cam_from_vehicle: Some(Se3::identity()),
        track: track.map(Into::into),
        yaw_known: false,
        origin_ns: None,
        camera_ahead_s: 0.0,
        scenario: None,
    };
    Dataset::new(parts, Arc::new(recording))
}

#[test]
fn images_are_decoded_on_request() {
    let decoded = Arc::new(AtomicUsize::new(0));
    let recording = Messages {
        decoded: Arc::clone(&decoded),
        width: 40,
    };
    let samples: Vec<_> = (0..6).map(|i| (f64::from(i) * 0.1, 5.0, 0.0)).collect();
    let dataset = dataset(recording, Some(VehicleTrack::new(&samples)));
    let snippets = dataset.snippets(&[-1, 1], 0.5).unwrap();
    assert_eq!((snippets.len(), decoded.load(Ordering::Relaxed)), (3, 0));
    assert_eq!(dataset.load_image(3).unwrap().get_pixel(0, 0).0, [3; 3]);
    assert_eq!(decoded.load(Ordering::Relaxed), 1);
    // Without turns, the images' motion cannot contradict the speeds' unit, so there is no warning.
    assert!(speed_unit_warning(&dataset).unwrap().is_none());
}

#[test]
fn errors_name_an_image_of_another_size_and_missing_speeds() {
    let recording = Messages {
        width: 41,
        ..Messages::default()
    };
    let dataset = dataset(recording, None);
    let error = dataset.load_image(2).unwrap_err().to_string();
    assert_eq!(
        error,
        "/recordings/a.bag, image 2: frame 2 of a is 41x30, but its calibration is for 40x30 \
         (/camera/camera_info in /recordings/a.bag)"
    );
    let error = dataset.snippets(&[1], 0.5).unwrap_err();
    assert_eq!(error.to_string(), "a: no topic of speeds");
    assert!(matches!(
        dataset.camera_paths().unwrap_err(),
        Error::NoPath { .. }
    ));
}

#[test]
fn a_layout_can_give_its_own_warnings() {
    let dataset = dataset(Messages::default(), None);
    assert_eq!(dataset.warnings(), &WARNINGS);
    assert_eq!(dataset.warnings()[0].to_string(), "its gyroscope was warm");
    assert!(dataset.damage().is_empty() && dataset.passed_over().is_none());
}

#[test]
fn a_layout_can_label_dynamic_pixels() {
    let labels = dataset(Messages::default(), None).moving_labels();
    let labels = labels.unwrap().unwrap();
    let truth = DepthMap {
        width: 2,
        height: 1,
        data: vec![5.0, 20.0],
    };
    let moving = |frame| labels.pixels(frame, &truth, GtKind::Z).unwrap();
    assert_eq!(labels.source(), MovingSource::Masks);
    assert_eq!((moving(2), moving(4)), (Some(vec![true, false]), None));
}
