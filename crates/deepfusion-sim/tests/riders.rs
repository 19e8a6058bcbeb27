//! People who ride and walk, where there is room for them. They appear in pictures, depth, masks and labels as moving cars do.

use deepfusion_sim::{ObjectClass, Scene, SceneObject, SimConfig, Simulation, Variety};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn config(seed: u64, riders: usize) -> SimConfig {
    SimConfig {
        seed,
        frames: 12,
        width: 320,
        height: 96,
        moving_cars: 2,
        riders,
        ..SimConfig::default()
    }
}

fn drive(config: &SimConfig) -> Simulation {
    Simulation::new(config).expect("a valid configuration")
}

fn is_person(object: &SceneObject) -> bool {
    let class = matches!(object.class, ObjectClass::Cyclist | ObjectClass::Pedestrian);
    class && object.velocity.norm() > 0.0
}

/// Whether a point is in an object's box, or within `margin` metres of it.
fn holds(object: &SceneObject, point: &Vector3<f64>, margin: f64) -> bool {
    let p = object.world_from_object.inverse().transform(point);
    (0..3).all(|i| p[i].abs() <= 0.5 * object.size[i] + margin)
}

/// People hide what is behind them, and nothing else changes. Each pixel that they cover shows a point in somebody's box.
#[test]
fn people_are_seen_where_their_labels_say() {
    let (mut riding, mut walking) = (0, 0);
    for seed in 1..5 {
        let (with, without) = (drive(&config(seed, 8)), drive(&config(seed, 0)));
        let k = with.intrinsics();
        for index in [0, 5, 11] {
            let (frame, empty) = (with.frame(index), without.frame(index));
            assert_eq!(frame.world_from_cam, empty.world_from_cam);
            let objects = with.objects(index);
            let people: Vec<&SceneObject> = objects.iter().filter(|o| is_person(o)).collect();
            for (i, depth) in frame.depth.data.iter().enumerate() {
                let behind = empty.depth.data[i];
                if *depth == behind {
                    assert_eq!(frame.moving[i], empty.moving[i]);
                    continue;
                }
                assert!(frame.moving[i] && *depth > 0.0, "seed {seed}, pixel {i}");
                assert!(behind == 0.0 || *depth < behind, "{depth} before {behind}");
                let (u, v) = ((i % 320) as f64, (i / 320) as f64);
                let point = k.back_project(u, v, f64::from(*depth));
                let point = frame.world_from_cam.transform(&point);
                let owner = people.iter().find(|person| holds(person, &point, 0.05));
                let owner = owner.unwrap_or_else(|| panic!("seed {seed}: nobody at {point}"));
                if owner.class == ObjectClass::Cyclist {
                    riding += 1;
                } else {
                    walking += 1;
                }
            }
        }
    }
    println!("{riding} pixels of people who ride, {walking} of people who walk");
    assert!(riding > 20 && walking > 20, "{riding} {walking}");
}

/// From frame to frame everyone moves by their velocity.
#[test]
fn people_move_by_their_velocity() {
    let (mut steps, mut riding) = (0, 0);
    for seed in 1..4 {
        let simulation = drive(&config(seed, 8));
        for index in 1..simulation.frames() {
            let seconds = simulation.time_s(index) - simulation.time_s(index - 1);
            let before = simulation.objects(index - 1);
            for b in simulation.objects(index).iter().filter(|o| is_person(o)) {
                let Some(a) = before.iter().find(|a| a.id == b.id) else {
                    continue;
                };
                assert_eq!(a.class, b.class);
                let rides = b.class == ObjectClass::Cyclist;
                let speed = b.velocity.xy().norm();
                // In a bend, speed differs between the outside and the middle of the street.
                let range = if rides { 2.3..8.7 } else { 0.5..2.3 };
                assert!(range.contains(&speed), "{speed} m/s: {b:?}");
                let turned = (b.velocity - a.velocity).xy().norm() > 0.15 * speed;
                if turned {
                    // A turn at a corner.
                    assert!(!rides);
                    continue;
                }
                let moved = b.world_from_object.translation() - a.world_from_object.translation();
                let expected = 0.5 * (a.velocity + b.velocity) * seconds;
                assert!((moved - expected).xy().norm() < 1e-3, "{moved} {expected}");
                steps += 1;
                riding += usize::from(rides);
            }
        }
    }
    println!("{steps} steps, {riding} of them ridden");
    assert!(steps > 80 && riding > 20, "{steps} {riding}");
}

/// In every world, nobody starts in a house or in a vehicle.
#[test]
fn nobody_is_in_a_house_or_in_a_car() {
    let mut met = 0;
    for scene in [Scene::Urban, Scene::Park, Scene::Commercial, Scene::Country] {
        for seed in 1..3 {
            let varied = Variety::draw(&mut ChaCha8Rng::seed_from_u64(seed));
            for variety in [Variety::none(), varied] {
                if scene == Scene::Country && !variety.is_varied() {
                    continue;
                }
                let config = SimConfig {
                    scene,
                    frames: 2,
                    ..config(seed, 8)
                };
                let simulation = Simulation::varied(&config, &variety).expect("valid");
                let objects = simulation.objects(0);
                for person in objects.iter().filter(|o| is_person(o)) {
                    met += 1;
                    let place = person.world_from_object.translation();
                    for object in &objects {
                        let is_solid = matches!(
                            object.class,
                            ObjectClass::Building
                                | ObjectClass::Car
                                | ObjectClass::Van
                                | ObjectClass::Truck
                                | ObjectClass::Tram
                        );
                        let inside = is_solid && holds(object, &place, 0.0);
                        assert!(!inside, "{} {seed}: {person:?} {object:?}", scene.name());
                    }
                }
            }
        }
    }
    println!("{met} people");
    assert!(met > 25, "{met}");
}

#[test]
fn riders_in_a_garage_are_rejected() {
    let config = SimConfig {
        scene: Scene::Garage,
        ..config(1, 3)
    };
    let error = Simulation::new(&config).err().expect("no street");
    assert!(error.to_string().contains("`riders` is 3"), "{error}");
}
