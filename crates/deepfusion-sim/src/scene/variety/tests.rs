use super::site::{Spot, boxed};
use super::sweep::{ROAD, ROOMS};
use super::*;
use crate::primitive::{Primitive, Shape};
use crate::render::{BEHIND, LARGEST_M, gather};
use crate::road::Road;
use nalgebra::Vector3;

fn world(scene: Scene, seed: u64) -> World {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let variety = Variety::draw(&mut rng);
    let road = Road::generate(&mut rng, -60.0, 200.0);
    World::furnish_varied(road, seed, scene, &variety)
}

/// Whether a point is in a solid; only cylinders and wheels are replaced by the box around them.
fn holds(world: &World, solid: &Primitive, point: &Vector3<f64>) -> bool {
    let p = solid.local_point(point);
    let (hx, hy, low, high) = solid.bounds(&world.hulls);
    let inside = p.x.abs() < hx && p.y.abs() < hy && p.z > low && p.z < high;
    match solid.shape {
        Shape::Crown(crate::crown::Crown {
            radii: [a, b, c], ..
        })
        | Shape::Ellipsoid { radii: [a, b, c] } => {
            Vector3::new(p.x / a, p.y / b, p.z / c).norm() < 1.0
        }
        Shape::Hull(index) => {
            inside
                && world.hulls[index as usize]
                    .planes
                    .iter()
                    .all(|(n, d)| n.dot(&p) < *d)
        }
        Shape::Capsule { half_axis, radius } => {
            let half = crate::primitive::V3::from(half_axis);
            let along = (half.dot(&p) / half.norm_squared()).clamp(-1.0, 1.0);
            (p - half * along).norm() < radius
        }
        _ => inside,
    }
}

/// A car's width around the middle of the camera's lane is free of solids, up to the headroom; in rooms a person's width.
#[test]
fn the_camera_s_lane_is_free() {
    for scene in Scene::EVERY {
        for seed in 1..4 {
            let world = world(scene, seed);
            assert!(world.primitives.len() > 300, "{}", world.primitives.len());
            let (half, headroom) = if scene == Scene::Indoor {
                (0.5, ROOMS.headroom)
            } else {
                (0.85, ROAD.headroom)
            };
            for step in 0..360 {
                let s = -40.0 + 0.6 * f64::from(step);
                let near: Vec<&Primitive> = world
                    .primitives
                    .iter()
                    .zip(&world.along)
                    .filter(|(_, along)| (f64::from(**along) - s).abs() < 45.0)
                    .map(|(solid, _)| solid)
                    .collect();
                for aside in [-half, 0.0, half] {
                    let (x, y, _) = world.road.world(s, aside - 1.65);
                    for z in [0.2, 0.8, 1.4, headroom - 0.3] {
                        let point = Vector3::new(x, y, z);
                        let hit = near.iter().find(|solid| holds(&world, solid, &point));
                        assert!(
                            hit.is_none(),
                            "{} {seed} at {s}, {aside}, {z}: {hit:?}",
                            scene.name()
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn model_boxes_contain_their_solids() {
    let world = world(Scene::Urban, 5);
    assert!(world.models.len() > 40 && world.crowd.len() > 15);
    for model in world.models.iter().chain(&world.crowd) {
        let spot = Spot {
            x: 3.0,
            y: -2.0,
            z: 0.1,
            heading: 0.7,
        };
        let solids = model.solids([spot.x, spot.y, spot.z], spot.heading, 1, false);
        let (base, size) = boxed(&world, &spot, &solids).expect("a model should have solids");
        for (i, (length, least)) in model.size.iter().zip(size).enumerate() {
            // The box of a model is centred on its origin, so it may be larger than necessary.
            let off = (base[i] - [spot.x, spot.y, spot.z][i]).abs();
            assert!(
                f64::from(*length) > least - 0.03,
                "{:?} {i}: {length} {least}",
                model.class
            );
            assert!(off < 1.2, "{:?} {i}: {off}", model.class);
        }
    }
}

#[test]
fn object_boxes_contain_their_solids() {
    let mut world = world(Scene::Country, 2);
    let kit_world = &mut world;
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let variety = Variety::draw(&mut rng);
    let kit = Kit::new(kit_world, &mut rng, &variety);
    let mut site = Site {
        world: kit_world,
        rng: &mut rng,
        kit: &kit,
        variety: &variety,
    };
    for number in 0..60 {
        let spot = Spot {
            x: 40.0,
            y: 25.0,
            z: 0.0,
            heading: f64::from(number) * 0.4,
        };
        let (mark, listed) = (site.mark(), site.world.objects.len());
        match number % 6 {
            0 => site.tree(&spot, 9.0, 3.0, 2.0),
            1 => site.house(&spot, [9.0, 8.0], houses::Kind::Villa, true, false),
            2 => site.sign(&spot),
            3 => site.lamp(&spot),
            4 => site.enclosure(&spot, 5.0),
            _ => site.bush(&spot, 1.0),
        }
        assert_eq!(site.world.objects.len(), listed + 1);
        let object = site.world.objects[listed];
        let object_from_world = object.world_from_object.inverse();
        for solid in &site.world.primitives[mark..] {
            let p = object_from_world.transform(&Vector3::from(solid.position));
            for i in 0..3 {
                assert!(
                    p[i].abs() <= 0.5 * object.size[i] + 1e-6,
                    "{object:?} {solid:?}"
                );
            }
        }
    }
}

/// Hills are visible from everywhere, and no solid that is looked up by its position along the street is larger than the distance within
/// which it is looked up.
#[test]
fn large_solids_are_found_from_everywhere() {
    let mut hills = 0;
    for scene in Scene::EVERY {
        for seed in 1..5 {
            let world = world(scene, seed);
            hills += world.far.len();
            for s in [-50.0, 0.0, 120.0] {
                let (x, y, _) = world.road.world(s, -1.65);
                let seen = gather(&world, &[], &Vector3::new(x, y, 1.6), BEHIND);
                for far in &world.far {
                    assert!(seen.iter().any(|solid| solid.position == far.position));
                }
            }
            for solid in &world.primitives {
                let (hx, hy, ..) = solid.bounds(&world.hulls);
                assert!(hx.hypot(hy) < LARGEST_M, "{solid:?}");
            }
        }
    }
    assert!(hills > 10);
}

#[test]
fn without_variety_the_world_is_the_plain_one() {
    let none = Variety::none();
    assert!(!none.is_varied() && none == Variety::default());
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    assert!(Variety::draw(&mut rng).is_varied());
    let road = |seed| Road::generate(&mut ChaCha8Rng::seed_from_u64(seed), -60.0, 100.0);
    let plain = World::furnish(road(3), 3, Scene::Urban);
    let same = World::furnish_varied(road(3), 3, Scene::Urban, &none);
    assert_eq!(plain.primitives.len(), same.primitives.len());
    assert_eq!(plain.objects, same.objects);
    assert!(plain.far.is_empty() && plain.crowd.is_empty());
}

/// Traffic around a camera keeps its distance and does not overlap it.
#[test]
fn traffic_keeps_its_distance_from_the_camera() {
    let mut met = 0;
    for seed in 1..6 {
        for scene in [Scene::Urban, Scene::Motorway, Scene::Country] {
            let world = world(scene, seed);
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let traffic = crate::traffic::Traffic::around(&mut rng, &world, (30.0, 9.0, 6.0), 0.9);
            let (x, y, _) = world.road.world(30.0, -1.65);
            for object in traffic.objects(&world, 0.0) {
                met += 1;
                assert!(object.class.is_traffic());
                let p = object
                    .world_from_object
                    .inverse()
                    .transform(&Vector3::new(x, y, 1.0));
                let inside = (0..2).all(|i| p[i].abs() < 0.5 * object.size[i] + 0.3);
                assert!(!inside, "{} {seed}: {object:?}", scene.name());
            }
        }
    }
    assert!(met > 60, "{met}");
}
