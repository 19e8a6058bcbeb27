//! Mounts from the frames of `/tf_static` and `/tf`, in combination with a file or a profile.

use super::common::{Drive, OPTICAL, STILL, assert_contains, camera, is_near, open};
use crate::common::bag::TinyBag;
use crate::common::text_of;
use deepfusion_data::{Dataset, Error, GtKind};
use deepfusion_geometry::Se3;
use nalgebra::Vector3;
use std::fs;

#[test]
fn the_file_takes_precedence_over_the_frames_and_a_disagreement_is_reported() {
    // The camera 1.5 m ahead and 1.2 m up.
    let place = [1.5, 0.0, 1.2];
    let frames = |bag: &mut TinyBag| {
        bag.transforms("/tf_static", move |_| {
            vec![("base_link", "camera", place, OPTICAL)]
        });
    };
    let by_frames = Drive::new("", frames).opened();
    is_near(&camera(&by_frames).0, place);
    is_near(&camera(&by_frames).1, [1.0, 0.0, 0.0]);
    let warnings = text_of(by_frames.warnings());
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
    assert_contains(
        &text_of(other.warnings()),
        &[
            "cam_from_vehicle",
            "drive.toml and frames base_link → camera are 0.400 m and 0.00° apart",
            "the former is used",
        ],
    );
}

#[test]
fn the_frames_take_precedence_over_a_profile() {
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
    assert_contains(&text_of(both.warnings()), &["the profile umad", "apart"]);
    assert!(both.has_ground_truth(3, GtKind::Z));
}

/// A camera with two parents is ambiguous, unless both give the same mount.
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
    assert_contains(
        &text,
        &[
            "drive.bag: cam_from_vehicle is ambiguous",
            "base_link → roof → camera",
            "base_link → bumper → camera",
            "0.250 m",
            "hint: set [cam_from_vehicle]",
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
fn the_likeliest_vehicle_frame_is_used_and_the_file_decides_between_two() {
    // A rear axle takes precedence over base_link, wherever that is.
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
    assert_contains(
        &two("").refusal(),
        &[
            "car_1/base_link and car_2/base_link could both be the vehicle's frame",
            "frames.vehicle = \"car_1/base_link\"",
        ],
    );
    let named = two("[frames]\nvehicle = \"car_2/base_link\"\n").opened();
    is_near(&camera(&named).0, [1.0, 0.0, 1.2]);
    assert_contains(
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
    assert_contains(
        &warnings,
        &[
            "cam_from_vehicle: the frames base_link and camera are not fixed to each other",
            "27.50°",
            "the camera's mount is not given",
        ],
    );
    is_near(&camera(&dataset).0, [0.0; 3]);
    assert!(dataset.mounts().is_empty());

    // On /tf but constant, it counts as static.
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

/// A scan whose point is measured 40 ms after the time in its header, at 10 m/s; according to the file, its driver does not compensate for
/// motion.
#[test]
fn points_are_moved_to_the_frame_from_their_own_time() {
    let depth = |sidecar: &str, after_s: f32| {
        let drive = Drive::new(sidecar, |bag| {
            bag.within("lidar").timed_scans("/points", after_s);
            bag.transforms("/tf_static", |_| {
                vec![
                    ("base_link", "camera", [1.5, 0.0, 1.2], OPTICAL),
                    ("base_link", "lidar", [1.5, 0.0, 1.5], STILL),
                ]
            });
        });
        let truth = open(&drive.bag)?.ground_truth(12, GtKind::Z)?;
        let depths = truth.unwrap().data.into_iter();
        Ok::<f32, Error>(depths.fold(0.0, f32::max))
    };
    let named = "[lidar]\ntime_field = \"time\"\n";
    let (at_once, by_point) = (depth("", 0.04).unwrap(), depth(named, 0.04).unwrap());
    assert!(
        (by_point - at_once - 0.4).abs() < 1e-3,
        "{at_once} {by_point}"
    );
    let text = depth(named, 5.0).unwrap_err().to_string();
    assert_contains(&text, &["/points", "time", "more than 1 s"]);
}

#[test]
fn a_frame_that_is_not_optical_is_reported_and_rotated() {
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
    assert_contains(&warnings, &["the images' frame camera has its z axis up"]);
    // The scan's point is 10 m ahead of the LiDAR, 0.4 m higher than the camera, so it is in the image.
    let lidar = dataset.mounts().iter().find(|m| m.name == "cam_from_lidar");
    let cam_from_lidar = Se3::from_axis_angle(
        Vector3::from(lidar.unwrap().rotation),
        Vector3::from(lidar.unwrap().translation),
    );
    let point = cam_from_lidar.transform(&Vector3::new(10.0, 0.0, 0.0));
    assert!(point.z > 9.8 && point.y < -0.3, "{point}");
}

#[test]
fn missing_frames_are_reported() {
    // The images' frame is in no transform.
    let missing = Drive::new("", |bag| {
        bag.transforms("/tf_static", |_| {
            vec![("base_link", "cam0", [1.0, 0.0, 1.0], OPTICAL)]
        });
    });
    let warnings = text_of(missing.opened().warnings());
    assert_contains(
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

    // No frame has a known name for the vehicle; naming that of the speed solves it.
    let nameless = Drive::bare("", |bag| {
        bag.within("camera").images("/camera/image");
        bag.camera_info("/camera/camera_info", 60.0);
        bag.within("").twist("/speed", 10.0);
        bag.transforms("/tf_static", |_| {
            vec![("chassis", "camera", [1.0, 0.0, 1.0], OPTICAL)]
        });
    });
    let warnings = text_of(nameless.opened().warnings());
    assert_contains(
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
fn the_inertial_units_frame_corrects_its_orientation() {
    // Upside down: its z points down, so it measures the opposite rate, and gravity's reaction along -z.
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
    // Without frames it is assumed to lie flat, which gravity contradicts.
    let text = drive(false).refusal();
    assert_contains(&text, &["180", "vehicle_from_imu"]);
}
