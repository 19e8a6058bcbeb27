//! A simulated drive with exact depth, poses and boxes.

pub(crate) mod blocks;

use deepfusion_perception::{
    Label, Perception, PerceptionConfig, Scorer, ScoringRules, Stamp, TargetScore,
};
use deepfusion_sim::{ObjectClass, SceneObject, SimConfig, SimFrame, Simulation};
use nalgebra::Vector3;

/// Smallest number of visible pixels of a target at 640×192.
const VISIBLE: usize = 50;

/// The boxes of a frame as its camera sees them; cars count if enough of them is visible.
pub(crate) fn labels(simulation: &Simulation, number: usize, frame: &SimFrame) -> Vec<Label> {
    let cam_from_world = frame.world_from_cam.inverse();
    let k = simulation.intrinsics();
    let label = |object: SceneObject| {
        let cam_from_object = cam_from_world * object.world_from_object;
        let place = cam_from_object.translation();
        if place.z < -5.0 || place.norm() > 70.0 {
            return None;
        }
        let object_from_cam = cam_from_object.inverse();
        let half = object.size.map(|s| 0.5 * s);
        let inside = |u: usize, v: usize| {
            let Some(depth) = frame.depth.get(u, v) else {
                return false;
            };
            if (f64::from(depth) - place.z).abs() > half[0] + half[1] {
                return false;
            }
            let p =
                object_from_cam.transform(&k.back_project(u as f64, v as f64, f64::from(depth)));
            p.x.abs() <= half[0] + 0.05
                && p.y.abs() <= half[1] + 0.05
                && p.z > 0.02 - half[2]
                && p.z <= half[2] + 0.05
        };
        let car = object.class == ObjectClass::Car;
        let pixels =
            (0..frame.depth.height).flat_map(|v| (0..frame.depth.width).map(move |u| (u, v)));
        let visible =
            car && pixels.filter(|(u, v)| inside(*u, *v)).take(VISIBLE).count() == VISIBLE;
        let along = cam_from_object.rotate(&Vector3::x());
        Some(Label {
            object: object.id,
            center_m: place.into(),
            size_m: object.size,
            yaw_rad: (-along.z).atan2(along.x),
            velocity_mps: Some(cam_from_world.rotate(&object.velocity).into()),
            counts: visible,
        })
    };
    simulation
        .objects(number)
        .into_iter()
        .filter_map(label)
        .collect()
}

/// Perceives whole drives from exact depth and scores them.
pub(crate) fn score(drives: &[SimConfig]) -> TargetScore {
    let mut scorer = Scorer::new(ScoringRules::default());
    for config in drives {
        let simulation = Simulation::new(config).unwrap();
        let mut perception = Perception::new(PerceptionConfig {
            parking_rows: true,
            ..PerceptionConfig::default()
        });
        let first_from_world = simulation.world_from_cam(0).inverse();
        scorer.begin_drive();
        for number in 0..simulation.frames() {
            let frame = simulation.frame(number);
            let stamp = Stamp {
                time_s: frame.time_s,
                world_from_cam: first_from_world * frame.world_from_cam,
            };
            let seen = perception
                .detect(&frame.depth, &simulation.intrinsics(), Some(stamp))
                .unwrap();
            scorer.add(
                frame.time_s,
                &seen.targets,
                &labels(&simulation, number, &frame),
            );
        }
    }
    scorer.score()
}
