//! Masks of a segmentation model, fused with depth: touching objects are separated and keep their classes.

use crate::common::blocks::{CARS, SIZE, camera, scene};
use deepfusion_geometry::Se3;
use deepfusion_hint::Hint;
use deepfusion_perception::{Error, Instance, Perception, PerceptionConfig, Run, Stamp, Target};

/// The pixels that show a block, as in a model's mask.
fn mask(of: &[Option<usize>], block: usize, class: &str) -> Instance {
    let mut runs: Vec<Run> = Vec::new();
    for (i, seen) in of.iter().enumerate() {
        let (v, u) = ((i / SIZE.0) as u32, (i % SIZE.0) as u32);
        if *seen != Some(block) {
            continue;
        }
        match runs.last_mut() {
            Some(run) if run.v == v && run.to == u => run.to = u + 1,
            _ => runs.push(Run {
                v,
                from: u,
                to: u + 1,
            }),
        }
    }
    Instance {
        class: class.into(),
        score: 0.8,
        runs,
        drawn: true,
    }
}

fn near(targets: &[Target], x: f64) -> Option<&Target> {
    targets.iter().find(|t| (t.center_m[0] - x).abs() < 0.3)
}

#[test]
fn touching_objects_are_separated_by_their_masks() {
    let (depth, seen) = scene(&CARS);
    let mut perception = Perception::new(PerceptionConfig::default());
    let masks = [mask(&seen, 0, "car"), mask(&seen, 1, "van")];
    let found = perception
        .detect_with_instances(&depth, &camera(), None, &masks)
        .unwrap()
        .targets;
    assert_eq!(found.len(), 2, "{found:#?}");
    for (x, class) in [(-1.7, "car"), (0.1, "van")] {
        let target = near(&found, x).unwrap();
        assert_eq!(target.class.as_deref(), Some(class));
        assert!((target.size_m[1] - 1.8).abs() < 0.15, "{target:?}");
        assert!(target.confidence > 0.8);
    }
    // With one mask only, the other object is still found by its depth, without a class.
    let found = perception
        .detect_with_instances(&depth, &camera(), None, &masks[..1])
        .unwrap()
        .targets;
    assert_eq!(found.len(), 2);
    assert_eq!(near(&found, 0.1).unwrap().class, None);
    assert_eq!(near(&found, -1.7).unwrap().class.as_deref(), Some("car"));
    // A mask on the road does not make a target.
    let mut road = mask(&seen, 0, "car");
    road.runs = (170..190)
        .map(|v| Run {
            v,
            from: 100,
            to: 500,
        })
        .collect();
    let found = perception
        .detect_with_instances(&depth, &camera(), None, &[road])
        .unwrap()
        .targets;
    assert!(found.iter().all(|t| t.class.is_none()), "{found:?}");
}

#[test]
fn a_track_keeps_the_class_it_was_seen_as_most() {
    let (depth, seen) = scene(&CARS[..1]);
    let mut perception = Perception::new(PerceptionConfig::default());
    let classes = [
        Some("car"),
        Some("car"),
        None,
        Some("van"),
        Some("car"),
        None,
    ];
    let mut last = Vec::new();
    for (i, class) in classes.into_iter().enumerate() {
        let stamp = Stamp {
            time_s: 0.1 * i as f64,
            world_from_cam: Se3::identity(),
        };
        let masks: Vec<Instance> = class
            .map(|class| mask(&seen, 0, class))
            .into_iter()
            .collect();
        let found = perception
            .detect_with_instances(&depth, &camera(), Some(stamp), &masks)
            .unwrap();
        last = found.targets;
    }
    assert_eq!(last.len(), 1);
    assert_eq!(last[0].class.as_deref(), Some("car"));
}

#[test]
fn masks_of_another_size_are_refused() {
    let (depth, seen) = scene(&CARS);
    let mut wrong = mask(&seen, 0, "car");
    wrong.runs.push(Run {
        v: 192,
        from: 0,
        to: 3,
    });
    let mut perception = Perception::new(PerceptionConfig::default());
    let error = perception
        .detect_with_instances(&depth, &camera(), None, &[wrong])
        .unwrap_err();
    assert!(
        matches!(error, Error::Instance { .. }) && error.hint().is_some(),
        "{error}"
    );
}
