//! A drive written as a bag contains the drive's data.

use deepfusion_fs::PartialFolder;
use deepfusion_rosbag::msg::{CameraInfo, CompressedImage, Imu, PointCloud2, TwistStamped};
use deepfusion_rosbag::{Bag, Selection};
use deepfusion_sim::{BagSettings, Error, Scene, Sensors, SimConfig, Simulation, topic, write_bag};
use std::ops::ControlFlow;

fn simulation() -> Simulation {
    let config = SimConfig {
        seed: 11,
        frames: 30,
        width: 96,
        height: 72,
        fps: 25.0,
        moving_cars: 6,
        scene: Scene::Commercial,
        sensors: Sensors::Umad,
        ..SimConfig::default()
    };
    Simulation::new(&config).unwrap()
}

#[test]
fn the_bag_contains_the_drive() {
    let simulation = simulation();
    let folder = tempfile::tempdir().unwrap();
    let settings = BagSettings {
        clock_offset_s: 0.25,
        ..BagSettings::default()
    };
    let mut calls = Vec::new();
    let path = write_bag(&simulation, folder.path(), &settings, &mut |done, of| {
        calls.push((done, of));
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(calls.last(), Some(&(30, 30)));
    assert_eq!(path.file_name().unwrap(), "commercial_0011.bag");
    let bag = Bag::open(&path).unwrap();
    assert!(bag.damage().is_none());
    let count = |name: &str| {
        let topics = bag.topics().unwrap();
        topics.iter().find(|t| t.name == name).unwrap().count
    };
    let duration = simulation.time_s(29);
    assert_eq!((count(topic::IMAGE), count(topic::CAMERA_INFO)), (30, 30));
    assert_eq!(count(topic::LIDAR), (duration * 10.0) as u64 + 1);
    assert_eq!(count(topic::IMU), (duration * 100.0).ceil() as u64 + 1);

    let first = |name: &str| {
        let messages = bag.messages(Selection::topics([name])).unwrap();
        messages.into_iter().next().unwrap().unwrap()
    };
    let speed = first(topic::SPEED);
    let start = speed.time();
    let image = first(topic::IMAGE);
    assert!((image.time().seconds_since(start) - 0.25).abs() < 1e-9);
    let image: CompressedImage<'_> = image.decode().unwrap();
    let decoded = image::load_from_memory(&image.data).unwrap().to_rgb8();
    assert_eq!(decoded, simulation.frame(0).rgb);
    let info = first(topic::CAMERA_INFO);
    let info: CameraInfo = info.decode().unwrap();
    assert_eq!(info.k[0], simulation.intrinsics().fx);
    let imu: Imu = first(topic::IMU).decode().unwrap();
    assert_eq!(
        imu.linear_acceleration.z,
        simulation.imu_readings()[0].acceleration.z
    );
    let twist: TwistStamped = speed.decode().unwrap();
    assert_eq!(
        twist.twist.linear.x,
        simulation.speed_readings()[0].speed_mps
    );
    let cloud = first(topic::LIDAR);
    let cloud: PointCloud2<'_> = cloud.decode().unwrap();
    let scan = simulation.fmcw(0.0);
    let velocity: Vec<f32> = cloud.column("velocity").unwrap().f32s().collect();
    assert_eq!(Some(velocity), scan.cloud.radial_velocity);

    let text = std::fs::read_to_string(path.with_extension("toml")).unwrap();
    assert!(text.contains("scenario = \"commercial\"") && text.contains("[cam_from_lidar]"));
}

#[test]
fn equal_drives_make_equal_bags_and_nothing_is_overwritten() {
    let simulation = simulation();
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str| {
        let out = folder.path().join(name);
        write_bag(&simulation, &out, &BagSettings::default(), &mut |_, _| {
            ControlFlow::Continue(())
        })
    };
    let [a, b] = ["a", "b"].map(|name| std::fs::read(write(name).unwrap()).unwrap());
    assert!(a == b, "the bytes differ");
    let error = write("a").unwrap_err();
    assert!(error.to_string().contains("not empty"), "{error}");
}

/// A bag that is stopped at its last frame is complete, and files of a killed writer do not block it.
#[test]
fn a_bag_stopped_at_its_last_frame_is_complete() {
    let simulation = simulation();
    let folder = tempfile::tempdir().unwrap();
    let left = PartialFolder::beside(&folder.path().join("commercial_0011.bag")).unwrap();
    std::fs::write(left.path().join("commercial_0011.toml"), "half").unwrap();
    left.abandon();
    let settings = BagSettings {
        lidar_step_deg: 5.0,
        ..BagSettings::default()
    };
    let path = write_bag(&simulation, folder.path(), &settings, &mut |done, of| {
        if done == of {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let path = path.unwrap();
    assert!(Bag::open(&path).unwrap().damage().is_none());
    let entries = std::fs::read_dir(folder.path()).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["commercial_0011.bag", "commercial_0011.toml"]);
}

/// If another process takes the bag's name meanwhile, its file stays as it is, and no file is left beside it.
#[test]
fn a_bag_does_not_replace_another_file() {
    let simulation = simulation();
    let folder = tempfile::tempdir().unwrap();
    let taken = folder.path().join("commercial_0011.bag");
    let settings = BagSettings {
        lidar_step_deg: 5.0,
        ..BagSettings::default()
    };
    let error = write_bag(&simulation, folder.path(), &settings, &mut |_, _| {
        std::fs::write(&taken, "another's").unwrap();
        ControlFlow::Continue(())
    });
    let message = error.unwrap_err().to_string();
    assert!(
        message.contains("commercial_0011.bag: cannot move"),
        "{message}"
    );
    assert_eq!(std::fs::read(&taken).unwrap(), b"another's");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_bag_that_is_stopped_leaves_nothing() {
    let simulation = simulation();
    let folder = tempfile::tempdir().unwrap();
    let entries = || std::fs::read_dir(folder.path()).unwrap().count();
    for out in [folder.path().join("new"), folder.path().to_owned()] {
        let mut calls = 0;
        let stopped = write_bag(&simulation, &out, &BagSettings::default(), &mut |_, _| {
            calls += 1;
            ControlFlow::Break(())
        });
        assert!(
            matches!(stopped, Err(Error::Stopped { done: 8, total: 30 })),
            "{stopped:?}"
        );
        assert_eq!((calls, entries()), (1, 0));
    }
}
