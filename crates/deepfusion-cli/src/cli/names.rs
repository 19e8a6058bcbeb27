//! The libraries' own enums on the command line: each value by its name, with a line for the help.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use deepfusion_data::GtKind;
use deepfusion_eval::{Crop, PostProcess};
use deepfusion_infer::Precision;
use deepfusion_jobs::engine::Engine;
use deepfusion_jobs::outputs::{DepthOutput, TargetOutput};
use deepfusion_model::{CheckpointKind, Learn, Preset, ViewMotion};
use deepfusion_rosbag::Compression;
use deepfusion_sim::{Scene, Sensors};

/// A parser of these values by their names. Help lists each with its meaning, an error names them all.
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
                "ResNet-18 at half width, 320×96: useful on two cores in minutes",
            ),
            (
                Preset::Light,
                "ResNet-18, 640×192; trained on a processor 320×96",
            ),
            (
                Preset::Resnet50,
                "ResNet-50, 640×192, batch 12; trained on a processor 320×96, batch 4",
            ),
            (
                Preset::Paper,
                "The paper's network: ResNet-50 with context and attention; sizes as resnet50",
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
                "Lite-Mono (3.1 M parameters), Monodepth2's losses with the speed term",
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

/// What a recording is learned from.
pub(super) fn learn() -> impl TypedValueParser<Value = Learn> {
    one_of(
        Learn::name,
        &[
            (
                Learn::OwnMotion,
                "Its own motion: views of one frame from another; needs a speed",
            ),
            (
                Learn::Depth,
                "Its depth: RGB-D images or a LiDAR's scans; needs no speed",
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
                "PoseNet's; the speed loss pulls its length to the vehicle's",
            ),
            (
                ViewMotion::Distance,
                "PoseNet's direction and rotation, the vehicle's distance",
            ),
            (
                ViewMotion::Vehicle,
                "The vehicle's, from its speed and its turns: measured ones, else those that the images show",
            ),
            (
                ViewMotion::Auto,
                "vehicle for drives whose turns are known, distance for the others",
            ),
        ],
    )
}

/// A checkpoint of a run.
pub(super) fn checkpoint() -> impl TypedValueParser<Value = CheckpointKind> {
    one_of(
        CheckpointKind::name,
        &[
            (CheckpointKind::Best, "At the lowest held-out loss"),
            (CheckpointKind::Last, "Where training ended"),
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
            (Engine::Burn, "The network as it is trained"),
            (Engine::Fused, "This program's own engine for processors"),
            (Engine::Ort, "ONNX Runtime, a library of your own"),
        ],
    )
}

/// In which numbers a network computes.
pub(super) fn precision() -> impl TypedValueParser<Value = Precision> {
    one_of(
        Precision::name,
        &[
            (Precision::F32, "32-bit floats"),
            (
                Precision::Bf16,
                "Eight bits of mantissa: faster on processors with AMX or AVX512-BF16, a little less exact",
            ),
            (
                Precision::Int8,
                "8-bit integers: faster still on processors with AVX512-VNNI, less exact; for networks that `weights calibrate` saw",
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
                "The velodyne's forward distance at pixel round(u) - 1, round(v) - 1: the field's eigen files",
            ),
            (
                GtKind::Annotated,
                "KITTI's annotated depth, from proj_depth/groundtruth beside a drive's images: the field's eigen_benchmark",
            ),
        ],
    )
}

/// Of which predictions of an image its depth is the mean.
pub(super) fn post_process() -> impl TypedValueParser<Value = PostProcess> {
    one_of(
        PostProcess::name,
        &[
            (
                PostProcess::Flip,
                "The mean with the mirrored image's prediction (near the left edge the mirrored image's alone, near the right edge the image's own); twice the time",
            ),
            (
                PostProcess::MultiScale,
                "The mean of a smaller input's prediction (0.8 times as wide and high) and a larger one's (1.2); two to two and a half times the time",
            ),
            (
                PostProcess::MultiScaleFlip,
                "The same, each with the mirrored image's; four to five times the time",
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
                "Garg et al.'s window, the field's default for KITTI",
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

/// What the simulated car carries.
pub(super) fn sensors() -> impl TypedValueParser<Value = Sensors> {
    one_of(
        Sensors::name,
        &[
            (Sensors::Kitti, "KITTI's, camera and velodyne on the roof"),
            (
                Sensors::Umad,
                "UMAD's, camera, FMCW LiDAR and inertial unit in one head",
            ),
        ],
    )
}

/// Places that a simulated drive leads through.
pub(super) fn scene() -> impl TypedValueParser<Value = Scene> {
    one_of(
        Scene::name,
        &[
            (Scene::Urban, "A street with houses, parked cars, trees"),
            (Scene::Park, "A narrow road between lawns and trees"),
            (
                Scene::Garage,
                "Underground: dark, near walls, pillars, a low ceiling",
            ),
            (
                Scene::Commercial,
                "Large houses, wide pavements, many parked cars",
            ),
            (Scene::Night, "The urban street by night, under its lamps"),
            (
                Scene::Motorway,
                "Several lanes, guard rails, embankments; with --varied alone",
            ),
            (
                Scene::Country,
                "A road between fields, trees and banks; with --varied alone",
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
                "How sure the network is: H×W f32, the standard deviation of depth in metres, for NumPy; of networks that learned it",
            ),
            (
                DepthOutput::Confidence,
                "How far each pixel can be trusted: H×W f32 from 0 to 1, for NumPy; 0.9 where an error of 10 % is to be expected. Of networks that say how sure they are",
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
                "What the network sees: its features and attention masks on the image",
            ),
            (
                DepthOutput::Video,
                "The pictures of `side-by-side`, which are kept, too, as an MP4 of each recording (through ffmpeg)",
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
                "Depth as 16-bit PNG, metres × 256: what `view` shows",
            ),
            (
                TargetOutput::Sigma,
                "How sure the network is, as `predict --save sigma` writes it: `view` can then fade what is unsure",
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
                "Coloured point cloud in the camera's axes, without the points that hang between near and far, as PLY",
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

    /// What is added to the library is offered here, too: presets, outputs, scenes. Of those no drive leads through rooms.
    #[test]
    fn whatever_the_library_lists_is_offered() {
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
