//! Which topics are read, and the speeds from them.

use super::common::{Drive, assert_contains, open, open_with, refusal};
use crate::common::bag::{CAMERA, TinyBag};
use crate::common::text_of;
use deepfusion_data::{Dataset, Error, OpenOptions, write_bag_config};

#[test]
fn speeds_in_messages_take_precedence_over_positions() {
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
    assert_contains(&error, &["vehicle.max_gap_s is 0"]);
}

#[test]
fn callers_can_name_topics() {
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
    assert_contains(
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
    // Each camera has the calibration in its namespace; the caller's topics take precedence over the file's.
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
    assert_contains(&text, &["no topic /rear/image_raw", "/front/image_raw, "]);
    let text = refusal(open_with(&drive.bag, &["image=/twist"]));
    assert_contains(
        &text,
        &[
            "/twist has messages of the wrong type geometry_msgs/TwistStamped",
            "sensor_msgs/Image",
        ],
    );
    // A folder of images has no topics.
    let folder = tempfile::tempdir().unwrap();
    let picture = deepfusion_data::RgbImage::new(8, 8);
    deepfusion_data::save_png(&picture, &folder.path().join("0.png")).unwrap();
    let text = refusal(open_with(folder.path(), &["image=/twist"]));
    assert_contains(&text, &["image=/twist", "have no topics"]);
}

/// `nmea_navsat_driver` and ublox write east and north instead of forward and left.
#[test]
fn a_receivers_velocity_in_world_axes_is_not_a_forward_speed() {
    let opened = |course: fn(u32) -> f64| {
        Drive::bare(CAMERA, |bag| {
            bag.images("/image").course_twist("/vel", 8.0, course);
        })
        .opened()
    };
    // To the north-west: used as forward speed, x would be negative.
    let receiver = opened(|_| 2.4);
    let speed = receiver.frames()[12].speed_mps.unwrap();
    assert!((speed - 8.0).abs() < 1e-6, "{speed}");
    assert!(!receiver.yaw_known());
    assert_contains(&text_of(receiver.warnings()), &["/vel", "world axes"]);
    // A vehicle that slips in bends is not mistaken for it.
    let vehicle = opened(|i| if i % 5 == 0 { 0.35 } else { 0.05 });
    let speed = vehicle.frames()[12].speed_mps.unwrap();
    assert!(speed < 7.995, "{speed}");
    let warnings = text_of(vehicle.warnings());
    assert!(!warnings.contains("world axes"), "{warnings}");
}

/// ROS 2's controllers publish commands with stamps too.
#[test]
fn a_command_is_used_only_for_lack_of_a_measurement() {
    let sidecar = format!("{CAMERA}[vehicle]\nwheelbase_m = 2.5\n");
    let drive = |fill: fn(&mut TinyBag)| {
        Drive::bare(&sidecar, |bag| {
            bag.images("/image").twist("/controller/cmd_vel", 3.0);
            bag.ackermann("/ackermann_cmd", 3.0, 0.3);
            fill(bag);
        })
    };
    let speed = |drive: &Drive| drive.opened().frames()[12].speed_mps.unwrap();
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 0.05, "{found}");
    let measured = drive(|bag| {
        bag.odometry("/odom", 7.0).ackermann("/report", 9.0, 0.0);
    });
    near(speed(&measured), 7.0);
    let opened = measured.opened();
    let warnings = text_of(opened.warnings());
    assert!(!warnings.contains("command"), "{warnings}");
    let turn = opened.track().unwrap().motion(0.2, 0.7).unwrap().yaw_rad;
    assert!(turn.abs() < 1e-6, "{turn}");
    // GPS positions are less accurate, but measured.
    near(
        speed(&drive(|bag| {
            bag.fixes("/fix", 12.0);
        })),
        12.0,
    );
    let commands_only = drive(|_| {});
    near(speed(&commands_only), 3.0);
    let opened = commands_only.opened();
    assert_contains(
        &text_of(opened.warnings()),
        &[
            "/controller/cmd_vel: a command by its name, used as measured speed",
            "/ackermann_cmd: a command by its name, used as measured steering",
        ],
    );
    // There is no warning if the user named the topic.
    let named = ["speed=/controller/cmd_vel", "steering=/ackermann_cmd"];
    let named = open_with(&commands_only.bag, &named).unwrap();
    assert!(!text_of(named.warnings()).contains("command"));
}

#[test]
fn an_unusable_inertial_unit_can_be_left_out() {
    let level = |fill: fn(&mut TinyBag)| {
        Drive::bare(CAMERA, |bag| {
            bag.images("/image")
                .turning_twist("/twist", |_| (10.0, 0.2));
            fill(bag);
        })
    };
    // Accelerations from which a filter has removed gravity.
    let filtered = level(|bag| {
        bag.imu_along_z("/imu/data", 0.2, 0.02);
    });
    let text = filtered.refusal();
    assert_contains(
        &text,
        &[
            "removed already",
            "imu = \"none\" under [topics]",
            "drive.toml",
        ],
    );
    assert!(matches!(
        open(&filtered.bag),
        Err(Error::InertialUnit { .. })
    ));
    let turn = |dataset: &Dataset| {
        let motion = dataset.track().unwrap().motion(0.2, 0.7);
        motion.unwrap().yaw_rad
    };
    // Without the unit, named as none by the caller or the file, the twist's own yaw rate is used.
    let left_out = open_with(&filtered.bag, &["imu=none"]).unwrap();
    assert!(left_out.yaw_known() && (turn(&left_out) - 0.1).abs() < 1e-6);
    let sidecar = format!("{CAMERA}[topics]\nimu = \"none\"\n");
    std::fs::write(filtered.bag.with_extension("toml"), sidecar).unwrap();
    assert!((turn(&filtered.opened()) - 0.1).abs() < 1e-6);

    // RealSense's two topics, neither of which is a complete unit.
    let apart = level(|bag| {
        bag.imu_along_z("/camera/gyro/sample", 0.2, 0.0)
            .accelerometer("/camera/accel/sample");
    });
    assert_contains(
        &apart.refusal(),
        &[
            "2 topics could be the imu",
            "or imu = \"none\" to read none",
        ],
    );
    let named = open_with(&apart.bag, &["imu=/camera/accel/sample"]).unwrap();
    assert!((turn(&named) - 0.1).abs() < 1e-6);
    assert_contains(
        &text_of(named.warnings()),
        &["/camera/accel/sample: not read, since it has no angular rates"],
    );
    // Missing rates may also be zeros.
    let still = Drive::bare(CAMERA, |bag| {
        bag.images("/image").twist("/twist", 10.0);
        bag.imu_along_z("/imu", 0.0, 9.81);
    })
    .opened();
    assert!(!still.yaw_known());
    assert_contains(&text_of(still.warnings()), &["/imu: not read"]);
    // Images are required.
    let text = refusal(open_with(&apart.bag, &["imu=none", "image=none"]));
    assert_contains(&text, &["no topic none", "hint: set image to one of"]);
}

#[test]
fn topics_set_to_none_stay_none_in_the_written_file() {
    let can = "[can]\nspeed_unit = \"km/h\"\n\
        speed = { id = 0x158, layout = { start_bit = 7, length = 16, byte_order = \"motorola\", scale = 0.01 } }\n";
    let drive = Drive::bare(&format!("{CAMERA}{can}"), |bag| {
        bag.images("/image").twist("/twist", 5.0);
        bag.imu("/imu/a", 0.2).imu("/imu/b", 0.2);
    });
    let options = OpenOptions {
        topics: vec!["imu=none".parse().unwrap(), "speed=none".parse().unwrap()],
        ..OpenOptions::default()
    };
    write_bag_config(&drive.bag, &options, true).unwrap();
    let text = std::fs::read_to_string(drive.bag.with_extension("toml")).unwrap();
    assert_contains(&text, &["imu = \"none\"", "speed = \"none\""]);
    let opened = drive.opened();
    assert_eq!(opened.frames()[12].speed_mps, None);
    assert!(opened.track().is_none());
}

/// FAST-LIO and others leave the twist of their odometry at 0.
#[test]
fn an_odometry_without_a_twist_gives_the_motion_of_its_poses() {
    let drive = |turned_rad: f64, scale: &str| {
        Drive::bare(&format!("{CAMERA}{scale}"), |bag| {
            bag.images("/image")
                .poses("/Odometry", 10.0, 0.4, turned_rad);
        })
        .opened()
    };
    let dataset = drive(0.0, "");
    let speed = dataset.frames()[12].speed_mps.unwrap();
    assert!((speed - 10.0).abs() < 0.01, "{speed}");
    let turn = dataset.track().unwrap().motion(0.2, 0.7).unwrap().yaw_rad;
    assert!(
        dataset.yaw_known() && (turn - 0.2).abs() < 1e-3,
        "{turn} rad"
    );
    assert_contains(
        &text_of(dataset.warnings()),
        &["/Odometry: its messages have no twist: speed and turns"],
    );
    let scaled = drive(0.0, "vehicle = { speed_scale = 0.5 }\n");
    let speed = scaled.frames()[12].speed_mps.unwrap();
    assert!((speed - 5.0).abs() < 0.01, "{speed}");
    // A body whose x axis points to the side.
    let sideways = drive(1.5, "");
    assert_eq!(sideways.frames()[12].speed_mps, None);
    assert_contains(&text_of(sideways.warnings()), &["/Odometry: no speed"]);
    // A vehicle at standstill is accepted.
    let standing = Drive::bare(CAMERA, |bag| {
        bag.images("/image").odometry("/odom", 0.0);
    })
    .opened();
    assert_eq!(standing.frames()[12].speed_mps, Some(0.0));
}

/// As with a GPX file beside a video, uncertain speeds have less weight in training.
#[test]
fn speeds_from_positions_have_standard_deviations() {
    let opened = |scale: &str, positions: bool| {
        Drive::bare(&format!("{CAMERA}{scale}"), |bag| {
            bag.images("/image");
            if positions {
                bag.fixes("/fix", 12.0);
            } else {
                bag.twist("/twist", 12.0);
            }
        })
        .opened()
    };
    let sigma_m = |dataset: &Dataset| {
        let ego = dataset.ego().unwrap();
        let motion = ego.between(dataset.frames(), 12, 13).unwrap();
        motion.distance_sigma_m
    };
    let dataset = opened("", true);
    let found = sigma_m(&dataset).unwrap();
    assert!(found > 0.004, "a tenth of a m/s over 40 ms: {found} m");
    assert!(dataset.receiver().course_rate_radps.is_some());
    let scaled = sigma_m(&opened("vehicle = { speed_scale = 0.5 }\n", true)).unwrap();
    assert!((scaled - 0.5 * found).abs() < 1e-9, "{scaled} of {found}");
    assert_eq!(sigma_m(&opened("", false)), None);
}
