//! The guarantees of the endless mode: a view depends on the settings and its index alone, and its depth is exact, whatever weather and
//! camera do to its colours.

use deepfusion_geometry::Intrinsics;
use deepfusion_sim::{Endless, EndlessConfig, Ingredient, MountedCamera, Scene, View, Weather};
use nalgebra::Vector3;
use std::collections::HashSet;

fn small() -> EndlessConfig {
    EndlessConfig {
        width: 160,
        height: 48,
        ..EndlessConfig::default()
    }
}

fn endless(config: EndlessConfig) -> Endless {
    Endless::new(config).expect("a valid configuration")
}

fn assert_same(a: &View, b: &View) {
    assert_eq!(a.rgb.as_raw(), b.rgb.as_raw());
    assert_eq!(a.depth, b.depth);
    assert_eq!(a.intrinsics, b.intrinsics);
    assert_eq!(a.moving, b.moving);
    assert_eq!(a.world_from_cam, b.world_from_cam);
}

#[test]
fn a_view_is_the_same_in_any_order_and_from_any_thread() {
    let config = EndlessConfig {
        worlds_at_once: 4,
        views_per_world: 3,
        ..small()
    };
    let numbers: Vec<u64> = (0..20).chain([1_000_003, 7]).collect();
    let stream = endless(config.clone());
    let expected: Vec<View> = numbers.iter().map(|i| stream.view(*i)).collect();
    // Backwards, from an instance whose cache is too small to help.
    let other = endless(config);
    for (number, view) in numbers.iter().zip(&expected).rev() {
        assert_same(&other.view(*number), view);
    }
    // From four threads at once, each in its own order.
    let third = endless(other.config().clone());
    std::thread::scope(|scope| {
        for offset in 0..4 {
            let (third, numbers, expected) = (&third, &numbers, &expected);
            scope.spawn(move || {
                for i in 0..numbers.len() {
                    let i = (i * 7 + offset * 5) % numbers.len();
                    assert_same(&third.view(numbers[i]), &expected[i]);
                }
            });
        }
    });
}

#[test]
fn the_seed_and_the_index_change_the_view() {
    let (a, b) = (
        endless(small()),
        endless(EndlessConfig { seed: 2, ..small() }),
    );
    assert_ne!(a.view(3).rgb.as_raw(), a.view(4).rgb.as_raw());
    assert_ne!(a.view(3).depth, b.view(3).depth);
}

/// Views of plain worlds are as in `simulate`; the others are the same as without plain worlds.
#[test]
fn plain_worlds_are_mixed_with_varied_ones() {
    let few = |plain| {
        endless(EndlessConfig {
            worlds_at_once: 8,
            views_per_world: 1,
            plain,
            ..small()
        })
    };
    // A share of exactly 1 would draw no random number, which would change the scenes.
    let (without, half, only) = (few(0.0), few(0.5), few(1.0 - 1e-9));
    let mut kept = 0;
    for index in 0..24 {
        let (varied, view) = (without.view(index), half.view(index));
        if view.rgb == varied.rgb {
            assert_same(&view, &varied);
            kept += 1;
        } else {
            assert_same(&view, &only.view(index));
            assert!(Scene::ALL.contains(&view.scene) && !view.grey);
            assert!(!matches!(view.weather, Weather::Fog | Weather::Overcast));
        }
    }
    assert!((6..=18).contains(&kept), "{kept} of 24 views are varied");
}

/// The world does not depend on the size of the camera's image.
#[test]
fn a_view_comes_in_any_size() {
    let stream = endless(small());
    assert_same(&stream.view(5), &stream.view_sized(5, (160, 48)));
    let tall = stream.view_sized(5, (96, 80));
    assert_eq!(tall.rgb.dimensions(), (96, 80));
    assert_eq!((tall.depth.width, tall.intrinsics.height), (96, 80));
    assert_eq!(tall.world, stream.view(5).world);
}

#[test]
fn eight_neighbours_show_eight_worlds() {
    let stream = endless(EndlessConfig {
        worlds_at_once: 8,
        views_per_world: 4,
        ..small()
    });
    let worlds: Vec<u64> = (0..40).map(|i| stream.view(i).world).collect();
    for window in worlds.windows(8) {
        assert_eq!(window.iter().collect::<HashSet<_>>().len(), 8);
    }
}

/// No point lies below the ground or beyond it, and every ray that goes down ends at the ground.
#[test]
fn no_depth_is_beyond_the_ground() {
    let stream = endless(small());
    let (mut on_ground, mut level, mut all) = (0usize, 0usize, 0usize);
    for index in 0..96 {
        let view = stream.view(index);
        let eye = view.world_from_cam.translation();
        assert!(view.depth.data.iter().all(|d| d.is_finite() && *d >= 0.0));
        for (i, depth) in view.depth.data.iter().enumerate() {
            let (u, v) = ((i % 160) as f64, (i / 160) as f64);
            let ray = view
                .world_from_cam
                .rotate(&view.intrinsics.back_project(u, v, 1.0));
            let depth = f64::from(*depth);
            let point = eye + ray * depth;
            all += 1;
            if ray.z < -0.01 {
                level += 1;
                // Depth of the road's plane and of the nearer plane of the pavements.
                let (road, pavement) = (-eye.z / ray.z, (0.13 - eye.z) / ray.z);
                let tolerance = 1e-4 * road + 1e-3;
                assert!(
                    depth > 0.0 && depth < road + tolerance,
                    "view {index}: {depth} beyond {road}"
                );
                on_ground += usize::from(
                    (depth - road).abs() < tolerance || (depth - pavement).abs() < tolerance,
                );
            }
            if depth > 0.0 {
                assert!(
                    point.z > -0.01 - 1e-4 * depth,
                    "view {index}: {point} is below the ground"
                );
            }
        }
    }
    println!("{on_ground} of {level} descending rays of {all} end on the ground");
    assert!(on_ground * 3 > level, "{on_ground} of {level}");
}

/// A point seen in one view is not seen through in another view of the same world.
#[test]
fn two_views_of_a_world_agree() {
    let stream = endless(EndlessConfig {
        worlds_at_once: 1,
        views_per_world: 12,
        ..small()
    });
    let (mut agree, mut contradict, mut pairs) = (0usize, 0usize, 0usize);
    for world in 0..4 {
        let views: Vec<View> = (0..12).map(|i| stream.view(world * 12 + i)).collect();
        for a in &views {
            for b in &views {
                if std::ptr::eq(a, b) {
                    continue;
                }
                assert_eq!(a.world, b.world);
                let (same, through) = compare(a, b);
                pairs += usize::from(same > 100);
                agree += same;
                contradict += through;
            }
        }
    }
    println!("{pairs} pairs overlap, {agree} pixels agree, {contradict} contradict");
    assert!(pairs > 20 && agree > 50_000, "{pairs} {agree}");
    assert!(contradict * 100 < agree, "{contradict} of {agree}");
}

/// Number of pixels of `a` that `b` sees at the same depth, and of those that `b` sees through. Pixels hidden from `b` count as neither.
fn compare(a: &View, b: &View) -> (usize, usize) {
    let b_from_a = b.world_from_cam.inverse() * a.world_from_cam;
    let (w, h) = (a.depth.width as i64, a.depth.height as i64);
    let (mut same, mut through) = (0, 0);
    for (i, depth) in a.depth.data.iter().enumerate() {
        // The traffic differs between views.
        if *depth <= 0.0 || *depth > 60.0 || a.moving[i] {
            continue;
        }
        let (u, v) = (i as i64 % w, i as i64 / w);
        let point: Vector3<f64> = b_from_a.transform(&a.intrinsics.back_project(
            u as f64,
            v as f64,
            f64::from(*depth),
        ));
        let Some(pixel) = b.intrinsics.project(&point) else {
            continue;
        };
        let (x, y) = (pixel.x.round() as i64, pixel.y.round() as i64);
        if point.z < 0.3 || x < 2 || y < 2 || x >= w - 2 || y >= h - 2 {
            continue;
        }
        // Thin and slanted objects may cover other pixels of the other view, so the nearest and the farthest depth around the pixel count.
        let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
        let depths = around.map(|(x, y)| f64::from(b.depth.data[(y * w + x) as usize]));
        let (mut nearest, mut farthest) = (f64::INFINITY, 0.0f64);
        for d in depths {
            let d = if d > 0.0 { d } else { f64::INFINITY };
            (nearest, farthest) = (nearest.min(d), farthest.max(d));
        }
        if point.z < 0.95 * nearest - 0.1 {
            through += 1;
        } else if point.z < 1.05 * farthest + 0.1 {
            same += 1;
        }
    }
    (same, through)
}

#[test]
fn weather_and_camera_never_touch_the_depth() {
    let formed = endless(small());
    let plain = endless(EndlessConfig {
        formation: false,
        ..small()
    });
    let mut foggy = 0;
    for index in 0..48 {
        let (a, b) = (formed.view(index), plain.view(index));
        assert_eq!(a.depth, b.depth);
        assert_eq!(a.moving, b.moving);
        assert_ne!(a.rgb.as_raw(), b.rgb.as_raw());
        foggy += usize::from(a.weather == deepfusion_sim::Weather::Fog);
    }
    println!("{foggy} of 48 views in fog");
}

#[test]
fn views_vary_and_no_camera_touches_an_object() {
    let stream = endless(small());
    let (mut scenes, mut weathers) = (HashSet::new(), HashSet::new());
    let (mut grey, mut moving) = (0, 0);
    for index in 0..240 {
        let view = stream.view(index);
        let field = 2.0 * (80.0 / view.intrinsics.fx).atan().to_degrees();
        assert!((34.9..110.1).contains(&field), "{field}");
        // The strongest squeeze is from 5:4 to 10:3.
        let ratio = view.intrinsics.fy / view.intrinsics.fx;
        assert!((0.36..=1.0301).contains(&ratio), "{ratio}");
        assert_eq!(view.intrinsics.implausible(), None);
        assert!((0.3..=2.5).contains(&view.height_m), "{}", view.height_m);
        let mut known: Vec<f32> = view
            .depth
            .data
            .iter()
            .copied()
            .filter(|d| *d > 0.0)
            .collect();
        known.sort_by(f32::total_cmp);
        assert!(
            known[0] > 0.15,
            "view {index} touches an object: {}",
            known[0]
        );
        let far = known[known.len() * 9 / 10];
        let least = if view.scene.name() == "indoor" {
            0.5
        } else {
            1.5
        };
        assert!(far > least, "view {index} faces a wall at {far} m");
        scenes.insert(view.scene.name());
        weathers.insert(format!("{:?}", view.weather));
        grey += usize::from(view.grey);
        moving += usize::from(view.moving.contains(&true));
    }
    assert_eq!(scenes.len(), 8, "{scenes:?}");
    assert_eq!(weathers.len(), 6, "{weathers:?}");
    assert!((15..65).contains(&grey), "{grey}");
    assert!(moving > 40, "{moving}");
}

#[test]
fn a_bad_setting_is_named() {
    let error = Endless::new(EndlessConfig {
        height: 3,
        ..small()
    })
    .err();
    let error = error.expect("three rows should be too few").to_string();
    assert!(error.contains("`height`") && error.contains('3'), "{error}");
}

/// The first views of a stream without these ingredients.
fn views_without(ingredients: &[Ingredient]) -> Vec<View> {
    let stream = endless(EndlessConfig {
        formation: false,
        worlds_at_once: 12,
        without: ingredients.to_vec(),
        ..small()
    });
    (0..24).map(|i| stream.view(i)).collect()
}

/// Share of pairs for which `same` is true.
fn share(pairs: &[(&View, View)], same: impl Fn(&View, &View) -> bool) -> f64 {
    let count = pairs.iter().filter(|(a, b)| same(a, b)).count();
    count as f64 / pairs.len() as f64
}

/// Leaving out one ingredient does not change the others.
#[test]
fn leaving_out_an_ingredient_keeps_the_others() {
    let heading = |view: &View| {
        let ahead = view.world_from_cam.rotate(&Vector3::z());
        ahead.y.atan2(ahead.x)
    };
    let place = |view: &View| view.world_from_cam.translation().xy();
    let pitch = |view: &View| view.world_from_cam.rotate(&Vector3::z()).z;
    let lens = |view: &View| view.intrinsics;
    let with = views_without(&[]);
    let without = |one: Ingredient| -> Vec<(&View, View)> {
        with.iter().zip(views_without(&[one])).collect()
    };
    // Whether a place is free depends on height, tilt and lens, so some cameras are elsewhere.
    let mostly = 0.7;

    let pairs = without(Ingredient::CameraHeight);
    assert!(pairs.iter().all(|(_, b)| b.height_m == 1.65));
    assert!(share(&pairs, |a, b| place(a) == place(b)) > mostly);
    assert_eq!(share(&pairs, |a, b| lens(a) == lens(b)), 1.0);

    let pairs = without(Ingredient::CameraTilt);
    assert!(pairs.iter().all(|(_, b)| pitch(b).abs() < 1e-12));
    assert!(share(&pairs, |a, b| (heading(a) - heading(b)).abs() < 1e-9) > mostly);
    assert_eq!(share(&pairs, |a, b| a.height_m == b.height_m), 1.0);

    let pairs = without(Ingredient::Lenses);
    let field = |k: Intrinsics| 2.0 * (80.0 / k.fx).atan().to_degrees();
    assert!(
        pairs
            .iter()
            .all(|(_, b)| (field(lens(b)) - 81.4).abs() < 0.1)
    );
    assert!(share(&pairs, |a, b| place(a) == place(b)) > mostly);
    let squeezed = |view: &View| (lens(view).fy / lens(view).fx - 1.0).abs() > 0.031;
    assert!(share(&pairs, |_, b| squeezed(b)) > 0.3);

    let pairs = without(Ingredient::Squeeze);
    assert!(!pairs.iter().any(|(_, b)| squeezed(b)));
    assert_eq!(share(&pairs, |a, b| lens(a).fx == lens(b).fx), 1.0);

    let pairs = without(Ingredient::Weather);
    assert_eq!(share(&pairs, |a, b| a.depth == b.depth), 1.0);
    assert_eq!(share(&pairs, |a, b| a.rgb == b.rgb), 0.0);
    assert!(
        !pairs
            .iter()
            .any(|(_, b)| matches!(b.weather, Weather::Fog | Weather::Overcast))
    );

    let pairs = without(Ingredient::Variety);
    assert!(pairs.iter().all(|(_, b)| Scene::ALL.contains(&b.scene)));
    // Other lanes have other traffic, so the draws after it also differ.
    assert!(share(&pairs, |a, b| lens(a).cy == lens(b).cy) > 0.5);
    assert!(share(&pairs, |a, b| a.depth == b.depth) < 0.5);

    let pairs = without(Ingredient::Traffic);
    assert!(!pairs.iter().any(|(_, b)| b.moving.contains(&true)));
    let pose = |view: &View| view.world_from_cam;
    assert_eq!(share(&pairs, |a, b| pose(a) == pose(b)), 1.0);
    // Views without dynamic objects do not change.
    let still = |view: &View| !view.moving.contains(&true);
    assert_eq!(share(&pairs, |a, b| still(a) && a.depth != b.depth), 0.0);
}

/// Only the requested share of views has hills, and the other views do not change.
#[test]
fn a_share_of_the_views_in_the_open_has_hills() {
    let stream = |hills| {
        endless(EndlessConfig {
            width: 64,
            height: 48,
            worlds_at_once: 8,
            plain: 0.2,
            hills,
            ..small()
        })
    };
    let (flat, some, all) = (stream(0.0), stream(0.4), stream(1.0));
    let (mut open, mut hilly) = (0, 0);
    for index in 0..96 {
        let (a, b, c) = (flat.view(index), some.view(index), all.view(index));
        assert!(!a.hills);
        assert_same(if b.hills { &c } else { &a }, &b);
        if b.hills {
            assert_ne!(a.depth, b.depth);
            assert_eq!(a.world_from_cam, b.world_from_cam);
        }
        assert!(!c.hills || !matches!(c.scene, Scene::Garage | Scene::Indoor));
        open += usize::from(c.hills);
        hilly += usize::from(b.hills);
    }
    println!("{hilly} of {open} views in the open have hills");
    assert!(open > 40, "{open}");
    assert!((0.25..0.55).contains(&(f64::from(hilly as u32) / f64::from(open as u32))));
}

/// Only the requested share of views has people, and only the pixels that they cover change.
#[test]
fn a_share_of_the_views_has_people_who_ride_and_walk() {
    let stream = |riders| {
        endless(EndlessConfig {
            width: 64,
            height: 48,
            worlds_at_once: 8,
            plain: 0.2,
            riders,
            ..small()
        })
    };
    let (none, some, all) = (stream(0.0), stream(0.4), stream(1.0));
    let (mut with, mut half, mut seen) = (0, 0, 0);
    for index in 0..96 {
        let (a, b, c) = (none.view(index), some.view(index), all.view(index));
        assert_eq!(a.riders, 0);
        assert_same(if b.riders > 0 { &c } else { &a }, &b);
        assert_eq!(a.world_from_cam, c.world_from_cam);
        let mut hidden = 0;
        for (i, depth) in c.depth.data.iter().enumerate() {
            let behind = a.depth.data[i];
            if *depth == behind {
                assert_eq!(a.moving[i], c.moving[i]);
            } else {
                assert!(c.moving[i] && *depth > 0.0, "view {index}, pixel {i}");
                assert!(behind == 0.0 || *depth < behind, "{depth} before {behind}");
                hidden += 1;
            }
        }
        assert!(hidden == 0 || c.riders > 0);
        assert!(
            c.riders == 0 || !matches!(c.scene, Scene::Garage | Scene::Indoor | Scene::Motorway)
        );
        with += usize::from(c.riders > 0);
        half += usize::from(b.riders > 0);
        seen += usize::from(hidden > 2);
    }
    println!("{half} of {with} views have people; people are visible in {seen} of the {with}");
    assert!(with > 15 && seen > 4, "{with} {seen}");
    assert!((0.15..0.65).contains(&(half as f64 / with as f64)));
}

/// The cameras of two cars: every view is the whole image of one of them, from its height.
#[test]
fn known_cameras_take_all_views() {
    let kitti = MountedCamera::level(
        Intrinsics::from_numbers([721.5, 721.5, 609.6, 172.9], (1242, 375)),
        Some(1.65),
    );
    let lorry = MountedCamera {
        pitch_degrees: 5.0,
        ..MountedCamera::level(Intrinsics::centred(900.0, (1280, 720)), Some(2.3))
    };
    let stream = endless(EndlessConfig {
        daylight: 0.5,
        worlds_at_once: 8,
        cameras: vec![kitti, lorry],
        ..small()
    });
    let (mut of_kitti, mut below) = (0, 0);
    for index in 0..64 {
        let view = stream.view(index);
        assert_ne!(view.scene, Scene::Indoor, "cars do not drive through rooms");
        let camera = if view.height_m < 2.0 { &kitti } else { &lorry };
        of_kitti += usize::from(view.height_m < 2.0);
        assert_eq!(view.intrinsics, camera.intrinsics.resized(160, 48));
        let off = view.height_m / camera.height_m.expect("given") - 1.0;
        assert!(off.abs() < 0.031, "{off}");
        let ahead = view.world_from_cam.rotate(&Vector3::z());
        let pitch = (-ahead.z).asin().to_degrees() - camera.pitch_degrees;
        assert!(pitch.abs() < 2.1, "{pitch}");
        // The pixel at the bottom of the picture shows the road or an object on it.
        let at = 47 * 160 + 80;
        let metres = f64::from(view.depth.data[at]);
        if metres > 0.0 {
            let point = view.intrinsics.back_project(80.0, 47.0, metres);
            let world = view.world_from_cam.transform(&point);
            assert!(world.z > -0.02 && world.z < 2.5, "{}", world.z);
            below += usize::from(world.z < 0.2);
        }
    }
    assert!((20..=44).contains(&of_kitti), "{of_kitti}");
    assert!(below > 40, "{below}");
}
