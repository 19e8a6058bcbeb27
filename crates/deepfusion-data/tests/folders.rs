//! Folders of images with tables beside them.

use crate::common::folder::{picture, write_drive, write_images};
use crate::common::{self, TinyDrive, text_of};
use deepfusion_data::{
    Cameras, Dataset, DatasetKind, Error, GtKind, OpenOptions, Snippet, VehicleMotion, inspect,
};
use deepfusion_geometry::Se3;
use deepfusion_hint::Hint;
use image::{ImageBuffer, Luma};
use nalgebra::Vector3;
use std::fs;
use std::path::Path;

fn open(path: &Path) -> Dataset {
    match Dataset::open(path, &OpenOptions::default()) {
        Ok(mut datasets) => {
            assert_eq!(datasets.len(), 1);
            datasets.remove(0)
        }
        Err(error) => panic!("{error}\nhint: {:?}", error.hint()),
    }
}

fn refusal(path: &Path) -> String {
    let error = Dataset::open(path, &OpenOptions::default()).unwrap_err();
    let hint = error.hint().expect("every refusal has a hint");
    format!("{error}\nhint: {hint}")
}

/// `cam_from_vehicle` as a mount for `dataset.toml`.
fn mount(of: &Dataset) -> String {
    let vehicle_from_cam = of.cam_from_vehicle().unwrap().inverse();
    let place = vehicle_from_cam.translation();
    // The camera's forward and down axes in the vehicle's axes.
    let (ahead, down) = (
        vehicle_from_cam.rotate(&Vector3::z()),
        vehicle_from_cam.rotate(&Vector3::y()),
    );
    let right = vehicle_from_cam.rotate(&Vector3::x());
    format!(
        "[mount]\nforward_m = {:?}\nleft_m = {:?}\nup_m = {:?}\nyaw_deg = {:?}\npitch_deg = {:?}\nroll_deg = {:?}\n",
        place.x,
        place.y,
        place.z,
        ahead.y.atan2(ahead.x).to_degrees(),
        (-ahead.z).asin().to_degrees(),
        (-right.z).atan2(-down.z).to_degrees(),
    )
}

/// A drive in KITTI's layout and the same drive as a folder with tables are equivalent for training. Images are
/// identical, motions agree up to the nanoseconds of the time stamps and the ten digits of the tables (1e-9 of a few
/// metres, and of angles below 1).
#[test]
fn a_kitti_drive_and_a_folder_of_it_give_the_same_snippets() {
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive {
        speed_mps: 8.0,
        yaw_rate_radps: 0.4,
        ..TinyDrive::default()
    };
    let kitti = open(&drive.write(&root.path().join("kitti")));
    let own = root.path().join("own");
    write_drive(&own, 8, 8.0, 0.4);
    fs::write(own.join("dataset.toml"), mount(&kitti)).unwrap();
    let own = open(&own);
    assert_eq!(own.kind(), DatasetKind::Folder);
    assert_eq!(own.intrinsics(0), kitti.intrinsics(0));
    for offsets in [&[1][..], &[-1, 1]] {
        let (a, b) = (
            kitti.snippets(offsets, 0.5).unwrap(),
            own.snippets(offsets, 0.5).unwrap(),
        );
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(&b) {
            same(&kitti, a, b);
            assert_eq!(
                kitti.load_image(a.target).unwrap(),
                own.load_image(b.target).unwrap()
            );
        }
    }
}

/// Image dates without a time zone only matter with a log, and if the first image's time is not given.
#[test]
fn a_missing_time_zone_gives_a_warning_only_if_it_matters() {
    let root = tempfile::tempdir().unwrap();
    write_drive(root.path(), 3, 8.0, 0.4);
    let at = |name: &str| root.path().join(name);
    fs::remove_file(at("frames.csv")).unwrap();
    let times = "2011-09-26 13:04:32.3\n2011-09-26 13:04:32.4\n2011-09-26 13:04:32.5\n";
    fs::write(at("timestamps.txt"), times).unwrap();
    let rows = "2011-09-26T13:04:32Z,8,0.1\n2011-09-26T13:04:33Z,8,0.1\n";
    let table = format!("time,speed_mps,yaw_rate_radps\n{rows}");
    fs::write(at("speed.csv"), table).unwrap();
    let warns = || text_of(open(root.path()).warnings()).contains("timestamps.txt: its dates");
    assert!(warns());
    fs::write(at("dataset.toml"), "start_s = 1317042272.3\n").unwrap();
    assert!(!warns(), "the first image's time is given");
    fs::remove_file(at("dataset.toml")).unwrap();
    fs::remove_file(at("speed.csv")).unwrap();
    assert!(!warns(), "there is no log");
}

/// KITTI's drive 0005 as a folder with tables made from its oxts: every pair's motion is the same except for the
/// body's roll and pitch, which a table of speeds and yaw rates does not contain.
#[cfg(unix)]
#[test]
fn a_real_drive_and_a_folder_of_it_give_the_same_snippets() {
    let Some(drive) = common::real_data("kitti_raw/2011_09_26/2011_09_26_drive_0005_sync") else {
        return;
    };
    let drive = drive.canonicalize().unwrap();
    let kitti = open(&drive);
    let root = tempfile::tempdir().unwrap();
    let at = |name: &str| root.path().join(name);
    std::os::unix::fs::symlink(drive.join("image_02/data"), at("images")).unwrap();
    let times = |sensor: &str| {
        let file = drive.join(sensor).join("timestamps.txt");
        deepfusion_data::kitti::TimeStamps::read(&file).unwrap().ns
    };
    let mut frames = "timestamp [ns],file\n".to_owned();
    for (frame, ns) in kitti.frames().iter().zip(times("image_02")) {
        let name = frame
            .image
            .path()
            .file_name()
            .unwrap()
            .to_string_lossy()
            .into_owned();
        frames += &format!("{},{name}\n", ns.unwrap());
    }
    let mut speeds = "timestamp [ns],speed_mps,yaw_rate_radps\n".to_owned();
    for (n, ns) in times("oxts").into_iter().enumerate() {
        let packet = fs::read_to_string(drive.join(format!("oxts/data/{n:010}.txt"))).unwrap();
        let words: Vec<&str> = packet.split_whitespace().collect();
        speeds += &format!("{},{},{}\n", ns.unwrap(), words[8], words[19]);
    }
    fs::write(at("frames.csv"), frames).unwrap();
    fs::write(at("speed.csv"), speeds).unwrap();
    let k = kitti.intrinsics(0);
    let intrinsics = format!("{} {} {} {}", k.fx, k.fy, k.cx, k.cy);
    fs::write(at("intrinsics.txt"), intrinsics).unwrap();
    fs::write(at("dataset.toml"), mount(&kitti)).unwrap();
    let own = open(root.path());
    let (a, b) = (
        kitti.snippets(&[1], 0.5).unwrap(),
        own.snippets(&[1], 0.5).unwrap(),
    );
    assert_eq!((a.len(), b.len()), (153, 153));
    let tilted: f64 = a.iter().zip(&b).map(|(a, b)| same(&kitti, a, b)).sum();
    // A tenth of a degree per pair and more, according to the GPS-fused pose.
    assert!(tilted / 153.0 > 1e-3, "{tilted}");
    let warning = deepfusion_data::speed_unit_warning(&own).unwrap();
    assert!(warning.is_none(), "{warning:?}");
}

/// Asserts that the folder's motions `b` equal KITTI's `a` without roll and pitch; returns the largest roll and pitch in
/// radians.
fn same(kitti: &Dataset, a: &Snippet, b: &Snippet) -> f64 {
    assert_eq!(a.target, b.target);
    let time_s = |frame: usize| kitti.frames()[frame].time_s.unwrap();
    let (mount, track) = (kitti.cam_from_vehicle().unwrap(), kitti.track().unwrap());
    let mut tilted = 0.0;
    for (x, y) in a.sources.iter().zip(&b.sources) {
        assert_eq!((x.offset, x.frame), (y.offset, y.frame));
        let (from, to) = (a.target.min(x.frame), a.target.max(x.frame));
        let vehicle = track.motion(time_s(from), time_s(to)).unwrap();
        let x_is_later = x.frame > a.target;
        let (x, y) = (&x.motion, &y.motion);
        assert!((x.dt_s - y.dt_s).abs() < 1e-9);
        assert!((x.distance_m - y.distance_m).abs() < 1e-8, "{x:?} {y:?}");
        let apart = |source_from_target: Se3, vehicle: VehicleMotion| {
            let earlier_from_later = vehicle.camera0_from_camera1(&mount);
            let between = if x_is_later {
                source_from_target * earlier_from_later
            } else {
                source_from_target * earlier_from_later.inverse()
            };
            between.translation().norm() + between.angle()
        };
        assert!(apart(x.source_from_target.unwrap(), vehicle) < 1e-8);
        assert!(apart(y.source_from_target.unwrap(), vehicle.level()) < 1e-8);
        tilted += apart(y.source_from_target.unwrap(), vehicle);
    }
    tilted
}

#[test]
fn without_a_yaw_rate_distances_are_known_and_turns_are_not() {
    let root = tempfile::tempdir().unwrap();
    write_drive(root.path(), 8, 10.0, 0.0);
    let speeds: String = (0..40)
        .map(|i| format!("{},10\n", f64::from(i) * 0.05))
        .collect();
    fs::write(
        root.path().join("speed.csv"),
        format!("time_s,speed_mps\n{speeds}"),
    )
    .unwrap();
    let dataset = open(root.path());
    assert!(!dataset.yaw_known());
    for snippet in dataset.snippets(&[1], 0.5).unwrap() {
        let motion = snippet.sources[0].motion;
        assert!((motion.distance_m - 1.03).abs() < 1e-9);
        assert_eq!(motion.source_from_target, None);
    }
    let seen = inspect(root.path()).unwrap();
    assert_eq!(seen.drives[0].turn_rad, None);
    assert!((seen.distance_m.unwrap() - 7.21).abs() < 1e-9);
    let text = seen.to_string();
    assert!(
        text.contains("no yaw rate") && text.contains("turned unknown"),
        "{text}"
    );
}

#[test]
fn an_inspection_reports_streams_and_what_is_assumed() {
    let root = tempfile::tempdir().unwrap();
    write_drive(root.path(), 8, 10.0, 0.1);
    let seen = inspect(root.path()).unwrap();
    assert_eq!(
        (seen.kind, seen.frames, seen.size),
        (DatasetKind::Folder, 8, Some([62, 19]))
    );
    let stream = |name: &str| seen.streams.iter().find(|s| s.name == name).unwrap();
    assert!((stream("speed.csv").rate_hz.unwrap() - 9.7087).abs() < 1e-3);
    assert_eq!((stream("frames").kind, stream("frames").gaps), ("image", 0));
    assert!((seen.drives[0].turn_rad.unwrap() - 0.0721).abs() < 1e-6);
    let text = seen.to_string();
    assert!(
        text.starts_with("image folder, 8 frames of 62x19"),
        "{text}"
    );
    assert!(
        text.contains("intrinsics.txt: no image size is given"),
        "{text}"
    );
    assert!(text.contains("[mount] in dataset.toml"), "{text}");
    let json = serde_json::to_value(&seen).unwrap();
    assert_eq!(
        (&json["kind"], &json["speed_mps"]["max"]),
        (&"folder".into(), &10.0.into())
    );
}

#[test]
fn images_without_speeds_are_opened_but_cannot_be_trained_on() {
    let root = tempfile::tempdir().unwrap();
    for n in 0..4 {
        picture(n)
            .save(root.path().join(format!("{n:03}.png")))
            .unwrap();
    }
    fs::write(root.path().join("intrinsics.txt"), "36\n36\n30.5\n8.6\n").unwrap();
    let dataset = open(root.path());
    assert_eq!(dataset.frames().len(), 4);
    assert_eq!(dataset.load_image(2).unwrap(), picture(2));
    let error = dataset.snippets(&[1], 0.5).unwrap_err();
    assert!(error.to_string().contains(": no speeds"), "{error}");
    assert!(error.hint().unwrap().contains("speed.csv"), "{error}");
    fs::write(
        root.path().join("speed.csv"),
        "time_s,speed_mps\n0,1\n0.1,1\n",
    )
    .unwrap();
    let error = open(root.path()).snippets(&[1], 0.5).unwrap_err();
    assert!(
        error.to_string().contains("its frames have no times"),
        "{error}"
    );
    assert!(
        error.hint().unwrap().contains("fps in dataset.toml"),
        "{error}"
    );
    assert!(dataset.moving_labels().unwrap().is_none());
    assert!(matches!(
        dataset.camera_paths().unwrap_err(),
        Error::NoPath { .. }
    ));
}

#[test]
fn a_camera_is_never_guessed() {
    let root = tempfile::tempdir().unwrap();
    write_images(root.path(), &["a", "b"]);
    let text = refusal(root.path());
    assert!(
        text.contains("fx, fy, cx, cy") && text.contains("intrinsics.txt"),
        "{text}"
    );
    let options = OpenOptions {
        intrinsics: Some([36.0, 36.0, 30.5, 8.6]),
        ..OpenOptions::default()
    };
    let given = Dataset::open(root.path(), &options).unwrap();
    assert_eq!(given[0].intrinsics(0).cx, 30.5);
    fs::write(
        root.path().join("dataset.toml"),
        "intrinsics = [36, 36, 300, 8.6]",
    )
    .unwrap();
    let text = refusal(root.path());
    assert!(
        text.contains("dataset.toml: cx is 300.0, outside an image of 62 pixels"),
        "{text}"
    );
    let other = OpenOptions {
        camera: Cameras::Right,
        ..options
    };
    let error = Dataset::open(root.path(), &other).unwrap_err();
    assert!(matches!(error, Error::OneCamera { .. }), "{error}");
}

#[test]
fn a_calibration_of_another_size_is_refused() {
    let root = tempfile::tempdir().unwrap();
    write_images(root.path(), &["a", "b"]);
    let yaml = "image_width: 124\nimage_height: 38\ncamera_matrix: {rows: 3, cols: 3, data: [72, 0, 61, 0, 72, 17, 0, 0, 1]}\n";
    fs::write(root.path().join("calibration.yaml"), yaml).unwrap();
    let text = refusal(root.path());
    assert!(
        text.contains("is 62x19, but its calibration is for 124x38"),
        "{text}"
    );
    assert!(
        text.contains("calibration.yaml") && text.contains("resized images"),
        "{text}"
    );
}

#[test]
fn times_that_do_not_overlap_are_refused_unless_start_s_joins_them() {
    let root = tempfile::tempdir().unwrap();
    write_drive(root.path(), 8, 10.0, 0.0);
    let speeds: String = (0..20)
        .map(|i| format!("{:.1},10\n", 1e9 + f64::from(i) * 0.1))
        .collect();
    fs::write(
        root.path().join("speed.csv"),
        format!("time_s,speed_mps\n{speeds}"),
    )
    .unwrap();
    let text = refusal(root.path());
    assert!(
        text.contains("do not overlap") && text.contains("start_s"),
        "{text}"
    );
    fs::write(root.path().join("dataset.toml"), "start_s = 1000000000.2").unwrap();
    let dataset = open(root.path());
    assert_eq!(dataset.snippets(&[1], 0.5).unwrap().len(), 7);
    // Half of the frames are outside the speeds: the rest can be used, with a warning.
    fs::write(root.path().join("dataset.toml"), "start_s = 1000000001.5").unwrap();
    let seen = inspect(root.path()).unwrap();
    assert!(seen.drives[0].usable_pairs > 1 && seen.drives[0].usable_pairs < 7);
    assert!(
        seen.to_string()
            .contains("no speed was measured around the time of"),
        "{seen}"
    );
}

#[test]
fn depth_images_are_ground_truth_in_the_given_unit() {
    let root = tempfile::tempdir().unwrap();
    write_drive(root.path(), 3, 10.0, 0.0);
    let depth = root.path().join("depth");
    fs::create_dir(&depth).unwrap();
    let image: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_fn(62, 19, |x, y| {
        Luma([if y == 0 { 9999 } else { 100 * x as u16 }])
    });
    image.save(depth.join("000001.png")).unwrap();
    let text = refusal(root.path());
    assert!(
        text.contains("unit of the depth images") && text.contains("depth_unit_m"),
        "{text}"
    );
    fs::write(
        root.path().join("dataset.toml"),
        "depth_unit_m = 0.001\ndepth_invalid = 9999\n",
    )
    .unwrap();
    let dataset = open(root.path());
    assert!(dataset.ground_truth(0, GtKind::Z).unwrap().is_none());
    assert!(dataset.has_ground_truth(1, GtKind::Z) && !dataset.has_ground_truth(2, GtKind::Z));
    let map = dataset.ground_truth(1, GtKind::Z).unwrap().unwrap();
    assert_eq!(map.data[5], 0.0);
    assert!((map.data[62 + 30] - 3.0).abs() < 1e-6);
    let error = dataset.ground_truth(1, GtKind::Velodyne).unwrap_err();
    assert!(matches!(error, Error::DepthKind { .. }), "{error}");
    assert_eq!(inspect(root.path()).unwrap().drives[0].scans, 1);
}

#[test]
fn distorted_images_are_corrected_when_they_are_loaded() {
    let root = tempfile::tempdir().unwrap();
    write_drive(root.path(), 3, 10.0, 0.0);
    fs::remove_file(root.path().join("intrinsics.txt")).unwrap();
    let yaml = "%YAML:1.0\n---\nimage_width: 62\nimage_height: 19\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   \
        dt: d\n   data: [ 36., 0., 30.5, 0., 36., 8.6, 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n   \
        cols: 4\n   dt: d\n   data: [ -0.2, 0.02, 0., 0. ]\n";
    fs::write(root.path().join("calibration.yaml"), yaml).unwrap();
    let dataset = open(root.path());
    let (k, image) = (dataset.intrinsics(0), dataset.load_image(0).unwrap());
    assert_eq!((k.width, k.height), image.dimensions());
    // A barrel lens enlarges the middle, so the corrected image shows less than the full width.
    assert!(k.fx < 36.0 && k.fx > 25.0, "{k:?}");
    // A pixel's red value is four times its column in the distorted image.
    let ray = k.back_project(50.0, 9.0, 1.0);
    let r2 = ray.x * ray.x + ray.y * ray.y;
    let column = 36.0 * ray.x * (1.0 - 0.2 * r2 + 0.02 * r2 * r2) + 30.5;
    let red = f64::from(image.get_pixel(50, 9).0[0]);
    assert!((red - 4.0 * column).abs() <= 0.51, "{red} {column}");
}

#[test]
fn images_and_a_video_together_need_a_choice() {
    let root = tempfile::tempdir().unwrap();
    write_drive(root.path(), 3, 10.0, 0.0);
    fs::write(root.path().join("drive.mp4"), "").unwrap();
    let text = refusal(root.path());
    assert!(text.contains("the folder has images and a video"), "{text}");
    fs::write(root.path().join("dataset.toml"), "images = 'images'").unwrap();
    assert_eq!(open(root.path()).kind(), DatasetKind::Folder);
}

#[test]
fn a_split_selects_by_the_folders_name() {
    let root = tempfile::tempdir().unwrap();
    let drive = root.path().join("monday");
    write_drive(&drive, 8, 10.0, 0.0);
    let file = root.path().join("split.txt");
    fs::write(&file, "monday 3 l\nmonday 5\n").unwrap();
    let options = OpenOptions {
        split: Some(deepfusion_data::Split::read(&file).unwrap()),
        ..OpenOptions::default()
    };
    assert_eq!(
        Dataset::open(&drive, &options).unwrap()[0].selected(),
        [3, 5]
    );
    fs::write(&file, "tuesday 3\n").unwrap();
    let options = OpenOptions {
        split: Some(deepfusion_data::Split::read(&file).unwrap()),
        ..OpenOptions::default()
    };
    let error = Dataset::open(&drive, &options).unwrap_err();
    assert!(
        matches!(error, Error::SplitSelectsNothing { .. }),
        "{error}"
    );
}

/// Other recordings in the folder of a recording are named in a warning, since they are not read.
#[test]
fn other_recordings_in_the_folder_are_named() {
    let root = tempfile::tempdir().unwrap();
    let at = root.path();
    write_drive(at, 4, 10.0, 0.0);
    // Parts of the recording, and files that are not recordings.
    for folder in ["depth", "notes", "out"] {
        fs::create_dir(at.join(folder)).unwrap();
    }
    picture(0).save(at.join("notes/photo.png")).unwrap();
    for file in ["predict-1-of-1.manifest.json", "drive.mp4"] {
        fs::write(at.join("out").join(file), "").unwrap();
    }
    let warning = |path: &Path| {
        let warnings = text_of(open(path).warnings());
        let about = warnings.lines().filter(|w| w.contains("not read"));
        about.collect::<Vec<_>>().join("\n")
    };
    assert_eq!(warning(at), "");
    write_drive(&at.join("second"), 4, 10.0, 0.0);
    fs::create_dir(at.join("third")).unwrap();
    fs::write(at.join("third/clip.MP4"), "").unwrap();
    let expected = format!(
        "{} is read only as an image folder; second, third in it look like recordings and are not read (",
        at.display()
    );
    assert!(warning(at).starts_with(&expected), "{}", warning(at));
    let passed_over = open(at).passed_over().map(ToString::to_string);
    assert_eq!(passed_over, Some(warning(at)));
    let noted = text_of(&inspect(at).unwrap().drives[0].warnings);
    assert!(noted.lines().any(|line| line == warning(at)), "{noted}");
    // Given by its own path, there is no warning.
    assert_eq!(warning(&at.join("second")), "");

    // KITTI drives, with a video of them; files within a drive belong to it.
    let root = tempfile::tempdir().unwrap();
    let drive = TinyDrive::default().write(root.path());
    write_drive(&drive.join("extra"), 4, 10.0, 0.0);
    assert_eq!(warning(root.path()), "");
    // A video with the name of an output.
    fs::write(root.path().join("drive_video.mp4"), "").unwrap();
    assert_eq!(warning(root.path()), "");
    let expected = |rest: &str| {
        format!(
            "{} is read only as KITTI raw; {rest}",
            root.path().display()
        )
    };
    fs::write(root.path().join("drive.mp4"), "").unwrap();
    let one = expected(
        "drive.mp4 in it looks like a recording and is not read (give it by its own path)",
    );
    assert_eq!(warning(root.path()), one);
    write_drive(&root.path().join("walk"), 4, 10.0, 0.0);
    let both = expected("drive.mp4, walk in it look like recordings and are not read (");
    assert!(warning(root.path()).starts_with(&both));
    assert_eq!(warning(&drive), "");
}
