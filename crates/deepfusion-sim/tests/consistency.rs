//! What a photometric loss relies on: warping a frame by the true depth and pose gives the other frame, drives repeat byte for byte, and
//! every sensor sees the same world.

use deepfusion_sim::{ObjectClass, SimConfig, SimFrame, Simulation};
use nalgebra::Vector3;

fn drive(config: SimConfig) -> Simulation {
    Simulation::new(&config).expect("a valid configuration")
}

/// Bilinear sample of an image at (u, v), RGB in [0, 1].
fn sample(frame: &SimFrame, u: f64, v: f64) -> [f64; 3] {
    let (w, h) = frame.rgb.dimensions();
    let (x, y) = ((u.floor() as u32).min(w - 2), (v.floor() as u32).min(h - 2));
    let (fx, fy) = (u - f64::from(x), v - f64::from(y));
    std::array::from_fn(|c| {
        let at = |dx, dy| f64::from(frame.rgb.get_pixel(x + dx, y + dy).0[c]) / 255.0;
        (at(0, 0) * (1.0 - fx) + at(1, 0) * fx) * (1.0 - fy)
            + (at(0, 1) * (1.0 - fx) + at(1, 1) * fx) * fy
    })
}

/// Mean absolute error of frame `b` warped onto frame `a` over visible static pixels, their share of all pixels with a depth, and the error
/// without warping on the same pixels.
fn warp_error(simulation: &Simulation, a: &SimFrame, b: &SimFrame) -> (f64, f64, f64) {
    let k = simulation.intrinsics();
    let b_from_a = b.world_from_cam.inverse() * a.world_from_cam;
    let (mut sum, mut unwarped, mut seen, mut all) = (0.0, 0.0, 0usize, 0usize);
    for v in 0..k.height {
        for u in 0..k.width {
            let index = (v * k.width + u) as usize;
            let depth = a.depth.data[index];
            if depth <= 0.0 || depth > 80.0 || a.moving[index] {
                continue;
            }
            all += 1;
            let point = k.back_project(f64::from(u), f64::from(v), f64::from(depth));
            let there = b_from_a.transform(&point);
            let Some(pixel) = k.project(&there) else {
                continue;
            };
            if pixel.x < 0.0
                || pixel.y < 0.0
                || pixel.x > f64::from(k.width - 1)
                || pixel.y > f64::from(k.height - 1)
            {
                continue;
            }
            let nearest = (pixel.y.round() as u32 * k.width + pixel.x.round() as u32) as usize;
            let other = f64::from(b.depth.data[nearest]);
            if b.moving[nearest] || (other - there.z).abs() > 0.03 * there.z {
                continue;
            }
            let warped = sample(b, pixel.x, pixel.y);
            let stays = sample(b, f64::from(u), f64::from(v));
            let here = a.rgb.get_pixel(u, v).0;
            for c in 0..3 {
                let truth = f64::from(here[c]) / 255.0;
                sum += (warped[c] - truth).abs() / 3.0;
                unwarped += (stays[c] - truth).abs() / 3.0;
            }
            seen += 1;
        }
    }
    let n = seen as f64;
    (sum / n, n / all as f64, unwarped / n)
}

#[test]
fn warping_by_true_depth_and_pose_reproduces_the_frame() {
    for (seed, moving_cars) in [(1, 0), (2, 6), (3, 0), (11, 3)] {
        let simulation = drive(SimConfig {
            seed,
            frames: 60,
            moving_cars,
            ..SimConfig::default()
        });
        for target in [3, 25, 50] {
            let (a, b) = (simulation.frame(target), simulation.frame(target + 1));
            for (from, to, name) in [(&a, &b, "forward"), (&b, &a, "backward")] {
                let (error, share, unwarped) = warp_error(&simulation, from, to);
                println!(
                    "seed {seed} frame {target} {name}: {error:.4} on {share:.2}, unwarped {unwarped:.4}"
                );
                assert!(error < 0.02, "seed {seed}, frame {target}, {name}: {error}");
                assert!(share > 0.6, "seed {seed}, frame {target}, {name}: {share}");
                assert!(
                    unwarped > 2.5 * error,
                    "too little to learn from: {unwarped} vs {error}"
                );
            }
        }
    }
}

#[test]
fn one_seed_gives_one_drive_and_another_a_different_one() {
    let config = SimConfig {
        seed: 5,
        frames: 8,
        width: 320,
        height: 96,
        moving_cars: 2,
        ..SimConfig::default()
    };
    let (a, b) = (drive(config.clone()), drive(config.clone()));
    let (x, y) = (a.frame(4), b.frame(4));
    assert_eq!(x.rgb.as_raw(), y.rgb.as_raw());
    assert_eq!(x.depth, y.depth);
    assert_eq!(x.world_from_cam, y.world_from_cam);
    assert_eq!(a.velodyne(4), b.velodyne(4));
    assert_eq!(a.oxts(4), b.oxts(4));
    let other = drive(SimConfig { seed: 6, ..config });
    let z = other.frame(4);
    let differing = x
        .rgb
        .as_raw()
        .iter()
        .zip(z.rgb.as_raw())
        .filter(|(p, q)| p.abs_diff(**q) > 10)
        .count();
    assert!(differing > x.rgb.as_raw().len() / 2);
}

/// The points of a scan, transformed by the calibration, agree with the camera's depth.
#[test]
fn the_scan_agrees_with_the_camera_s_depth() {
    let simulation = drive(SimConfig {
        seed: 4,
        frames: 30,
        width: 1242,
        height: 375,
        moving_cars: 4,
        ..SimConfig::default()
    });
    let k = simulation.intrinsics();
    let cam_from_velo = simulation.rig().cam_from_velo();
    for number in [0, 17] {
        let frame = simulation.frame(number);
        let cloud = simulation.velodyne(number);
        assert!(cloud.xyz.len() > 30_000, "{}", cloud.xyz.len());
        let (mut agree, mut all) = (0, 0);
        for point in &cloud.xyz {
            let p = cam_from_velo.transform(&Vector3::from(point.map(f64::from)));
            let Some(pixel) = k.project(&p) else { continue };
            let (u, v) = (pixel.x.round(), pixel.y.round());
            if u < 0.0 || v < 0.0 || p.z < 1.0 {
                continue;
            }
            // Points behind an edge, as seen from the camera, rightly disagree.
            if let Some(depth) = frame.depth.get(u as usize, v as usize) {
                all += 1;
                let tolerance = 0.12 + 0.02 * p.z;
                agree += usize::from((f64::from(depth) - p.z).abs() < tolerance);
            }
        }
        let share = f64::from(agree as u32) / f64::from(all);
        println!("frame {number}: {share:.4} of {all} points agree");
        assert!(
            all > 5000 && share > 0.95,
            "frame {number}: {share} of {all}"
        );
    }
}

/// The inertial unit's speeds and rates, integrated, give the poses.
#[test]
fn oxts_integrates_to_the_poses() {
    let simulation = drive(SimConfig {
        seed: 9,
        frames: 200,
        ..SimConfig::default()
    });
    let (mut distance, mut yaw, mut path, mut turn) = (0.0, 0.0, 0.0, 0.0);
    for i in 1..simulation.frames() {
        let dt = simulation.time_s(i) - simulation.time_s(i - 1);
        let (a, b) = (simulation.oxts(i - 1).values, simulation.oxts(i).values);
        distance += 0.5 * dt * (a[8] + b[8]);
        yaw += 0.5 * dt * (a[22] + b[22]);
        turn += (b[5] - a[5] + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU)
            - std::f64::consts::PI;
        let step = simulation.world_from_imu(i).translation()
            - simulation.world_from_imu(i - 1).translation();
        path += step.xy().norm();
        assert!(
            (a[16] - 9.81).abs() < 1.5,
            "gravity should be measured upwards: {}",
            a[16]
        );
        let acceleration = (b[8] - a[8]) / dt;
        assert!(
            (acceleration - 0.5 * (a[14] + b[14])).abs() < 0.3,
            "{acceleration} {}",
            a[14]
        );
    }
    assert!((distance / path - 1.0).abs() < 0.002, "{distance} {path}");
    assert!((yaw - turn).abs() < 0.01, "{yaw} {turn}");
    assert!(path > 60.0);
}

/// The camera's displacement includes the lever arm from the IMU, and its height stays the same.
#[test]
fn the_camera_keeps_its_height() {
    let simulation = drive(SimConfig {
        frames: 100,
        ..SimConfig::default()
    });
    for i in 0..100 {
        let pose = simulation.world_from_cam(i);
        assert!((pose.translation().z - 1.65).abs() < 0.06);
        assert!(
            pose.rotate(&Vector3::z()).z.abs() < 0.05,
            "should look level"
        );
        assert!(pose.rotate(&Vector3::y()).z < -0.99, "y should point down");
    }
}

/// Depths are as on a street: little sky, mostly near, and with a layout that changes.
#[test]
fn depths_are_those_of_a_street() {
    for seed in 20..26 {
        let simulation = drive(SimConfig {
            seed,
            frames: 120,
            width: 320,
            height: 96,
            ..SimConfig::default()
        });
        let mut medians = Vec::new();
        for i in (0..120).step_by(20) {
            let depth = simulation.frame(i).depth;
            let mut known: Vec<f32> = depth.data.iter().copied().filter(|d| *d > 0.0).collect();
            let sky = 1.0 - known.len() as f64 / depth.data.len() as f64;
            assert!(sky < 0.4, "seed {seed}, frame {i}: {sky} sky");
            known.sort_by(f32::total_cmp);
            assert!(known[0] > 0.8, "an object is only {} m away", known[0]);
            medians.push(known[known.len() / 2]);
        }
        println!("seed {seed}: median depths {medians:?}");
        assert!(
            medians.iter().all(|m| (4.0..30.0).contains(m)),
            "{medians:?}"
        );
    }
}

/// The camera never drives through an object, and moving boxes move by their velocity.
#[test]
fn the_camera_drives_through_no_object() {
    for seed in [31, 32, 33] {
        let simulation = drive(SimConfig {
            seed,
            frames: 300,
            moving_cars: 9,
            ..SimConfig::default()
        });
        let standing = simulation.objects(0).len() - 9;
        for i in (0..300).step_by(3) {
            let objects = simulation.objects(i);
            let eye = simulation.world_from_cam(i).translation();
            for object in &objects {
                let p = object.world_from_object.inverse().transform(&eye);
                let inside = (0..2).all(|k| p[k].abs() < 0.5 * object.size[k] + 0.4);
                // Tree crowns and lamp arms may reach over the road.
                let low = object.size[2] < 2.5 || object.class == ObjectClass::Building;
                assert!(!(inside && low), "seed {seed}, frame {i}: {object:?}");
            }
            if i + 1 < 300 && objects.len() == standing + 9 {
                let dt = simulation.time_s(i + 1) - simulation.time_s(i);
                let next = simulation.objects(i + 1);
                for (a, b) in objects.iter().zip(&next).skip(standing) {
                    let moved = (b.world_from_object.translation()
                        - a.world_from_object.translation())
                        / dt;
                    // The next list is shorter if a car has left the street.
                    if next.len() == objects.len() {
                        assert!((moved - a.velocity).norm() < 0.35, "{moved} {a:?}");
                    }
                    assert!(a.velocity.norm() > 2.5);
                }
            }
        }
    }
}

/// The pixels of a moving car's mask, at their depth, are in its box.
#[test]
fn moving_pixels_lie_in_moving_boxes() {
    let simulation = drive(SimConfig {
        seed: 2,
        frames: 60,
        moving_cars: 6,
        ..SimConfig::default()
    });
    let k = simulation.intrinsics();
    let mut masked = 0;
    for i in [0, 20, 40] {
        let frame = simulation.frame(i);
        let boxes: Vec<_> = simulation
            .objects(i)
            .into_iter()
            .filter(|object| object.velocity.norm() > 0.0)
            .collect();
        for (index, _) in frame.moving.iter().enumerate().filter(|(_, m)| **m) {
            let (u, v) = (index % 640, index / 640);
            let point = k.back_project(u as f64, v as f64, f64::from(frame.depth.data[index]));
            let world = frame.world_from_cam.transform(&point);
            let inside = boxes.iter().any(|object| {
                let p = object.world_from_object.inverse().transform(&world);
                // Wheels project by a centimetre from the box.
                (0..3).all(|axis| p[axis].abs() <= 0.5 * object.size[axis] + 0.03)
            });
            assert!(inside, "frame {i}, pixel {u}, {v}");
            masked += 1;
        }
    }
    assert!(masked > 1000, "{masked}");
}
