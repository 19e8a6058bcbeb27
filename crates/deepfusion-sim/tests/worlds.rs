//! Varied worlds repeat, differ from seed to seed, have exact depth, and look the same to all sensors.

use deepfusion_sim::{ObjectClass, Scene, SimConfig, Simulation, Variety};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn drive(scene: Scene, seed: u64) -> Simulation {
    let variety = Variety::draw(&mut ChaCha8Rng::seed_from_u64(seed));
    let config = SimConfig {
        seed,
        frames: 12,
        width: 320,
        height: 96,
        moving_cars: 4,
        scene,
        ..SimConfig::default()
    };
    Simulation::varied(&config, &variety).expect("a valid configuration")
}

#[test]
fn one_seed_gives_one_world_and_another_a_different_one() {
    for scene in [Scene::Urban, Scene::Motorway, Scene::Country, Scene::Indoor] {
        let (a, b, c) = (drive(scene, 3), drive(scene, 3), drive(scene, 4));
        let (x, y, z) = (a.frame(6), b.frame(6), c.frame(6));
        assert_eq!(x.rgb.as_raw(), y.rgb.as_raw());
        assert_eq!(x.depth, y.depth);
        assert_eq!(a.objects(6), b.objects(6));
        let differing = x
            .rgb
            .as_raw()
            .iter()
            .zip(z.rgb.as_raw())
            .filter(|(p, q)| p.abs_diff(**q) > 10)
            .count();
        assert!(differing > x.rgb.as_raw().len() / 3, "{}", scene.name());
    }
}

/// Every pixel has a finite depth or is sky; worlds are neither empty nor blocked in front of the camera.
#[test]
fn depths_are_finite_and_vary() {
    for scene in Scene::EVERY {
        for seed in 1..4 {
            let frame = drive(scene, seed).frame(5);
            let depth = &frame.depth.data;
            assert!(
                depth
                    .iter()
                    .all(|d| d.is_finite() && (*d == 0.0 || *d > 0.15))
            );
            let mut known: Vec<f32> = depth.iter().copied().filter(|d| *d > 0.0).collect();
            let share = known.len() as f64 / depth.len() as f64;
            assert!(share > 0.3, "{} {seed}: {share}", scene.name());
            known.sort_by(f32::total_cmp);
            let (near, far) = (known[known.len() / 20], known[known.len() * 19 / 20]);
            assert!(far > 1.5 * near, "{} {seed}: {near} to {far}", scene.name());
        }
    }
}

/// The camera's depth and the scanner's ranges agree, also on leaves and hills.
#[test]
fn the_scan_agrees_with_the_depth() {
    for (scene, seed) in [
        (Scene::Urban, 1),
        (Scene::Country, 2),
        (Scene::Motorway, 3),
        (Scene::Indoor, 2),
    ] {
        let simulation = drive(scene, seed);
        let k = simulation.intrinsics();
        let cam_from_velo = simulation.rig().cam_from_velo();
        let frame = simulation.frame(4);
        let (mut agree, mut all) = (0, 0);
        for point in &simulation.velodyne(4).xyz {
            let p = cam_from_velo.transform(&Vector3::from(point.map(f64::from)));
            let Some(pixel) = k.project(&p) else { continue };
            let (u, v) = (pixel.x.round(), pixel.y.round());
            if u < 0.0 || v < 0.0 || p.z < 1.0 {
                continue;
            }
            if let Some(depth) = frame.depth.get(u as usize, v as usize) {
                all += 1;
                agree += usize::from((f64::from(depth) - p.z).abs() < 0.15 + 0.04 * p.z);
            }
        }
        let share = f64::from(agree as u32) / f64::from(all);
        println!("{}: {share:.3} of {all}", scene.name());
        // Crowns and railings are full of edges, and the two sensors are 0.3 m apart.
        assert!(all > 2000 && share > 0.75, "{}: {share}", scene.name());
    }
}

/// Streets have enough cars, people, trees, bicycles and houses.
#[test]
fn streets_are_crowded() {
    let mut counts = [0usize; 5];
    for seed in 1..6 {
        for object in drive(Scene::Urban, seed).objects(0) {
            let number = match object.class {
                ObjectClass::Car => 0,
                ObjectClass::Pedestrian => 1,
                ObjectClass::Tree => 2,
                ObjectClass::Bicycle => 3,
                ObjectClass::Building => 4,
                _ => continue,
            };
            counts[number] += 1;
            assert!(object.size.iter().all(|x| *x > 0.0 && x.is_finite()));
        }
    }
    assert!(
        counts
            .iter()
            .zip([250, 60, 300, 20, 150])
            .all(|(n, least)| *n > least),
        "{counts:?}"
    );
}
