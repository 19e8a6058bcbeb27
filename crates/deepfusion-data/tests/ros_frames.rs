//! Bags as ROS vehicles record them: the sensors' places by `/tf_static` and `/tf`, speeds by satellite positions, several cameras,
//! and no file beside them.

use crate::common::bag::{CAMERA, TinyBag};
use crate::common::text_of;
use deepfusion_data::{Dataset, Error, GtKind, NamedTopic, OpenOptions, inspect, write_bag_config};
use deepfusion_geometry::Se3;
use deepfusion_hint::Hint;
use nalgebra::{Matrix3, Matrix4, Vector3};
use serde::Deserialize;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// What `reference/ros_drive.py` says of its drive.
#[derive(Deserialize)]
struct DriveFacts {
    cam_from_vehicle: [[f64; 4]; 4],
    cam_from_lidar: [[f64; 4]; 4],
    vehicle_from_imu: [[f64; 4]; 4],
    /// Nanoseconds and m/s, along the exact path.
    speeds: Vec<(i64, f64)>,
    images: usize,
}

fn reference(name: &str) -> PathBuf {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/ros");
    tests.join(name)
}

fn facts() -> DriveFacts {
    serde_json::from_str(&fs::read_to_string(reference("drive.json")).unwrap()).unwrap()
}

fn open(bag: &Path) -> Result<Dataset, Error> {
    open_with(bag, &[])
}

fn open_with(bag: &Path, topics: &[&str]) -> Result<Dataset, Error> {
    let topics: Vec<NamedTopic> = topics.iter().map(|t| t.parse().unwrap()).collect();
    let options = OpenOptions {
        topics,
        ..OpenOptions::default()
    };
    Ok(Dataset::open(bag, &options)?.remove(0))
}

/// The chain of quaternions is exact to rounding; the file's own transforms are given to 16 digits.
fn is_transform(found: &Se3, expected: &[[f64; 4]; 4], what: &str) {
    let expected = Matrix4::from_fn(|r, c| expected[r][c]);
    let apart = (found.matrix() - expected).abs().max();
    assert!(apart < 1e-9, "{what}: {apart}");
}

/// Mounts are where scipy puts them, and speeds those of the path that the positions are of.
fn is_the_drive(dataset: &Dataset, known: &DriveFacts) {
    let mount = |name: &str| {
        let mount = dataset.mounts().iter().find(|m| m.name == name).unwrap();
        assert!(mount.source.starts_with("frames "), "{mount:?}");
        Se3::from_axis_angle(
            Vector3::from(mount.rotation),
            Vector3::from(mount.translation),
        )
    };
    let name = "cam_from_vehicle";
    is_transform(&mount(name), &known.cam_from_vehicle, name);
    let used = dataset.cam_from_vehicle().unwrap();
    is_transform(&used, &known.cam_from_vehicle, "used");
    let name = "vehicle_from_imu";
    is_transform(&mount(name), &known.vehicle_from_imu, name);

    // 1 Hz, straight lines between: over the whole drive and at each frame.
    let origin_ns = dataset.origin_ns().unwrap();
    let speed_at = |time_s: f64| {
        let ns = origin_ns + (time_s * 1e9).round() as i64;
        let after = known.speeds.partition_point(|s| s.0 < ns);
        known.speeds[after.min(known.speeds.len() - 1)].1
    };
    let frames = dataset.frames().iter();
    let pairs: Vec<(f64, f64)> = frames
        .filter_map(|f| Some((f.speed_mps?, speed_at(f.time_s?))))
        .collect();
    // The last position is of the drive's ninth second, its end of the tenth.
    let after = dataset.frames().iter().filter(|f| f.time_s > Some(9.1));
    assert_eq!(pairs.len() + after.count(), dataset.frames().len());
    let of = |part: fn(&(f64, f64)) -> f64| pairs.iter().map(part).sum::<f64>();
    let ratio = of(|p| p.0) / of(|p| p.1);
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    // It brakes at 1.7 m/s² where the positions end, which they cannot show.
    let rms = (of(|p| (p.0 - p.1).powi(2)) / pairs.len() as f64).sqrt();
    assert!(rms < 0.5, "{rms} m/s");

    let warnings = text_of(dataset.warnings());
    assert!(!warnings.contains("nothing says"), "{warnings}");
    says(
        &warnings,
        &[
            "/gnss/fix: left out, as they have no position: 1 of 10 messages",
            "smoothed, sure to 0.",
            "bridged",
        ],
    );
}

fn says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

#[test]
fn a_drive_needs_no_file_beside_it() {
    let known = facts();
    let dataset = open(&reference("drive.bag")).unwrap();
    is_the_drive(&dataset, &known);
    assert_eq!(dataset.frames().len(), known.images);
    let lidar = dataset.mounts().iter().find(|m| m.name == "cam_from_lidar");
    let lidar = lidar.unwrap();
    let found = Se3::from_axis_angle(
        Vector3::from(lidar.rotation),
        Vector3::from(lidar.translation),
    );
    is_transform(&found, &known.cam_from_lidar, "cam_from_lidar");
    let truths = (0..dataset.frames().len()).filter(|i| dataset.has_ground_truth(*i, GtKind::Z));
    assert!(truths.count() >= 10);

    let seen = inspect(&reference("drive.bag")).unwrap();
    let text = seen.to_string();
    says(
        &text,
        &[
            "cam_from_vehicle",
            "frames base_link → roof_rack → camera_front_link → camera_front_optical",
        ],
    );
    assert!(seen.drives[0].usable_pairs > 40, "{text}");
}

#[cfg(feature = "ros2")]
#[test]
fn the_same_drive_of_ros_2_needs_none_either() {
    is_the_drive(&open(&reference("drive_ros2")).unwrap(), &facts());
}

// --- small bags ---

/// A camera's axes (right, down, forward) in a body's (forward, left, up), as an axis-angle vector: 120° about (-1, 1, -1)/√3.
const OPTICAL: [f64; 3] = [
    -1.209_199_576_156_145,
    1.209_199_576_156_145,
    -1.209_199_576_156_145,
];
const STILL: [f64; 3] = [0.0; 3];

/// A bag `drive.bag` in a folder of its own, with a file beside it unless that would be empty.
struct Drive {
    _folder: TempDir,
    bag: PathBuf,
}

impl Drive {
    /// Pictures of the frame `camera`, and a speed.
    fn new(sidecar: &str, fill: impl FnOnce(&mut TinyBag)) -> Self {
        Self::bare(sidecar, |bag| {
            bag.within("camera").images("/camera/image");
            bag.camera_info("/camera/camera_info", 60.0);
            bag.within("base_link").twist("/speed", 10.0);
            fill(bag);
        })
    }

    fn bare(sidecar: &str, fill: impl FnOnce(&mut TinyBag)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.bag");
        let mut bag = TinyBag::empty(&path);
        fill(&mut bag);
        bag.finish();
        if !sidecar.is_empty() {
            fs::write(path.with_extension("toml"), sidecar).unwrap();
        }
        Self {
            _folder: folder,
            bag: path,
        }
    }

    fn opened(&self) -> Dataset {
        open(&self.bag).unwrap()
    }

    fn refusal(&self) -> String {
        refusal(open(&self.bag))
    }
}

fn refusal(opened: Result<Dataset, Error>) -> String {
    let error = opened.unwrap_err();
    format!("{error}\nhint: {}", error.hint().unwrap_or_default())
}

/// Where the camera is in the vehicle's axes, and where it looks.
fn camera(dataset: &Dataset) -> (Vector3<f64>, Vector3<f64>) {
    let vehicle_from_cam = dataset.cam_from_vehicle().unwrap().inverse();
    (
        vehicle_from_cam.translation(),
        vehicle_from_cam.rotate(&Vector3::z()),
    )
}

fn is_near(found: &Vector3<f64>, expected: [f64; 3]) {
    let apart = (found - Vector3::from(expected)).norm();
    assert!(apart < 1e-9, "{found}, not {expected:?}");
}

#[test]
fn the_file_goes_before_the_frames_and_a_disagreement_is_reported() {
    // The camera 1.5 m ahead and 1.2 m up.
    let place = [1.5, 0.0, 1.2];
    let frames = |bag: &mut TinyBag| {
        bag.transforms("/tf_static", move |_| {
            vec![("base_link", "camera", place, OPTICAL)]
        });
    };
    let alone = Drive::new("", frames).opened();
    is_near(&camera(&alone).0, place);
    is_near(&camera(&alone).1, [1.0, 0.0, 0.0]);
    let warnings = text_of(alone.warnings());
    assert!(!warnings.contains("cam_from_vehicle"), "{warnings}");

    let file = |x: f64| {
        format!(
            "[cam_from_vehicle]\ntranslation = [0.0, 1.2, {x}]\nrotation = [1.2091995761561454, -1.2091995761561454, 1.2091995761561454]\n"
        )
    };
    let same = Drive::new(&file(-1.501), frames).opened();
    is_near(&camera(&same).0, [1.501, 0.0, 1.2]);
    assert!(!text_of(same.warnings()).contains("apart"));
    let other = Drive::new(&file(-1.9), frames).opened();
    is_near(&camera(&other).0, [1.9, 0.0, 1.2]);
    says(
        &text_of(other.warnings()),
        &[
            "cam_from_vehicle",
            "drive.toml and frames base_link → camera are 0.400 m and 0.00° apart",
            "the former is taken",
        ],
    );
}

#[test]
fn the_frames_go_before_a_profile() {
    let lidar = |bag: &mut TinyBag| {
        bag.within("lidar").scans("/points");
    };
    let mount = |dataset: &Dataset| {
        let mut mounts = dataset.mounts().iter();
        let found = mounts.find(|m| m.name == "cam_from_lidar");
        found.cloned().unwrap()
    };
    let profile = Drive::new("profile = \"umad\"\n", lidar).opened();
    assert_eq!(mount(&profile).translation, [0.0, 0.08, 0.0]);
    assert_eq!(mount(&profile).source, "profile umad");
    let both = Drive::new("profile = \"umad\"\n", |bag| {
        lidar(bag);
        bag.transforms("/tf_static", |_| {
            vec![
                ("base_link", "camera", [1.5, 0.0, 1.2], OPTICAL),
                ("base_link", "lidar", [1.5, 0.0, 1.5], STILL),
            ]
        });
    })
    .opened();
    // 0.3 m above the camera, where its y looks down.
    is_near(&mount(&both).translation.into(), [0.0, -0.3, 0.0]);
    assert_eq!(mount(&both).source, "frames lidar → base_link → camera");
    says(&text_of(both.warnings()), &["the profile umad", "apart"]);
    assert!(both.has_ground_truth(3, GtKind::Z));
}

/// A camera that hangs from two parents is in two places, unless both say the same.
#[test]
fn two_parents_are_refused_with_both_chains() {
    let frames = |y: f64| {
        move |bag: &mut TinyBag| {
            bag.transforms("/tf_static", move |_| {
                vec![
                    ("base_link", "roof", [1.0, 0.0, 1.5], STILL),
                    ("base_link", "bumper", [3.0, 0.0, 0.5], STILL),
                    ("roof", "camera", [0.5, 0.0, 0.0], OPTICAL),
                    ("bumper", "camera", [-1.5, y, 1.0], OPTICAL),
                ]
            });
        }
    };
    is_near(
        &camera(&Drive::new("", frames(0.0)).opened()).0,
        [1.5, 0.0, 1.5],
    );
    let text = Drive::new("", frames(0.25)).refusal();
    says(
        &text,
        &[
            "drive.bag: cam_from_vehicle is ambiguous",
            "base_link → roof → camera",
            "base_link → bumper → camera",
            "0.250 m",
            "hint: say it: [cam_from_vehicle]",
            "drive.toml",
        ],
    );
    let file = "[cam_from_vehicle]\ntranslation = [0.0, 1.5, -1.5]\nrotation = [1.2092, -1.2092, 1.2092]\n";
    is_near(
        &Drive::new(file, frames(0.25))
            .opened()
            .cam_from_vehicle()
            .unwrap()
            .translation(),
        [0.0, 1.5, -1.5],
    );
}

#[test]
fn the_vehicles_frame_is_the_likeliest_and_of_two_the_file_says_which() {
    // A rear axle goes before base_link, wherever that lies.
    let axle = Drive::new("", |bag| {
        bag.transforms("/tf_static", |_| {
            vec![
                ("base_link", "rear_axle", [-1.3, 0.0, 0.0], STILL),
                ("base_link", "camera", [0.7, 0.0, 1.2], OPTICAL),
            ]
        });
    });
    is_near(&camera(&axle.opened()).0, [2.0, 0.0, 1.2]);

    let two = |sidecar: &str| {
        Drive::new(sidecar, |bag| {
            bag.transforms("/tf_static", |_| {
                vec![
                    ("train", "car_1/base_link", [0.0, 0.0, 0.0], STILL),
                    ("train", "car_2/base_link", [9.0, 0.0, 0.0], STILL),
                    ("car_2/base_link", "camera", [1.0, 0.0, 1.2], OPTICAL),
                ]
            });
        })
    };
    says(
        &two("").refusal(),
        &[
            "car_1/base_link and car_2/base_link could both be the vehicle's frame",
            "frames.vehicle = \"car_1/base_link\"",
        ],
    );
    let named = two("[frames]\nvehicle = \"car_2/base_link\"\n").opened();
    is_near(&camera(&named).0, [1.0, 0.0, 1.2]);
    says(
        &two("[frames]\nvehicle = \"car_3\"\n").refusal(),
        &[
            "frames.vehicle: car_3 is in no transform",
            "car_1/base_link, car_2/base_link",
        ],
    );
}

#[test]
fn a_camera_that_pans_has_no_mount() {
    let drive = Drive::new("", |bag| {
        bag.transforms("/tf_static", |_| {
            vec![("head", "camera", [0.1, 0.0, 0.0], OPTICAL)]
        });
        bag.transforms("/tf", |i| {
            let yaw = 0.02 * f64::from(i);
            vec![
                ("odom", "base_link", [f64::from(i), 0.0, 0.0], STILL),
                ("base_link", "head", [1.0, 0.0, 1.0], [0.0, 0.0, yaw]),
            ]
        });
    });
    let dataset = drive.opened();
    let warnings = text_of(dataset.warnings());
    says(
        &warnings,
        &[
            "cam_from_vehicle: the frames base_link and camera are not fixed to each other",
            "27.50°",
            "nothing says where the camera is on the vehicle",
        ],
    );
    is_near(&camera(&dataset).0, [0.0; 3]);
    assert!(dataset.mounts().is_empty());

    // On /tf, but where it was all the time, it is as good as static.
    let still = Drive::new("", |bag| {
        bag.transforms("/tf", |i| {
            vec![
                ("odom", "base_link", [f64::from(i), 0.0, 0.0], STILL),
                ("base_link", "camera", [1.0, 0.0, 1.0], OPTICAL),
            ]
        });
    });
    is_near(&camera(&still.opened()).0, [1.0, 0.0, 1.0]);
}

#[test]
fn a_frame_that_is_not_optical_is_reported_and_turned() {
    let drive = Drive::new("", |bag| {
        bag.within("lidar").scans("/points");
        bag.transforms("/tf_static", |_| {
            // A little to the left and down.
            vec![
                ("base_link", "/camera", [1.5, 0.1, 1.2], [0.0, 0.05, 0.1]),
                ("base_link", "lidar", [1.5, 0.1, 1.6], STILL),
            ]
        });
    });
    let dataset = drive.opened();
    let (place, ahead) = camera(&dataset);
    is_near(&place, [1.5, 0.1, 1.2]);
    assert!(
        ahead.x > 0.99 && ahead.y > 0.05 && ahead.z < -0.03,
        "{ahead}"
    );
    let warnings = text_of(dataset.warnings());
    says(&warnings, &["the images' frame camera has its z axis up"]);
    // The scan's point is 10 m ahead of the LiDAR, 0.4 m higher than the camera: in the picture, or it were not seen.
    let lidar = dataset.mounts().iter().find(|m| m.name == "cam_from_lidar");
    let cam_from_lidar = Se3::from_axis_angle(
        Vector3::from(lidar.unwrap().rotation),
        Vector3::from(lidar.unwrap().translation),
    );
    let point = cam_from_lidar.transform(&Vector3::new(10.0, 0.0, 0.0));
    assert!(point.z > 9.8 && point.y < -0.3, "{point}");
}

#[test]
fn frames_that_lead_nowhere_are_errors() {
    // The images' frame is in no transform.
    let missing = Drive::new("", |bag| {
        bag.transforms("/tf_static", |_| {
            vec![("base_link", "cam0", [1.0, 0.0, 1.0], OPTICAL)]
        });
    });
    let warnings = text_of(missing.opened().warnings());
    says(
        &warnings,
        &[
            "the frame of the images, camera, is in no transform",
            "frames.camera in",
            "drive.toml",
        ],
    );
    fs::write(
        missing.bag.with_extension("toml"),
        "[frames]\ncamera = \"cam0\"\n",
    )
    .unwrap();
    is_near(&camera(&missing.opened()).0, [1.0, 0.0, 1.0]);

    // Nothing is known as the vehicle; the frame whose speed it is would be.
    let nameless = Drive::bare("", |bag| {
        bag.within("camera").images("/camera/image");
        bag.camera_info("/camera/camera_info", 60.0);
        bag.within("").twist("/speed", 10.0);
        bag.transforms("/tf_static", |_| {
            vec![("chassis", "camera", [1.0, 0.0, 1.0], OPTICAL)]
        });
    });
    let warnings = text_of(nameless.opened().warnings());
    says(
        &warnings,
        &[
            "camera, chassis is known as the vehicle's",
            "frames.vehicle",
        ],
    );
    let speaking = Drive::bare("", |bag| {
        bag.within("camera").images("/camera/image");
        bag.camera_info("/camera/camera_info", 60.0);
        bag.within("chassis").twist("/speed", 10.0);
        bag.transforms("/tf_static", |_| {
            vec![("chassis", "camera", [1.0, 0.0, 1.0], OPTICAL)]
        });
    });
    is_near(&camera(&speaking.opened()).0, [1.0, 0.0, 1.0]);
}

#[test]
fn a_turned_inertial_unit_turns_the_vehicle_as_its_frame_says() {
    // Upside down: its z looks down, so it measures the opposite rate, and what holds it up against gravity along -z.
    let upside_down = [std::f64::consts::PI, 0.0, 0.0];
    let drive = |frames: bool| {
        Drive::new("", |bag| {
            bag.within("imu").imu_along_z("/imu", 0.2, -9.81);
            if frames {
                bag.transforms("/tf_static", move |_| {
                    vec![
                        ("base_link", "imu", [0.5, 0.0, 0.3], upside_down),
                        ("base_link", "camera", [1.0, 0.0, 1.0], OPTICAL),
                    ]
                });
            }
        })
    };
    let turned = drive(true).opened();
    let turn = turned.track().unwrap().motion(0.2, 0.7).unwrap().yaw_rad;
    assert!((turn + 0.1).abs() < 5e-3, "{turn}");
    // Without frames it would be taken as lying flat, which gravity contradicts.
    let text = drive(false).refusal();
    says(&text, &["180", "vehicle_from_imu"]);
}

// --- topics and speeds ---

#[test]
fn the_speeds_messages_are_read_and_positions_come_last() {
    let speed = |fill: fn(&mut TinyBag)| {
        let dataset = Drive::bare(CAMERA, |bag| {
            bag.images("/image");
            fill(bag);
        })
        .opened();
        dataset.frames()[12].speed_mps.unwrap()
    };
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 0.05, "{found}");
    near(
        speed(|bag| {
            bag.twist_with_covariance("/fused", 7.0)
                .odometry("/odom", 4.0);
        }),
        7.0,
    );
    near(
        speed(|bag| {
            bag.fixes("/fix", 12.0).ackermann("/drive", 3.0, 0.0);
        }),
        3.0,
    );
    near(
        speed(|bag| {
            bag.fixes("/fix", 12.0);
        }),
        12.0,
    );
    let scaled = Drive::bare(
        &format!("{CAMERA}vehicle = {{ speed_scale = 0.5 }}\n"),
        |bag| {
            bag.images("/image").fixes("/fix", 12.0);
        },
    );
    near(scaled.opened().frames()[12].speed_mps.unwrap(), 6.0);
    let error = Drive::bare(
        &format!("{CAMERA}vehicle = {{ max_gap_s = 0.0 }}\n"),
        |bag| {
            bag.images("/image");
        },
    )
    .refusal();
    says(&error, &["vehicle.max_gap_s is 0"]);
}

#[test]
fn a_topic_is_named_by_a_caller() {
    let drive = Drive::bare(
        "[vehicle]\nspeed_unit = \"km/h\"\n[topics]\nspeed = \"/speed\"\n",
        |bag| {
            for (name, focal) in [("front", 60.0), ("left", 90.0)] {
                bag.images(&format!("/{name}/image_raw"));
                bag.camera_info(&format!("/{name}/camera_info"), focal);
            }
            bag.float("/speed", 36.0)
                .twist("/twist", 5.0)
                .fixes("/fix", 12.0);
        },
    );
    let text = drive.refusal();
    says(
        &text,
        &[
            "2 topics could be the image",
            "name it: [topics] image = \"/front/image_raw\"",
        ],
    );
    let Err(Error::Topic {
        choice: Some(choice),
        ..
    }) = open(&drive.bag)
    else {
        panic!("two cameras");
    };
    assert_eq!(choice.to_string(), "image=/front/image_raw");
    // Each camera with the calibration beside it; what is named goes before the file.
    let opened = |topics: &[&str]| open_with(&drive.bag, topics).unwrap();
    assert_eq!(opened(&["image=/front/image_raw"]).intrinsics(0).fx, 60.0);
    let left = opened(&["image=/left/image_raw"]);
    assert_eq!(left.intrinsics(0).fx, 90.0);
    assert!((left.frames()[12].speed_mps.unwrap() - 10.0).abs() < 1e-3);
    let other = opened(&[
        "image=/left/image_raw",
        "speed=/fix",
        "camera_info=/front/camera_info",
    ]);
    assert_eq!(other.intrinsics(0).fx, 60.0);
    assert!((other.frames()[12].speed_mps.unwrap() - 12.0).abs() < 0.05);
    let text = refusal(open_with(&drive.bag, &["image=/rear/image_raw"]));
    says(
        &text,
        &["has no topic /rear/image_raw", "/front/image_raw, "],
    );
    let text = refusal(open_with(&drive.bag, &["image=/twist"]));
    says(
        &text,
        &[
            "/twist holds geometry_msgs/TwistStamped",
            "sensor_msgs/Image",
        ],
    );
    // A video, a folder of images: neither has topics.
    let folder = tempfile::tempdir().unwrap();
    let picture = deepfusion_data::RgbImage::new(8, 8);
    deepfusion_data::save_png(&picture, &folder.path().join("0.png")).unwrap();
    let text = refusal(open_with(folder.path(), &["image=/twist"]));
    says(&text, &["image=/twist", "has no topics"]);
}

// --- the file, written ---

#[test]
fn the_file_that_is_written_says_what_was_found() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("drive.bag");
    fs::copy(reference("drive.bag"), &bag).unwrap();
    let before = open(&bag).unwrap();
    let written = write_bag_config(&bag, &OpenOptions::default(), false).unwrap();
    assert_eq!(written, [bag.with_extension("toml")]);
    let text = fs::read_to_string(&written[0]).unwrap();
    says(
        &text,
        &[
            "image = \"/camera/front/image_raw/compressed\"   # sensor_msgs/CompressedImage, 51 messages",
            "speed = \"/gnss/fix\"",
            "[cam_from_vehicle]   # frames base_link → roof_rack",
            "# The camera is as CameraInfo has it.",
            "# wheelbase_m = 2.7",
        ],
    );
    let after = open(&bag).unwrap();
    for (a, b) in before.mounts().iter().zip(after.mounts()) {
        assert_eq!(a.name, b.name);
        let same = |a: [f64; 3], b: [f64; 3]| (Vector3::from(a) - Vector3::from(b)).norm() < 1e-12;
        assert!(
            same(a.translation, b.translation) && same(a.rotation, b.rotation),
            "{}",
            a.name
        );
        assert!(b.source.ends_with("drive.toml"), "{}", b.source);
    }
    assert_eq!(before.mounts().len(), 3);
    assert_eq!(
        before.warnings(),
        after.warnings(),
        "nothing contradicts anything"
    );
    let speeds = |dataset: &Dataset| -> Vec<Option<f64>> {
        dataset.frames().iter().map(|f| f.speed_mps).collect()
    };
    assert_eq!(speeds(&before), speeds(&after));

    // Not over a file that is there, unless that is asked for; what it had to say stays.
    let error = write_bag_config(&bag, &OpenOptions::default(), false).unwrap_err();
    assert!(matches!(error, Error::Exists { .. }), "{error}");
    let edited = format!("scenario = \"urban\"\n{text}\n[vehicle]\nwheelbase_m = 2.9\n");
    fs::write(&written[0], edited).unwrap();
    let options = OpenOptions {
        intrinsics: Some([70.0, 71.0, 48.0, 32.0]),
        camera_ahead_s: Some(0.02),
        topics: vec!["speed=/gnss/fix".parse().unwrap()],
        ..OpenOptions::default()
    };
    write_bag_config(&bag, &options, true).unwrap();
    let text = fs::read_to_string(&written[0]).unwrap();
    says(
        &text,
        &[
            "scenario = \"urban\"",
            "wheelbase_m = 2.9",
            "fx = 70.0",
            "camera_ahead_s = 0.02",
            "# as it was here before",
        ],
    );
    let again = open(&bag).unwrap();
    assert_eq!(
        (again.intrinsics(0).fx, again.camera_ahead_s()),
        (70.0, 0.02)
    );
    assert_eq!(again.scenario(), Some("urban"));
}

#[test]
fn a_signal_makes_room_for_a_named_topic() {
    let can = "[can]\nspeed_unit = \"km/h\"\n\
        speed = { id = 0x158, layout = { start_bit = 7, length = 16, byte_order = \"motorola\", scale = 0.01 } }\n";
    let drive = Drive::bare(&format!("{CAMERA}{can}"), |bag| {
        let frame = deepfusion_rosbag::msg::Frame {
            id: 0x158,
            dlc: 8,
            // 36 km/h.
            data: [0x0e, 0x10, 0, 0, 0, 0, 0, 0],
            ..Default::default()
        };
        bag.images("/image")
            .can("/can", &frame)
            .twist("/twist", 5.0);
    });
    let speed = |dataset: Dataset| dataset.frames()[12].speed_mps.unwrap();
    assert!((speed(drive.opened()) - 10.0).abs() < 1e-3);
    let topics = ["speed=/twist"];
    assert!((speed(open_with(&drive.bag, &topics).unwrap()) - 5.0).abs() < 1e-3);
    let options = OpenOptions {
        topics: vec![topics[0].parse().unwrap()],
        ..OpenOptions::default()
    };
    write_bag_config(&drive.bag, &options, true).unwrap();
    assert!((speed(drive.opened()) - 5.0).abs() < 1e-3);
    // What is written without a topic keeps the signal.
    let sidecar = drive.bag.with_extension("toml");
    fs::write(&sidecar, format!("{CAMERA}{can}")).unwrap();
    write_bag_config(&drive.bag, &OpenOptions::default(), true).unwrap();
    assert!((speed(drive.opened()) - 10.0).abs() < 1e-3);
}

#[test]
fn what_nobody_says_is_left_to_be_filled_in() {
    let drive = Drive::bare("", |bag| {
        bag.images("/image").twist("/speed", 10.0);
    });
    let options = OpenOptions {
        intrinsics: Some([60.0, 60.0, 32.0, 24.0]),
        ..OpenOptions::default()
    };
    let written = write_bag_config(&drive.bag, &options, false).unwrap();
    let text = fs::read_to_string(&written[0]).unwrap();
    says(&text, &["# [cam_from_vehicle]", "[camera]"]);
    // The camera that was given is kept, and the commented lines are a transform once they are none.
    assert_eq!(drive.opened().intrinsics(0).fx, 60.0);
    let (head, place) = text.split_once("# [cam_from_vehicle]").unwrap();
    let (place, rest) = place.split_once("\n\n").unwrap();
    let place = place.replace("\n# ", "\n");
    fs::write(
        &written[0],
        format!("{head}[cam_from_vehicle]{place}\n\n{rest}"),
    )
    .unwrap();
    let dataset = drive.opened();
    let cam_from_vehicle = dataset.cam_from_vehicle().unwrap();
    let axes = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    assert!((cam_from_vehicle.rotation() - axes).abs().max() < 1e-4);
    let (place, _) = camera(&dataset);
    assert!(
        (place - Vector3::new(1.6, 0.0, 1.2)).norm() < 1e-3,
        "{place}"
    );

    let folder = tempfile::tempdir().unwrap();
    let picture = deepfusion_data::RgbImage::new(8, 8);
    deepfusion_data::save_png(&picture, &folder.path().join("0.png")).unwrap();
    let error = write_bag_config(folder.path(), &OpenOptions::default(), false).unwrap_err();
    assert!(matches!(error, Error::NotABag { .. }), "{error}");
}
