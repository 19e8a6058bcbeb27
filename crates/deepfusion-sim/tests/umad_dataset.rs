//! A simulated drive read back as a data set: through a bag, KITTI's layout, and a folder with a table.

use deepfusion_data::{
    Dataset, GtKind, MovingSource, OpenOptions, convert_to_bag, convert_to_kitti, ego_velocity,
    ground_radial,
};
use deepfusion_rosbag::Compression;
use deepfusion_sim::{BagSettings, Scene, Sensors, SimConfig, Simulation, write_bag, write_kitti};
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

fn simulation(scene: Scene, frames: usize, moving_cars: usize) -> Simulation {
    let config = SimConfig {
        seed: 21,
        frames,
        width: 160,
        height: 120,
        fps: 25.0,
        moving_cars,
        scene,
        sensors: Sensors::Umad,
        scan_every: 0,
        ..SimConfig::default()
    };
    Simulation::new(&config).unwrap()
}

fn open(path: &Path) -> Dataset {
    let mut all = Dataset::open(path, &OpenOptions::default()).unwrap();
    assert_eq!(all.len(), 1);
    all.remove(0)
}

fn bag(simulation: &Simulation, folder: &Path, settings: &BagSettings) -> PathBuf {
    write_bag(simulation, &folder.join("bag"), settings, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap()
}

/// Images, tables of CAN speeds and of IMU readings, and the camera's intrinsics.
fn write_folder(simulation: &Simulation, out: &Path) {
    std::fs::create_dir_all(out.join("images")).unwrap();
    let mut times = String::new();
    for frame in 0..simulation.frames() {
        let picture = simulation.frame(frame).rgb;
        picture
            .save(out.join(format!("images/{frame:06}.png")))
            .unwrap();
        writeln!(times, "{:.9}", simulation.time_s(frame)).unwrap();
    }
    std::fs::write(out.join("timestamps.txt"), times).unwrap();
    let mut table = String::from("time_s,speed_mps\n");
    for reading in simulation.speed_readings() {
        writeln!(table, "{},{}", reading.time_s, reading.speed_mps).unwrap();
    }
    std::fs::write(out.join("speed.csv"), table).unwrap();
    let mut table = String::from(
        "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n",
    );
    for reading in simulation.imu_readings() {
        let (w, a) = (reading.angular_rate, reading.acceleration);
        let numbers = [reading.time_s, w.x, w.y, w.z, a.x, a.y, a.z].map(|x| x.to_string());
        writeln!(table, "{}", numbers.join(",")).unwrap();
    }
    std::fs::write(out.join("imu.csv"), table).unwrap();
    let k = simulation.intrinsics();
    // UMAD's camera: 1.6 m ahead of the rear axle, 0.72 m above the IMU there.
    let text = format!(
        "intrinsics = [{}, {}, {}, {}]\n[mount]\nforward_m = 1.6\nup_m = 0.72\n\
         [vehicle_from_imu]\ntranslation = [1.55, 0.0, 0.64]\n",
        k.fx, k.fy, k.cx, k.cy
    );
    std::fs::write(out.join("dataset.toml"), text).unwrap();
}

#[test]
fn bag_kitti_and_folder_give_the_same_snippets() {
    let simulation = simulation(Scene::Urban, 50, 0);
    let folder = tempfile::tempdir().unwrap();
    let path = bag(&simulation, folder.path(), &BagSettings::default());
    write_kitti(&simulation, &folder.path().join("kitti"), &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    write_folder(&simulation, &folder.path().join("folder"));
    let sets = [
        open(&path),
        open(&folder.path().join("kitti")),
        open(&folder.path().join("folder")),
    ];
    let snippets = sets.each_ref().map(|set| set.snippets(&[1], 0.5).unwrap());
    assert_eq!(snippets[0].len(), 49);
    let exact = &snippets[1];
    for (set, snippets) in [(0, &snippets[0]), (2, &snippets[2])] {
        assert_eq!(snippets.len(), exact.len());
        assert_eq!(sets[set].intrinsics(0).fx, sets[1].intrinsics(0).fx);
        for frame in [0, 17, 49] {
            let pixels = |set: &Dataset| set.load_image(frame).unwrap();
            assert!(pixels(&sets[set]) == pixels(&sets[1]), "frame {frame}");
        }
        let (mut sum, mut whole) = (0.0, 0.0);
        for (ours, exact) in snippets.iter().zip(exact) {
            let (ours, exact) = (&ours.sources[0].motion, &exact.sources[0].motion);
            assert!((ours.dt_s - exact.dt_s).abs() < 1e-6);
            // The CAN speed has a resolution of 0.014 m/s and noise; both drives are the same arc.
            let off = (ours.distance_m - exact.distance_m).abs();
            assert!(
                off < 0.03 * exact.distance_m + 1e-3,
                "{off} of {}",
                exact.distance_m
            );
            sum += ours.distance_m;
            whole += exact.distance_m;
            let (a, b) = (
                ours.source_from_target.unwrap(),
                exact.source_from_target.unwrap(),
            );
            let turned = (a * b.inverse()).angle();
            // A yaw bias of at most 0.008 rad/s over 0.04 s, and the remaining errors of roll and pitch after two seconds.
            assert!(turned < 6e-4, "{turned}");
        }
        assert!((sum / whole - 1.0).abs() < 5e-3, "{}", sum / whole);
    }
}

#[test]
fn the_lidar_s_depth_is_the_exact_depth() {
    let simulation = simulation(Scene::Commercial, 30, 4);
    let folder = tempfile::tempdir().unwrap();
    let set = open(&bag(&simulation, folder.path(), &BagSettings::default()));
    assert_eq!(set.scenario(), Some("commercial"));
    let (mut errors, mut with_scan) = (Vec::new(), 0);
    for frame in 0..30 {
        assert_eq!(
            set.has_ground_truth(frame, GtKind::Z),
            set.ground_truth(frame, GtKind::Z).unwrap().is_some()
        );
        let Some(truth) = set.ground_truth(frame, GtKind::Z).unwrap() else {
            continue;
        };
        with_scan += 1;
        let exact = simulation.frame(frame);
        for (i, (ours, exact_m)) in truth.data.iter().zip(&exact.depth.data).enumerate() {
            if *ours > 0.0 && *exact_m > 0.0 && !exact.moving[i] {
                errors.push((ours - exact_m).abs() / exact_m);
            }
        }
    }
    // At 10 scans and 25 frames a second, most frames have a scan within 25 ms.
    assert!((18..=30).contains(&with_scan), "{with_scan}");
    errors.sort_by(f32::total_cmp);
    let at = |share: f64| errors[(share * errors.len() as f64) as usize];
    // Half a pixel of rounding on slanted ground, and points that the LiDAR, 8 cm below the camera, sees past an edge.
    assert!(at(0.5) < 0.01 && at(0.9) < 0.08, "{} {}", at(0.5), at(0.9));
    assert!(matches!(
        set.ground_truth(0, GtKind::Velodyne),
        Err(deepfusion_data::Error::DepthKind { .. })
    ));
}

#[test]
fn radial_velocities_separate_dynamic_points() {
    let (mut hits, mut called, mut targets, mut found) = (0, 0, 0, 0);
    for (scene, seed_frames) in [
        (Scene::Urban, 120),
        (Scene::Commercial, 120),
        (Scene::Garage, 120),
    ] {
        let simulation = simulation(scene, seed_frames, 10);
        for step in 0..12 {
            let scan = simulation.fmcw(0.4 * f64::from(step));
            let radial = scan.cloud.radial_velocity.as_ref().unwrap();
            let ego = ego_velocity(&scan.cloud.xyz, radial, None).unwrap();
            let own = ground_radial(&scan.cloud.xyz, radial, &ego.velocity);
            for (i, own) in own.iter().enumerate() {
                let called_moving = own.abs() > 0.5;
                called += usize::from(called_moving);
                hits += usize::from(called_moving && scan.moving[i]);
                let target = scan.moving[i] && scan.ground_radial_mps[i].abs() > 1.0;
                targets += usize::from(target);
                found += usize::from(target && called_moving);
            }
        }
    }
    let precision = f64::from(hits as u32) / f64::from(called as u32);
    let recall = f64::from(found as u32) / f64::from(targets as u32);
    println!("{targets} points faster than 1 m/s: precision {precision:.4}, recall {recall:.4}");
    assert!(targets > 2000);
    assert!(precision >= 0.95 && recall >= 0.95, "{precision} {recall}");
}

#[test]
fn a_bag_s_moving_pixels_match_the_masks() {
    let simulation = simulation(Scene::Urban, 60, 10);
    let folder = tempfile::tempdir().unwrap();
    let set = open(&bag(&simulation, folder.path(), &BagSettings::default()));
    let labels = set.moving_labels().unwrap().unwrap();
    assert_eq!(labels.source(), MovingSource::RadialVelocity);
    let (mut right, mut of_masks, mut of_labels) = (0, 0, 0);
    for frame in (0..60).step_by(5) {
        let Some(truth) = set.ground_truth(frame, GtKind::Z).unwrap() else {
            continue;
        };
        let moving = labels
            .pixels(frame as u64, &truth, GtKind::Z)
            .unwrap()
            .unwrap();
        let exact = simulation.frame(frame).moving;
        for i in 0..moving.len() {
            if truth.data[i] > 0.0 {
                of_labels += usize::from(moving[i]);
                of_masks += usize::from(exact[i]);
                right += usize::from(moving[i] && exact[i]);
            }
        }
    }
    // They differ at the edges of dynamic objects, and because up to 25 ms pass between scan and frame.
    assert!(of_masks > 200, "{of_masks}");
    assert!(
        f64::from(right as u32) > 0.85 * f64::from(of_labels as u32),
        "{right} of {of_labels}"
    );
    assert!(
        f64::from(right as u32) > 0.8 * f64::from(of_masks as u32),
        "{right} of {of_masks}"
    );
}

#[test]
fn a_clock_offset_is_corrected() {
    let simulation = simulation(Scene::Urban, 150, 0);
    let folder = tempfile::tempdir().unwrap();
    let settings = BagSettings {
        clock_offset_s: 0.3,
        lidar_step_deg: 5.0,
        ..BagSettings::default()
    };
    let path = bag(&simulation, folder.path(), &settings);
    let speed_at = |set: &Dataset, frame: usize| set.frames()[frame].speed_mps.unwrap();
    let crooked = open(&path);
    let sidecar = path.with_extension("toml");
    let mut text = std::fs::read_to_string(&sidecar).unwrap();
    text += "\n[clock]\ncamera_ahead_s = 0.3\n";
    std::fs::write(&sidecar, text).unwrap();
    let set = open(&path);
    let (mut straight, mut off) = (0.0_f64, 0.0_f64);
    for frame in 0..140 {
        let exact = simulation.oxts(frame).forward_speed();
        straight = straight.max((speed_at(&set, frame) - exact).abs());
        off = off.max((speed_at(&crooked, frame) - exact).abs());
    }
    assert!(straight < 0.1, "{straight}");
    // Where the vehicle accelerates, 0.3 s change the speed by some decimetres per second.
    assert!(off > 0.25, "{off} {straight}");
}

/// Bag → KITTI → bag keeps images, times, motions and depths.
#[test]
fn a_bag_becomes_a_kitti_drive_and_a_bag_again() {
    let simulation = simulation(Scene::Urban, 20, 2);
    let folder = tempfile::tempdir().unwrap();
    let first = open(&bag(&simulation, folder.path(), &BagSettings::default()));
    let out = folder.path().join("kitti");
    let drives = convert_to_kitti(std::slice::from_ref(&first), &out, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let second = open(&drives.paths[0]);
    let again = folder.path().join("again.bag");
    convert_to_bag(&second, &again, Compression::Bz2, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let third = open(&again);
    let snippets = [&first, &second, &third].map(|set| set.snippets(&[1], 0.5).unwrap());
    for (set, snippets_of) in [(&second, &snippets[1]), (&third, &snippets[2])] {
        assert_eq!(snippets_of.len(), 19);
        assert_eq!(set.intrinsics(0), first.intrinsics(0));
        assert!(set.load_image(7).unwrap() == first.load_image(7).unwrap());
        for (a, b) in snippets_of.iter().zip(&snippets[0]) {
            let (a, b) = (&a.sources[0].motion, &b.sources[0].motion);
            assert!((a.dt_s - b.dt_s).abs() < 1e-6);
            // Speeds are now sampled at the frames, so the noise between them is not averaged.
            assert!((a.distance_m - b.distance_m).abs() < 0.03 * b.distance_m);
            let (a, b) = (a.source_from_target.unwrap(), b.source_from_target.unwrap());
            assert!((a * b.inverse()).angle() < 3e-4);
        }
        for frame in 0..20 {
            let depth = |set: &Dataset| set.ground_truth(frame, GtKind::Z).unwrap();
            let (ours, theirs) = (depth(set), depth(&first));
            assert_eq!(ours.is_some(), theirs.is_some(), "frame {frame}");
            let (Some(ours), Some(theirs)) = (ours, theirs) else {
                continue;
            };
            let same = ours.data.iter().zip(&theirs.data);
            let apart = same.filter(|(a, b)| (*a - *b).abs() > 1e-4 * b.abs());
            assert_eq!(apart.count(), 0, "frame {frame}");
        }
    }
    let refused = convert_to_kitti(std::slice::from_ref(&first), &out, &mut |_, _| {
        ControlFlow::Continue(())
    });
    assert!(refused.unwrap_err().to_string().contains("already exists"));
}
