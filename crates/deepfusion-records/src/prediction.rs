//! The record beside every prediction.

use std::path::PathBuf;

use deepfusion_eval::compare::MetricScale;
use serde::{Deserialize, Serialize};

use crate::{FileMark, LiveMark, MadeWith, ScaleRecord};

/// What is known of an image's depth: its camera, and how far its metres can be trusted. Missing fields take their defaults, so that files
/// of other programs and older versions can be shown.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PredictionRecord {
    /// Path of the input.
    pub image: Option<PathBuf>,
    /// Mark of the input's file, to notice changes; for a live source's frame, the size of its pixels and when they arrived.
    pub image_file: Option<FileMark>,
    /// The input's width and height.
    pub size: Option<[u32; 2]>,
    /// Whether depth, camera and boxes refer to the image after the lens's distortion was removed; the input's file still has it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub undistorted: bool,
    /// Unit of the depths.
    pub unit: String,
    /// The given run or checkpoint, or the embedded network's name.
    pub model: PathBuf,
    /// SHA-256 of an embedded or packed network's weights: the name does not determine the version.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model_sha256: Option<String>,
    /// Steps the checkpoint was trained for.
    pub checkpoint_step: usize,
    /// fx, fy, cx, cy in pixels of the input.
    pub intrinsics: Option<[f64; 4]>,
    /// `given`, `recording` (its own calibration), `exif` (the lens's nominal focal length), `learned` (by the network's run, from
    /// recordings without calibration), `assumed` or `unknown`.
    pub intrinsics_from: String,
    /// Whether the camera is known, so that depth is right for its focal length: it was given, or comes from the recording or from EXIF.
    pub camera_known: bool,
    /// The scale of this checkpoint's depth, as measured on recordings that it was not trained on.
    pub scale: MetricScale,
    /// The factor by which depth was multiplied, for a focal length other than the one trained with.
    pub focal_factor: f64,
    /// x, y, width and height of the part of the image that the network saw; depth is 0 outside.
    pub window: [u32; 4],
    /// Smallest and largest depth, in metres; `None` if no pixel has a depth.
    pub depth_m: Option<[f32; 2]>,
    /// Whether the scale of the recording's depth has changed, if it is monitored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale_monitor: Option<ScaleRecord>,
}

/// A prediction's sidecar. It is written last, so its presence means that the outputs are complete.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sidecar {
    /// The image and its depth.
    #[serde(flatten)]
    pub prediction: PredictionRecord,
    /// The outputs' names, in the sidecar's folder.
    pub files: Vec<String>,
    /// The outputs' sizes in bytes, to notice a truncated file.
    pub file_bytes: Vec<u64>,
    /// The outputs' CRC-32 as eight hexadecimal digits, to notice a file that a power cut left as zeros. A sidecar of an older version has
    /// none: its outputs are made again.
    #[serde(default)]
    pub file_crc32: Vec<String>,
    /// For a live source's frame: when it arrived, and how late its depth was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub live: Option<LiveMark>,
    /// What else the outputs depend on.
    pub made_with: MadeWith,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Difference;
    use deepfusion_motion::{ScaleReading, ScaleState};

    fn sidecar() -> Sidecar {
        Sidecar {
            prediction: PredictionRecord {
                image: Some("street/5.png".into()),
                image_file: Some(FileMark {
                    bytes: 1234,
                    modified_ns: Some(1_767_225_600_123_456_789),
                }),
                size: Some([1242, 375]),
                undistorted: false,
                unit: "metres".into(),
                model: "street".into(),
                model_sha256: Some("ab".into()),
                checkpoint_step: 500,
                intrinsics: Some([721.5, 721.5, 609.6, 172.9]),
                intrinsics_from: "given".into(),
                camera_known: true,
                scale: MetricScale::default(),
                focal_factor: 1.0,
                window: [0, 1, 1242, 373],
                depth_m: Some([5.9, 80.0]),
                scale_monitor: Some(ScaleRecord {
                    reading: ScaleReading {
                        ratio: Some(1.1),
                        ci95: None,
                        height_m: Some(1.65),
                        depth_ratio: None,
                        state: ScaleState::Drift,
                    },
                    correction: Some(0.9),
                }),
            },
            files: vec!["5_depth.png".into()],
            file_bytes: vec![99],
            file_crc32: vec!["0badcafe".into()],
            live: None,
            made_with: MadeWith {
                version: "0.1.0".into(),
                weights: "cd".into(),
                engine: "fused on cpu".into(),
                save: vec!["depth-png".into()],
                max_depth_m: 80.0,
                max_sigma: None,
                intrinsics: None,
                hfov_deg: None,
                calibration_sha256: None,
                focal_correction: true,
                stretch: false,
                correct_scale: false,
                post_process: None,
                set: None,
                topics: Vec::new(),
                camera_height_m: None,
            },
        }
    }

    #[test]
    fn the_json_of_a_sidecar_is_fixed_and_can_be_read_back() {
        let text = serde_json::to_string(&sidecar()).unwrap();
        assert_eq!(
            text,
            concat!(
                r#"{"image":"street/5.png","image_file":{"bytes":1234,"modified_ns":1767225600123456789},"size":[1242,375],"#,
                r#""unit":"metres","model":"street","model_sha256":"ab","checkpoint_step":500,"#,
                r#""intrinsics":[721.5,721.5,609.6,172.9],"intrinsics_from":"given","camera_known":true,"#,
                r#""scale":{"bias":null,"ci95":null,"verdict":"open"},"focal_factor":1.0,"window":[0,1,1242,373],"#,
                r#""depth_m":[5.9,80.0],"scale_monitor":{"ratio":1.1,"ci95":null,"height_m":1.65,"depth_ratio":null,"#,
                r#""state":"drift","correction":0.9},"files":["5_depth.png"],"file_bytes":[99],"file_crc32":["0badcafe"],"#,
                r#""made_with":{"version":"0.1.0","weights":"cd","engine":"fused on cpu","save":["depth-png"],"#,
                r#""max_depth_m":80.0,"intrinsics":null,"focal_correction":true,"stretch":false}}"#,
            )
        );
        assert_eq!(serde_json::from_str::<Sidecar>(&text).unwrap(), sidecar());
    }

    #[test]
    fn another_precision_is_another_engine_even_if_its_weights_differ_too() {
        let f32 = sidecar().made_with;
        let mut int8 = f32.clone();
        int8.weights = "ef".into();
        assert_eq!(int8.difference(&f32), Some(Difference::Weights));
        int8.engine = "fused int8 on cpu".into();
        assert_eq!(int8.difference(&f32), Some(Difference::Engine));
    }

    #[test]
    fn an_incomplete_record_can_be_read_but_is_not_a_sidecar() {
        let text = r#"{"image": "x.png", "size": [4, 2], "scale_trusted": true}"#;
        let shown: PredictionRecord = serde_json::from_str(text).unwrap();
        assert_eq!((shown.size, shown.intrinsics), (Some([4, 2]), None));
        assert!(serde_json::from_str::<Sidecar>(text).is_err());
    }
}
