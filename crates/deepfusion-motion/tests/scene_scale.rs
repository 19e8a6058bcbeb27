//! The scale of a depth image from the scene's motion, on simulated streets with known depth.

use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use deepfusion_motion::{DepthImage, GreyImage, GreyPyramid, View, align, scene_points};
use deepfusion_sim::{SimConfig, Simulation};
use nalgebra::Vector3;

const SIZE: (u32, u32) = (640, 192);

struct Street {
    simulation: Simulation,
}

impl Street {
    fn new(seed: u64) -> Self {
        let simulation = Simulation::new(&SimConfig {
            seed,
            frames: 60,
            width: SIZE.0,
            height: SIZE.1,
            moving_cars: 3,
            ..SimConfig::default()
        });
        Self {
            simulation: simulation.unwrap(),
        }
    }

    fn frame(&self, number: usize) -> (GreyPyramid, DepthMap) {
        let frame = self.simulation.frame(number);
        let luma = |p: &image::Rgb<u8>| {
            0.299 * f32::from(p[0]) + 0.587 * f32::from(p[1]) + 0.114 * f32::from(p[2])
        };
        let grey = GreyImage {
            width: SIZE.0 as usize,
            height: SIZE.1 as usize,
            data: frame.rgb.pixels().map(luma).collect(),
        };
        (GreyPyramid::new(grey), frame.depth)
    }

    /// Maps a point of frame `target` to the camera of frame `source`.
    fn motion(&self, source: usize, target: usize) -> Se3 {
        let at = |frame| self.simulation.world_from_cam(frame);
        at(source).inverse() * at(target)
    }

    fn camera(&self) -> Intrinsics {
        self.simulation.intrinsics()
    }
}

fn scaled(depth: &DepthMap, factor: f32) -> DepthMap {
    DepthMap {
        data: depth.data.iter().map(|d| d * factor).collect(),
        ..*depth
    }
}

fn image<'a>(depth: &'a DepthMap, intrinsics: Intrinsics) -> DepthImage<'a> {
    DepthImage {
        width: depth.width,
        height: depth.height,
        data: &depth.data,
        intrinsics,
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The motion as a vehicle's sensors would measure it: without pitch and roll, and half a degree off in heading.
fn as_measured(motion: &Se3) -> Se3 {
    let turn = motion.axis_angle();
    let planar = Se3::from_axis_angle(Vector3::new(0.0, turn.y, 0.0), motion.translation());
    Se3::from_axis_angle(Vector3::new(0.0, 0.009, 0.0), Vector3::zeros()) * planar
}

#[test]
fn rotation_and_translation_are_found_in_units_of_the_depth() {
    let street = Street::new(3);
    for (source, target) in [(20, 22), (40, 43)] {
        let ((before, _), (grey, depth)) = (street.frame(source), street.frame(target));
        let truth = street.motion(source, target);
        for factor in [0.75f32, 1.0, 1.3] {
            let depth = scaled(&depth, factor);
            let found = align(
                &grey,
                &image(&depth, street.camera()),
                &before,
                &as_measured(&truth),
            )
            .unwrap();
            let motion = found.source_from_target;
            // A fortieth of a degree, which is a sixth of a pixel at this size.
            let turn = (motion * truth.inverse()).angle();
            assert!(turn < 5e-4, "{source} {target} {factor}: {turn}");
            let way = motion.translation().norm() / truth.translation().norm();
            let off = way / f64::from(factor) - 1.0;
            assert!(off.abs() < 0.02, "{source} {target} {factor}: {off}");
            assert!(found.seen > 0.6, "{}", found.seen);
        }
    }
}

#[test]
fn patches_recover_the_factor_applied_to_the_depth() {
    let street = Street::new(4);
    let (target, depth) = street.frame(40);
    let before: Vec<(GreyPyramid, Se3)> = [38, 34, 28]
        .map(|source| (street.frame(source).0, street.motion(source, 40)))
        .into();
    let views: Vec<View<'_>> = before
        .iter()
        .map(|(grey, motion)| View {
            image: grey.full(),
            source_from_target: *motion,
        })
        .collect();
    for factor in [0.7f32, 1.0, 1.25] {
        let depth = scaled(&depth, factor);
        let points = scene_points(target.full(), &image(&depth, street.camera()), &views);
        assert!(points.len() > 150, "{factor}: {} points", points.len());
        let found = median(points.iter().map(|p| p.log_factor).collect());
        let off = found + f64::from(factor).ln();
        assert!(off.abs() < 0.01, "{factor}: {off}");
        // Most patches agree: the spread corresponds to a fraction of a pixel.
        let spread = median(
            points
                .iter()
                .map(|p| (p.log_factor - found).abs())
                .collect(),
        );
        assert!(spread < 0.04, "{factor}: {spread}");
    }
}

#[test]
fn a_wrong_focal_length_does_not_hide_a_wrong_depth() {
    // The camera looks in the direction of motion: how fast points leave the centre gives depth relative to the translation, whatever focal
    // length is assumed.
    let street = Street::new(5);
    let (target, depth) = street.frame(30);
    let (before, _) = street.frame(27);
    let truth = street.motion(27, 30);
    let camera = street.camera();
    let wrong = Intrinsics {
        fx: 1.1 * camera.fx,
        fy: 1.1 * camera.fy,
        ..camera
    };
    // A network that assumes a longer focal length predicts everything farther away.
    let depth = scaled(&depth, 1.1);
    let depth = image(&depth, wrong);
    let found = align(&target, &depth, &before, &truth).unwrap();
    let motion = found.source_from_target;
    let way = motion.translation() * (truth.translation().norm() / motion.translation().norm());
    let view = View {
        image: before.full(),
        source_from_target: Se3::from_parts(&motion.rotation(), way),
    };
    let points = scene_points(target.full(), &depth, &[view]);
    let off = median(points.iter().map(|p| p.log_factor).collect()) + 1.1f64.ln();
    assert!(off.abs() < 0.02, "{off}");
}

#[test]
fn images_without_texture_give_nothing() {
    let flat = GreyPyramid::new(GreyImage {
        width: 128,
        height: 64,
        data: vec![90.0; 128 * 64],
    });
    let depth = DepthMap {
        width: 128,
        height: 64,
        data: vec![10.0; 128 * 64],
    };
    let depth = image(&depth, Intrinsics::centred(100.0, (128, 64)));
    let motion = Se3::from_axis_angle(Vector3::zeros(), Vector3::new(0.0, 0.0, 1.0));
    assert_eq!(align(&flat, &depth, &flat, &motion), None);
    let view = View {
        image: flat.full(),
        source_from_target: motion,
    };
    assert!(scene_points(flat.full(), &depth, &[view]).is_empty());
}

#[test]
fn depth_that_is_nan_is_left_out() {
    let street = Street::new(6);
    let (target, depth) = street.frame(30);
    let (before, _) = street.frame(28);
    let truth = street.motion(28, 30);
    let mut holes = depth.clone();
    for (i, depth) in holes.data.iter_mut().enumerate() {
        match i % 7 {
            0 => *depth = f32::NAN,
            1 => *depth = f32::INFINITY,
            2 => *depth = -1.0,
            _ => {}
        }
    }
    let holes = image(&holes, street.camera());
    let found = align(&target, &holes, &before, &truth).unwrap();
    let turn = (found.source_from_target * truth.inverse()).angle();
    assert!(turn < 1e-3, "{turn}");
    let view = View {
        image: before.full(),
        source_from_target: truth,
    };
    for point in scene_points(target.full(), &holes, &[view]) {
        assert!(point.depth_m > 0.0 && point.log_factor.is_finite());
    }
}
