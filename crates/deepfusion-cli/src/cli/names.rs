//! The libraries' enums on the command line: each value has its name and a line of help.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use deepfusion_data::GtKind;
use deepfusion_eval::{Crop, PostProcess};
use deepfusion_infer::Precision;
use deepfusion_jobs::engine::Engine;
use deepfusion_jobs::outputs::{DepthOutput, TargetOutput};
use deepfusion_model::{CheckpointKind, Learn, Preset, ViewMotion};
use deepfusion_rosbag::Compression;
use deepfusion_sim::{Scene, Sensors};

/// A parser of these values by name. The help lists each with its meaning; an error names them all.
fn one_of<T: Copy + Send + Sync + 'static>(
    name: fn(T) -> &'static str,
    values: &'static [(T, &'static str)],
) -> impl TypedValueParser<Value = T> {
    let listed = values
        .iter()
        .map(move |(value, meaning)| PossibleValue::new(name(*value)).help(*meaning));
    PossibleValuesParser::new(listed).try_map(move |given| {
        let found = values.iter().find(|(value, _)| name(*value) == given);
        found.map(|(value, _)| *value).ok_or("it is not listed")
    })
}

/// Settings to start from.
pub(super) fn preset() -> impl TypedValueParser<Value = Preset> {
    one_of(
        Preset::name,
        &[
            (
                Preset::Tiny,
                "ResNet-18 at half width, 320×96: learns something useful on two cores in minutes",
            ),
            (
                Preset::Light,
                "ResNet-18, 640×192; 320×96 if trained on a processor",
            ),
            (
                Preset::Resnet50,
                "ResNet-50, 640×192, batch 12; 320×96, batch 4 if trained on a processor",
            ),
            (
                Preset::Paper,
                "The paper's network: ResNet-50 with context encoding and attention; sizes as for resnet50",
            ),
            (
                Preset::Monodepth2,
                "Monodepth2's network and losses, with the speed term",
            ),
            (
                Preset::Monodepth2R50,
                "The same with ResNet-50 in both networks",
            ),
            (
                Preset::LiteMono,
                "Lite-Mono (3.1 M parameters) with Monodepth2's losses and the speed term",
            ),
            (Preset::LiteMonoSmall, "Lite-Mono-small (2.5 M)"),
            (Preset::LiteMonoTiny, "Lite-Mono-tiny (2.2 M)"),
            (Preset::LiteMono8m, "Lite-Mono-8M (8.7 M)"),
            (
                Preset::RMsfm3,
                "R-MSFM3 (3.5 M parameters): a disparity refined three times",
            ),
            (Preset::RMsfm6, "R-MSFM6 (3.8 M): refined six times"),
            (
                Preset::Sfmlearner,
                "SfMLearner's DispNet (31.6 M parameters), 416×128, batch 4",
            ),
        ],
    )
}

/// What training uses of a recording.
pub(super) fn learn() -> impl TypedValueParser<Value = Learn> {
    one_of(
        Learn::name,
        &[
            (
                Learn::OwnMotion,
                "Its own motion: one frame synthesised from another; needs a speed",
            ),
            (
                Learn::Depth,
                "Its depth: RGB-D images or LiDAR scans; needs no speed",
            ),
            (Learn::Both, "Both"),
        ],
    )
}

/// The pose used for warping.
pub(super) fn view_motion() -> impl TypedValueParser<Value = ViewMotion> {
    one_of(
        ViewMotion::name,
        &[
            (
                ViewMotion::PoseNet,
                "PoseNet's; the speed loss pulls its length towards the vehicle's",
            ),
            (
                ViewMotion::Distance,
                "PoseNet's direction and rotation, with the vehicle's distance",
            ),
            (
                ViewMotion::Vehicle,
                "The vehicle's, from its speed and its turns: as measured, else as the images show them",
            ),
            (
                ViewMotion::Auto,
                "`vehicle` for drives whose turns are known, `distance` for the others",
            ),
        ],
    )
}

/// A checkpoint of a run.
pub(super) fn checkpoint() -> impl TypedValueParser<Value = CheckpointKind> {
    one_of(
        CheckpointKind::name,
        &[
            (
                CheckpointKind::Best,
                "The one with the lowest held-out loss",
            ),
            (CheckpointKind::Last, "The one at the end of training"),
        ],
    )
}

/// What runs a network.
pub(super) fn engine() -> impl TypedValueParser<Value = Engine> {
    one_of(
        Engine::name,
        &[
            (
                Engine::Auto,
                "`fused` on the processor, `burn` on any other device",
            ),
            (
                Engine::Burn,
                "Burn, the framework that also trains the network",
            ),
            (Engine::Fused, "This program's own engine for processors"),
            (Engine::Ort, "ONNX Runtime, from a library that you provide"),
        ],
    )
}

/// The precision in which a network computes.
pub(super) fn precision() -> impl TypedValueParser<Value = Precision> {
    one_of(
        Precision::name,
        &[
            (Precision::F32, "32-bit floats"),
            (
                Precision::Bf16,
                "Eight bits of mantissa: faster, slightly less exact; needs a processor with AMX or AVX512-BF16",
            ),
            (
                Precision::Int8,
                "8-bit integers: even faster, less exact; needs a processor with AVX512-VNNI and AVX512-BF16, and a network calibrated by `weights calibrate`",
            ),
        ],
    )
}

/// Conventions of ground-truth depth.
pub(super) fn gt_kind() -> impl TypedValueParser<Value = GtKind> {
    one_of(
        GtKind::name,
        &[
            (
                GtKind::Z,
                "Camera z of one scan at pixel round(u), round(v)",
            ),
            (
                GtKind::Velodyne,
                "The velodyne's forward distance at pixel round(u) - 1, round(v) - 1, as in the field's eigen files",
            ),
            (
                GtKind::Annotated,
                "KITTI's annotated depth, from proj_depth/groundtruth beside a drive's images, as in the field's eigen_benchmark",
            ),
        ],
    )
}

/// Test-time augmentations: the predictions of an image whose mean is its depth.
pub(super) fn post_process() -> impl TypedValueParser<Value = PostProcess> {
    one_of(
        PostProcess::name,
        &[
            (
                PostProcess::Flip,
                "Mean with the prediction of the mirrored image (near the left edge only the mirrored image's, near the right edge only the image's own); twice the time",
            ),
            (
                PostProcess::MultiScale,
                "Mean of the predictions for a smaller input (0.8 times as wide and high) and a larger one (1.2 times); two to two and a half times the time",
            ),
            (
                PostProcess::MultiScaleFlip,
                "The same, each also with the mirrored image; four to five times the time",
            ),
        ],
    )
}

/// Part of the image to compare.
pub(super) fn crop() -> impl TypedValueParser<Value = Crop> {
    one_of(
        Crop::name,
        &[
            (Crop::None, "The whole image"),
            (
                Crop::Garg,
                "Garg et al.'s crop, the field's default for KITTI",
            ),
        ],
    )
}

/// How a bag's chunks are compressed.
pub(super) fn compression() -> impl TypedValueParser<Value = Compression> {
    one_of(
        Compression::name,
        &[
            (Compression::None, "No compression"),
            (Compression::Lz4, "Fast"),
            (Compression::Bz2, "Small and slow"),
        ],
    )
}

/// Sensors of the simulated car.
pub(super) fn sensors() -> impl TypedValueParser<Value = Sensors> {
    one_of(
        Sensors::name,
        &[
            (Sensors::Kitti, "KITTI's: camera and velodyne on the roof"),
            (
                Sensors::Umad,
                "UMAD's: camera, FMCW LiDAR and IMU in one head",
            ),
        ],
    )
}

/// Scenes of a simulated drive.
pub(super) fn scene() -> impl TypedValueParser<Value = Scene> {
    one_of(
        Scene::name,
        &[
            (Scene::Urban, "A street with houses, parked cars and trees"),
            (Scene::Park, "A narrow road between lawns and trees"),
            (
                Scene::Garage,
                "Underground: dark, with near walls, pillars and a low ceiling",
            ),
            (
                Scene::Commercial,
                "Large buildings, wide pavements, many parked cars",
            ),
            (
                Scene::Night,
                "The urban street at night, under street lamps",
            ),
            (
                Scene::Motorway,
                "Several lanes, guard rails, embankments; only with --varied",
            ),
            (
                Scene::Country,
                "A road between fields, trees and banks; only with --varied",
            ),
        ],
    )
}

/// What `predict` writes for an image, beside the JSON sidecar.
pub(super) fn depth_output() -> impl TypedValueParser<Value = DepthOutput> {
    one_of(
        DepthOutput::name,
        &[
            (DepthOutput::DepthPng, "16-bit PNG, metres × 256"),
            (DepthOutput::Npy, "H×W f32 metres, for NumPy"),
            (
                DepthOutput::Sigma,
                "Standard deviation of depth in metres: H×W f32, for NumPy; needs a network that predicts uncertainty",
            ),
            (
                DepthOutput::Confidence,
                "How far each pixel can be trusted: H×W f32 from 0 to 1 (0.9: an error of 10 % is expected), for NumPy; needs a network that predicts uncertainty",
            ),
            (
                DepthOutput::Color,
                "Depth in colours with a legend in metres",
            ),
            (
                DepthOutput::Image,
                "The image as JPEG, so that `view` can show frames of videos and bags",
            ),
            (
                DepthOutput::SideBySide,
                "The image and its depth in colours",
            ),
            (
                DepthOutput::Ply,
                "Coloured point cloud in the camera's axes, as PLY",
            ),
            (
                DepthOutput::Pcd,
                "The same as PCD, for the Point Cloud Library and ROS",
            ),
            (
                DepthOutput::Features,
                "What the network sees: its features and attention masks, drawn on the image",
            ),
            (
                DepthOutput::Video,
                "An MP4 of each recording (through ffmpeg), from the pictures of `side-by-side`, which are also kept",
            ),
        ],
    )
}

/// What `perceive` writes for a frame, beside its targets.
pub(super) fn target_output() -> impl TypedValueParser<Value = TargetOutput> {
    one_of(
        TargetOutput::name,
        &[
            (
                TargetOutput::DepthPng,
                "Depth as 16-bit PNG, metres × 256, which `view` shows",
            ),
            (
                TargetOutput::Sigma,
                "Standard deviation of depth, as from `predict --save sigma`; `view` can then fade uncertain pixels",
            ),
            (TargetOutput::Overlay, "The image with boxes"),
            (
                TargetOutput::BirdsEye,
                "The road from above: free space, boxes, velocities",
            ),
            (
                TargetOutput::Segments,
                "Disparity with each target in its colour",
            ),
            (
                TargetOutput::Ply,
                "Coloured point cloud in the camera's axes, as PLY, without the points that float between near and far",
            ),
            (
                TargetOutput::Pcd,
                "The same as PCD, for the Point Cloud Library and ROS",
            ),
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names that a parser lists.
    fn names(parser: &impl TypedValueParser) -> Vec<String> {
        let values = parser.possible_values().into_iter().flatten();
        values.map(|value| value.get_name().to_owned()).collect()
    }

    /// Values that are added to the library are also offered here: presets, outputs, and all scenes except rooms, through which no drive
    /// leads.
    #[test]
    fn every_value_of_the_library_is_offered() {
        assert_eq!(names(&preset()), Preset::ALL.map(Preset::name));
        let roads = Scene::EVERY.into_iter().filter(|s| *s != Scene::Indoor);
        let roads: Vec<&str> = roads.map(Scene::name).collect();
        assert_eq!(names(&scene()), roads);
        let outputs = DepthOutput::ALL.map(DepthOutput::name);
        assert_eq!(names(&depth_output()), outputs);
        let outputs = TargetOutput::ALL.map(TargetOutput::name);
        assert_eq!(names(&target_output()), outputs);
    }

    /// The names are those of the files, so that what is printed can be typed.
    #[test]
    fn names_are_those_of_configurations() {
        for name in names(&preset()) {
            let value = toml::Value::String(name.clone());
            assert_eq!(value.try_into::<Preset>().unwrap().name(), name);
        }
        for name in names(&learn()) {
            let value = toml::Value::String(name.clone());
            assert_eq!(value.try_into::<Learn>().unwrap().name(), name);
        }
        for name in names(&view_motion()) {
            let value = toml::Value::String(name.clone());
            assert_eq!(value.try_into::<ViewMotion>().unwrap().name(), name);
        }
    }
}
