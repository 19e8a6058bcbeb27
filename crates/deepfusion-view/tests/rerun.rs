//! Files for the rerun viewer, read back with its SDK's own reader.

#![cfg(feature = "rerun")]

use std::cell::Cell;
use std::collections::BTreeMap;
use std::io::BufReader;
use std::path::Path;

use crate::support::{CAMERA, SIZE, results, steps, write_sidecar};
use deepfusion_view::{Error, Folder, RerunReport, write_rerun};
use re_chunk::{Chunk, TimeInt};
use re_log_encoding::DecoderApp;
use re_log_types::{LogMsg, TimelineName};
use re_sdk_types::components::{
    Blob, Color, DepthMeter, HalfSize3D, ImageBuffer, ImageFormat, LineStrip3D, MediaType,
    PinholeProjection, Resolution, RotationQuat, Scalar, Text, TransformMat3x3, Translation3D,
    Vector3D,
};
use re_sdk_types::datatypes::{ChannelDatatype, Quaternion};
use re_sdk_types::{Component, archetypes as a};
use serde_json::json;

/// A file's content: the rows of each entity, in the order they were written.
struct Read {
    rows: BTreeMap<String, Vec<Chunk>>,
    application: String,
}

impl Read {
    fn of(path: &Path) -> Self {
        let file = BufReader::new(std::fs::File::open(path).unwrap());
        let (mut rows, mut application) = (BTreeMap::<String, Vec<Chunk>>::new(), String::new());
        for message in DecoderApp::decode_eager(file).unwrap() {
            match message.unwrap() {
                LogMsg::SetStoreInfo(set) => {
                    application = set.info.store_id.application_id().to_string();
                }
                LogMsg::ArrowMsg(_, message) => {
                    let chunk = Chunk::from_arrow_msg(&message).unwrap();
                    let entity = chunk.entity_path().to_string();
                    rows.entry(entity).or_default().push(chunk);
                }
                LogMsg::BlueprintActivationCommand(_) => panic!("no blueprint was written"),
            }
        }
        Self { rows, application }
    }

    fn entities(&self) -> Vec<(&str, usize)> {
        self.rows
            .iter()
            .map(|(e, c)| (e.as_str(), c.len()))
            .collect()
    }

    /// The row of an entity at a frame.
    fn at(&self, entity: &str, frame: i64) -> Option<&Chunk> {
        self.rows
            .get(entity)?
            .iter()
            .find(|c| time(c, "frame") == Some(frame))
    }

    /// A component of an entity at a frame.
    fn get<C: Component>(
        &self,
        entity: &str,
        frame: i64,
        descriptor: re_sdk_types::ComponentDescriptor,
    ) -> Vec<C> {
        let chunk = self
            .at(entity, frame)
            .unwrap_or_else(|| panic!("no {entity} at {frame}"));
        chunk
            .component_batch::<C>(descriptor.component, 0)
            .unwrap_or_else(|| panic!("no {descriptor} of {entity}"))
            .unwrap()
    }
}

/// A row's time.
fn time(chunk: &Chunk, timeline: &'static str) -> Option<i64> {
    let column = chunk.timelines().get(&TimelineName::from(timeline))?;
    column.times().next().map(TimeInt::as_i64)
}

fn write(folder: &Path, to: &Path) -> RerunReport {
    write_rerun(&Folder::open(folder).unwrap(), to, |_, _| {}, || false).unwrap()
}

#[test]
fn a_written_file_can_be_read_back() {
    let folder = results(3);
    let file = folder.path().join("out.rrd");
    let reported = Cell::new(Vec::new());
    let progress = |done, total| {
        let mut so_far = reported.take();
        so_far.push((done, total));
        reported.set(so_far);
    };
    let report = write_rerun(
        &Folder::open(folder.path()).unwrap(),
        &file,
        progress,
        || false,
    );
    assert_eq!(
        (report.as_ref().unwrap().frames, &*report.unwrap().problems),
        (3, &[][..])
    );
    assert_eq!(reported.take(), [(1, 3), (2, 3), (3, 3)]);

    let read = Read::of(&file);
    assert_eq!(read.application, "deepfusion");
    assert_eq!(
        read.entities(),
        [
            ("/__properties", 1),
            ("/frames", 3),
            ("/latency_ms", 3),
            ("/nearest_m", 3),
            ("/speed_mps", 3),
            ("/world", 1),
            ("/world/camera", 3),
            ("/world/camera/ground", 3),
            ("/world/camera/image", 3),
            ("/world/camera/image/depth", 3),
            ("/world/camera/image/rgb", 3),
            ("/world/camera/targets", 3),
            ("/world/camera/velocities", 3),
            // A path needs two positions.
            ("/world/tracks", 2),
        ]
    );
    let row = read.at("/world/camera", 2).unwrap();
    assert_eq!(time(row, "time"), Some(200_000_000), "nanoseconds");
    let place = a::Transform3D::descriptor_translation();
    assert_eq!(
        read.get::<Translation3D>("/world/camera", 2, place),
        [Translation3D::from([0.0_f32, 0.0, 0.4])]
    );

    let [fx, fy, cx, cy] = CAMERA.map(|x| x as f32);
    let image = "/world/camera/image";
    let projection =
        read.get::<PinholeProjection>(image, 1, a::Pinhole::descriptor_image_from_camera());
    let expected = PinholeProjection::from_focal_length_and_principal_point([fx, fy], [cx, cy]);
    assert_eq!(projection, [expected]);
    let resolution = read.get::<Resolution>(image, 1, a::Pinhole::descriptor_resolution());
    assert_eq!(
        resolution,
        [Resolution::from([SIZE.0 as f32, SIZE.1 as f32])]
    );

    let rgb = "/world/camera/image/rgb";
    let bytes = read.get::<Blob>(rgb, 1, a::EncodedImage::descriptor_blob());
    assert_eq!(
        &bytes[0].0.0[..],
        std::fs::read(folder.path().join("000001_image.png")).unwrap()
    );
    let kind = read.get::<MediaType>(rgb, 1, a::EncodedImage::descriptor_media_type());
    assert_eq!(kind[0].as_str(), "image/png");

    let name = read.get::<Text>("/frames", 1, a::TextLog::descriptor_text());
    assert_eq!(name[0].as_str(), "000001");
    let speed = read.get::<Scalar>("/speed_mps", 1, a::Scalars::descriptor_scalars());
    assert_eq!(speed, [Scalar::from(2.0)]);
}

#[test]
fn depth_is_in_the_numbers_of_its_file() {
    let folder = results(2);
    let metres: Vec<f32> = (0..SIZE.0 * SIZE.1)
        .map(|i| 2.0 + 0.013 * i as f32)
        .collect();
    let array = ndarray::Array2::from_shape_vec((SIZE.1 as usize, SIZE.0 as usize), metres.clone());
    ndarray_npy::write_npy(folder.path().join("000001_depth.npy"), &array.unwrap()).unwrap();
    let file = folder.path().join("out.rrd");
    write(folder.path(), &file);
    let (read, depth) = (Read::of(&file), "/world/camera/image/depth");
    for (frame, datatype, metre) in [
        (0, ChannelDatatype::U16, 256.0),
        (1, ChannelDatatype::F32, 1.0),
    ] {
        let format = read.get::<ImageFormat>(depth, frame, a::DepthImage::descriptor_format());
        assert_eq!((format[0].width, format[0].height), SIZE);
        assert_eq!(format[0].datatype(), datatype);
        let meter = read.get::<DepthMeter>(depth, frame, a::DepthImage::descriptor_meter());
        assert_eq!(meter, [DepthMeter::from(metre)]);
    }
    let buffer = |frame| read.get::<ImageBuffer>(depth, frame, a::DepthImage::descriptor_buffer());
    let at = |bytes: &[u8], x: u32, y: u32| {
        let i = 2 * (y * SIZE.0 + x) as usize;
        u16::from_le_bytes([bytes[i], bytes[i + 1]])
    };
    let png = buffer(0);
    assert_eq!(at(&png[0].0.0, 70, 31), steps(0, 70, 31));
    assert_eq!(at(&png[0].0.0, 1, 1), 0, "the hole");
    let expected: Vec<u8> = metres.iter().flat_map(|m| m.to_le_bytes()).collect();
    assert_eq!(&buffer(1)[0].0.0[..], expected);
}

#[test]
fn targets_are_where_the_page_draws_them() {
    let folder = results(3);
    let file = folder.path().join("out.rrd");
    write(folder.path(), &file);
    let (read, entity) = (Read::of(&file), "/world/camera/targets");
    // Length along x, height along y, width along z.
    let half = read.get::<HalfSize3D>(entity, 2, a::Boxes3D::descriptor_half_sizes());
    assert_eq!(half, [HalfSize3D::from([2.0_f32, 0.75, 0.9])]);
    let centre = read.get::<Translation3D>(entity, 2, a::Boxes3D::descriptor_centers());
    assert_eq!(centre, [Translation3D::from([1.0_f32, 0.5, 13.0])]);
    let turn = read.get::<RotationQuat>(entity, 2, a::Boxes3D::descriptor_quaternions());
    let Quaternion([x, y, z, w]) = turn[0].0;
    // KITTI's rotation_y: the length points along (cos, 0, -sin). The x axis rotated by a unit quaternion:
    let ahead = [
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y + w * z),
        2.0 * (x * z - w * y),
    ];
    for (got, expected) in ahead.iter().zip([0.6_f32.cos(), 0.0, -(0.6_f32.sin())]) {
        assert!((got - expected).abs() < 1e-6, "{ahead:?}");
    }
    let label = read.get::<Text>(entity, 2, a::Boxes3D::descriptor_labels());
    assert_eq!(label[0].as_str(), "7 14.0 m 5.0 m/s");
    let colour = read.get::<Color>(entity, 2, a::Boxes3D::descriptor_colors());
    let [r, g, b] = deepfusion_render::colour_of(7).0;
    assert_eq!(colour, [Color::from_rgb(r, g, b)]);
    let arrow = read.get::<Vector3D>(
        "/world/camera/velocities",
        2,
        a::Arrows3D::descriptor_vectors(),
    );
    assert_eq!(arrow, [Vector3D::from([0.0_f32, 0.0, -5.0])]);

    let strips = a::LineStrips3D::descriptor_strips();
    let way = read.get::<LineStrip3D>("/world/tracks", 2, strips.clone());
    let in_world = |i: usize| [1.0, 0.5, 14.0 - 0.5 * i as f32 + 0.2 * i as f32];
    let points: Vec<[f32; 3]> = way[0].0.iter().map(|p| p.0).collect();
    assert_eq!(points.len(), 3);
    for (i, point) in points.iter().enumerate() {
        let off = point.iter().zip(in_world(i)).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f32::max) < 1e-5, "{points:?}");
    }
    let ground = read.get::<LineStrip3D>("/world/camera/ground", 2, strips);
    assert!(
        ground
            .iter()
            .flat_map(|strip| &strip.0)
            .all(|p| p.y() == 1.5)
    );
}

#[test]
fn a_turned_camera_has_its_columns() {
    let folder = results(1);
    let path = folder.path().join("000000_targets.json");
    // Row by row; the camera looks along the world's x.
    let targets = json!({"targets": [], "camera_motion": [0, 0, 1, 7, 0, 1, 0, 8, -1, 0, 0, 9]});
    std::fs::write(path, targets.to_string()).unwrap();
    let file = folder.path().join("out.rrd");
    write(folder.path(), &file);
    let matrix = a::Transform3D::descriptor_mat3x3();
    let matrix = Read::of(&file).get::<TransformMat3x3>("/world/camera", 0, matrix);
    // Column by column.
    assert_eq!(
        matrix[0].0.0,
        [0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0]
    );
}

#[test]
fn bad_frames_are_named_and_show_nothing_of_the_previous_frame() {
    let folder = results(3);
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("000001_depth.png"), "cut off").unwrap();
    std::fs::remove_file(at("000001_image.png")).unwrap();
    std::fs::remove_file(at("000001_targets.json")).unwrap();
    write_sidecar(folder.path(), "000002", &json!({"size": [200, 100]}));
    let file = at("out.rrd");
    let report = write(folder.path(), &file);
    assert_eq!(report.frames, 3);
    let of = |name: &str| -> Vec<String> {
        let named = report.problems.iter().filter(|(frame, _)| frame == name);
        named.map(|(_, problem)| problem.to_string()).collect()
    };
    assert_eq!(of("000000"), [""; 0]);
    let bad = of("000001");
    let [picture, depth] = &bad[..] else {
        panic!("{:?}", report.problems)
    };
    assert!(
        picture.contains("the picture no longer exists"),
        "{picture}"
    );
    assert!(depth.contains("000001_depth.png"), "{depth}");
    assert_eq!(
        of("000002"),
        [
            "the picture is 96x48, the sidecar says 200x100",
            "depth is 96x48, the sidecar says 200x100"
        ]
    );
    let read = Read::of(&file);
    let cleared = a::Clear::descriptor_is_recursive();
    for entity in [
        "/world/camera/image/rgb",
        "/world/camera/image/depth",
        "/world/camera/targets",
        "/speed_mps",
    ] {
        let chunk = read.at(entity, 1).unwrap();
        assert!(
            chunk.components().contains_component(cleared.component),
            "{entity}"
        );
    }
    assert!(
        read.at("/world/camera/image/rgb", 2).is_none(),
        "already cleared"
    );
    assert!(read.at("/world/camera/targets", 2).is_some());
    // Without targets the camera's motion is unknown: its pose is the identity, not the previous one.
    let place = a::Transform3D::descriptor_translation();
    let place = read.get::<Translation3D>("/world/camera", 1, place);
    assert_eq!(place, [Translation3D::from([0.0_f32; 3])]);
    let lines = read.rows["/frames"].len();
    assert_eq!(lines, 1 + 2 + 2, "a name, and a line for each problem");
}

#[test]
fn stopping_leaves_nothing_behind() {
    let folder = results(3);
    let out = tempfile::tempdir().unwrap();
    let file = out.path().join("out.rrd");
    let done = Cell::new(0);
    let outcome = write_rerun(
        &Folder::open(folder.path()).unwrap(),
        &file,
        |frames, _| done.set(frames),
        || done.get() == 2,
    );
    assert!(
        matches!(
            outcome,
            Err(Error::Stopped {
                done: 2,
                total: 3,
                ..
            })
        ),
        "{outcome:?}"
    );
    assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 0);
    // Nor does writing to a folder that does not exist.
    let nowhere = out.path().join("nowhere/out.rrd");
    let outcome = write_rerun(
        &Folder::open(folder.path()).unwrap(),
        &nowhere,
        |_, _| {},
        || false,
    );
    assert!(outcome.unwrap_err().to_string().contains("nowhere"));
}

#[test]
fn a_training_run_has_no_frames() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("log.csv"), "step,loss\n1,0.5\n").unwrap();
    let run = Folder::open(folder.path()).unwrap();
    let outcome = write_rerun(&run, &folder.path().join("a.rrd"), |_, _| {}, || false);
    assert!(matches!(outcome, Err(Error::NoFrames { .. })));
}
