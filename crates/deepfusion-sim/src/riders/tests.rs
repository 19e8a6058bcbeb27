use super::*;
use crate::config::Scene;
use crate::motion::Drive;
use crate::scene::ObjectClass;
use crate::traffic::Traffic;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const DURATION_S: f64 = 10.0;

/// A street, and the people of a drive along it.
fn street(seed: u64) -> (World, Riders) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let road = Road::generate(&mut rng, -60.0, 400.0);
    let drive = Drive::simulate(&mut rng, &road, DURATION_S, 1.0);
    let mut world = World::furnish(road, seed, Scene::Urban);
    let models = world.people();
    let traffic = Traffic::new(&mut rng, &world, &drive, DURATION_S, 3);
    let driven = (&drive, DURATION_S);
    let riders = Riders::along(&mut rng, &world, &models, driven, &traffic, 12);
    (world, riders)
}

#[test]
fn a_route_has_constant_speed() {
    let route = Route {
        s: 20.0,
        lateral: -6.0,
        rate: -1.25,
        crossing: Some(Crossing {
            begins_s: 4.0,
            lasts_s: 8.8,
            to: 5.0,
        }),
    };
    let moved = |from: f64, to: f64| {
        let ((s, lateral), (next_s, next_lateral)) = (route.at(from), route.at(to));
        (next_s - s).hypot(next_lateral - lateral) / (to - from)
    };
    for (from, to) in [
        (-3.0, 2.0),
        (2.0, 4.0),
        (4.0, 5.0),
        (5.0, 12.8),
        (12.8, 20.0),
    ] {
        assert!((moved(from, to) - 1.25).abs() < 1e-12, "{from} {to}");
    }
    assert_eq!(route.at(0.0), (20.0, -6.0));
    assert_eq!(route.at(4.0), (15.0, -6.0));
    assert!((route.at(12.8).0 - 15.0).abs() < 1e-12 && (route.at(12.8).1 - 5.0).abs() < 1e-12);
    assert!(route.crosses_at(8.0) && !route.crosses_at(3.9) && !route.crosses_at(12.9));
}

/// Wheels and feet are on the ground, on the road or on the pavement, and everyone faces the way they move.
#[test]
fn people_stand_on_the_ground_and_face_forward() {
    let (mut riding, mut walking, mut crossing) = (0, 0, 0);
    for seed in 1..4 {
        let (world, riders) = street(seed);
        let road = &world.road;
        for person in &riders.people {
            let rides = person.model.class == ObjectClass::Cyclist;
            riding += usize::from(rides);
            walking += usize::from(!rides && person.route.crossing.is_none());
            crossing += usize::from(person.route.crossing.is_some());
            for step in 0..=50 {
                let time_s = 0.2 * f64::from(step);
                if !person.is_there(time_s) {
                    continue;
                }
                let stance = person.stance(road, time_s);
                let [x, y, z] = stance.base;
                let kerb = f64::from(road.kerb);
                let beyond = road.kerb_distance(&road.locate(x, y));
                if rides {
                    assert!(z == 0.0 && beyond < -0.3, "seed {seed}: {z} {beyond}");
                } else if beyond > 0.0 {
                    assert_eq!(z, kerb);
                } else {
                    assert!((0.0..=kerb).contains(&z), "{z}");
                }
                let solids = person.model.solids(stance.base, stance.heading, 1, true);
                let lowest = solids
                    .iter()
                    .map(|solid| solid.position[2] + f64::from(solid.bounds(&world.hulls).2) - z)
                    .fold(f64::MAX, f64::min);
                assert!((-0.03..0.05).contains(&lowest), "seed {seed}: {lowest}");
                let velocity = person.velocity(road, time_s).xy();
                let forward = stance.heading.cos() * velocity.x + stance.heading.sin() * velocity.y;
                // Half of a turn at a corner happens before it, half after. In a bend a step along the street differs in length from one
                // across it.
                assert!(
                    forward > 0.45 * velocity.norm(),
                    "seed {seed} {time_s}: {person:?}"
                );
            }
        }
    }
    println!("{riding} ride, {walking} walk, {crossing} cross");
    assert!(riding > 2 && walking + crossing > 2);
}

/// Nobody runs into anybody from one moment to the next.
#[test]
fn people_keep_apart() {
    for seed in 1..4 {
        let (world, riders) = street(seed);
        for step in 0..=50 {
            let objects = riders.objects(&world, 0.2 * f64::from(step), 0);
            for (i, a) in objects.iter().enumerate() {
                for b in &objects[i + 1..] {
                    let apart =
                        a.world_from_object.translation() - b.world_from_object.translation();
                    assert!(apart.xy().norm() > 0.5, "seed {seed}: {a:?} {b:?}");
                }
            }
        }
    }
}

/// A LiDAR sees the same people a moment later, even at the instant in which somebody appears or disappears.
#[test]
fn people_keep_moving_when_another_leaves() {
    let (world, riders) = street(1);
    let ends: Vec<f64> = (riders.people.iter())
        .flat_map(|person| [person.during.0, person.during.1])
        .filter(|time_s| time_s.is_finite())
        .collect();
    assert!(!ends.is_empty(), "somebody should appear or disappear");
    for now_s in ends {
        let now = riders.solids(&world, now_s, now_s);
        let later = riders.solids(&world, now_s + 1e-3, now_s);
        assert!(!now.is_empty() && now.len() == later.len(), "{now_s}");
        for (a, b) in now.iter().zip(&later) {
            let moved = (Vector3::from(b.position) - Vector3::from(a.position)).norm();
            // Up to the fastest rider, and parts that turn about the middle of a body.
            assert!(moved < 0.02, "{now_s}: {moved}");
        }
        let moves = |(a, b): (&Primitive, &Primitive)| a.position != b.position;
        assert!(now.iter().zip(&later).any(moves), "{now_s}");
    }
}
