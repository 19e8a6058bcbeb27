//! The depth of hills, compared with a profile that is folded here, in two dimensions and double precision.

use super::*;
use crate::primitive::V3;
use crate::render::{Air, Cores, Edges, Eye, FrameSolid, RenderInput, expose};
use crate::varied::{Endless, View};

/// A straight piece of the ground's profile.
struct Piece {
    /// Where it begins along the flat ground, metres from the point below the camera.
    flat: f64,
    /// Where it begins after folding, metres: ahead of the point below the camera, and up.
    ahead: f64,
    up: f64,
    /// Slope, radians.
    slope: f64,
}

fn profile(folds: &Folds) -> Vec<Piece> {
    let mut pieces = vec![Piece {
        flat: 0.0,
        ahead: 0.0,
        up: 0.0,
        slope: 0.0,
    }];
    for crease in &folds.creases {
        let last = &pieces[pieces.len() - 1];
        let length = crease.distance - last.flat;
        pieces.push(Piece {
            flat: crease.distance,
            ahead: last.ahead + length * last.slope.cos(),
            up: last.up + length * last.slope.sin(),
            slope: last.slope + crease.angle,
        });
    }
    pieces
}

/// A point of the folded world after unfolding.
struct Unfolded {
    /// Position along the flat ground, metres from the point below the camera.
    flat: f64,
    /// Height above that ground, metres.
    above: f64,
    /// Slope of its piece, radians.
    slope: f64,
    /// Distance from the nearest crease, along the ground, metres.
    from_crease: f64,
}

/// Unfolds a point by the first piece that ends beyond it.
fn unfold(pieces: &[Piece], ahead: f64, up: f64) -> Unfolded {
    let ends = pieces[1..].iter().map(|p| p.flat).chain([f64::MAX]);
    let own = |(number, (piece, end)): (usize, (&Piece, f64))| {
        let (x, z) = (ahead - piece.ahead, up - piece.up);
        let (sin, cos) = piece.slope.sin_cos();
        let along = x * cos + z * sin;
        let flat = piece.flat + along;
        let begin = if number == 0 { f64::MAX } else { along.abs() };
        let unfolded = Unfolded {
            flat,
            above: z * cos - x * sin,
            slope: piece.slope,
            from_crease: begin.min((end - flat).abs()),
        };
        (flat < end).then_some(unfolded)
    };
    pieces.iter().zip(ends).enumerate().find_map(own).unwrap()
}

fn config() -> EndlessConfig {
    EndlessConfig {
        width: 192,
        height: 96,
        hills: 1.0,
        formation: false,
        worlds_at_once: 8,
        views_per_world: 3,
        ..EndlessConfig::default()
    }
}

/// Views with hills, their worlds and their creases.
fn hilly(count: usize) -> Vec<(View, BuiltWorld, Folds)> {
    let stream = Endless::new(config()).unwrap();
    (0..)
        .map(|index| (index, stream.view(index)))
        .filter(|(_, view)| view.hills)
        .take(count)
        .map(|(index, view)| {
            let place = BuiltWorld::build(&config(), view.world);
            let folds = of_view(&config(), index, &place, &view.world_from_cam);
            (view, place, folds)
        })
        .collect()
}

/// The rays of a view with their depths. A ray is ahead along the road, left and up, per metre of depth.
fn rays(view: &View, folds: &Folds) -> impl Iterator<Item = (usize, Vector3<f64>, f64)> {
    let (sin, cos) = folds.heading.sin_cos();
    (0..view.depth.data.len()).map(move |i| {
        let (u, v) = (i % view.depth.width, i / view.depth.width);
        let local = view.intrinsics.back_project(u as f64, v as f64, 1.0);
        let d = view.world_from_cam.rotate(&local);
        let turned = Vector3::new(cos * d.x + sin * d.y, cos * d.y - sin * d.x, d.z);
        (i, turned, f64::from(view.depth.data[i]))
    })
}

#[test]
fn the_depth_of_the_ground_matches_its_profile() {
    let (mut beyond, mut raised, mut sky) = (0, 0, 0);
    for (view, _, folds) in hilly(24) {
        let pieces = profile(&folds);
        let eye = view.world_from_cam.translation();
        for (i, d, depth) in rays(&view, &folds) {
            if depth > 0.0 {
                let up = eye.z + d.z * depth;
                let Unfolded { flat, above, .. } = unfold(&pieces, d.x * depth, up);
                let tolerance = 1e-3 + 1e-5 * depth;
                assert!(above > -tolerance, "pixel {i}: {above} at {flat} m");
                let kerb = 0.13;
                if above < tolerance || (above - kerb).abs() < tolerance {
                    beyond += usize::from(flat > folds.creases[0].distance + 1.0);
                    raised += usize::from(up.abs() > 1.0);
                }
            } else if d.x > 0.1 {
                // The ray of a sky pixel stays above the profile as far as ground is drawn: there is no hole.
                let farthest = 590.0 * d.x;
                let last = &pieces[pieces.len() - 1];
                let end = last.up + (farthest - last.ahead) * last.slope.tan();
                let corners = pieces.iter().map(|p| (p.ahead, p.up));
                for (x, z) in corners.chain([(farthest, end)]) {
                    let ray = eye.z + d.z * x / d.x;
                    assert!(x > farthest || ray > z, "pixel {i}: a hole at {x} m");
                }
                sky += 1;
            }
        }
    }
    println!(
        "{beyond} points of ground beyond a crease, {raised} of ground 1 m up or down, {sky} of sky"
    );
    assert!(beyond > 20_000 && raised > 4_000 && sky > 40_000);
}

/// Each visible point, unfolded, is on a surface of the flat world.
#[test]
fn visible_points_unfold_onto_surfaces_of_the_flat_world() {
    const BEFORE: f64 = 0.2;
    let (mut right, mut all) = (0, 0);
    for (view, place, folds) in hilly(12) {
        let pieces = profile(&folds);
        let (eye, world) = (view.world_from_cam.translation(), &place.world);
        let (sin, cos) = folds.heading.sin_cos();
        let in_world =
            |v: Vector3<f64>| Vector3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z);
        for (i, d, depth) in rays(&view, &folds).step_by(23) {
            if depth <= 0.0 || depth > 150.0 || view.moving[i] {
                continue;
            }
            let at = unfold(&pieces, d.x * depth, eye.z + d.z * depth);
            // The planes at the creases are tilted by less than a degree.
            let near = 0.02 * at.above + 1.5 * BEFORE;
            if at.flat < folds.creases[0].distance || at.from_crease < near {
                continue;
            }
            let (lateral, d) = (d.y * depth, d.normalize());
            let (s, c) = at.slope.sin_cos();
            let d = in_world(Vector3::new(c * d.x + s * d.z, d.y, c * d.z - s * d.x));
            let foot = Vector3::new(eye.x, eye.y, 0.0);
            let point = foot + in_world(Vector3::new(at.flat, lateral, at.above));
            let position = point - d * BEFORE;
            let standing = world.primitives.iter().chain(&world.far);
            let solids: Vec<FrameSolid> = standing
                .map(|primitive| FrameSolid {
                    primitive: *primitive,
                    eye: primitive.local_point(&position),
                    nearest: 0.0,
                })
                .collect();
            let candidates: Vec<u32> = (0..solids.len() as u32).collect();
            let eye = Eye {
                world,
                position,
                solids,
            };
            let d: V3 = d.map(|x| x as f32);
            // The ray may begin below the kerb's height, over the road.
            let ends = eye.trace_between(&candidates, &d, (1e-3, f32::INFINITY));
            let found = f64::from(ends.t);
            all += 1;
            right += usize::from((found - BEFORE).abs() < 2e-3 + 1e-5 * depth);
        }
    }
    println!("{right} of {all} points beyond a crease");
    // The last digit decides where a leaf ends, so a few points may differ.
    assert!(all > 2400 && right * 500 > all * 499, "{right} of {all}");
}

#[test]
fn creases_with_an_angle_of_zero_change_nothing() {
    for (view, place, folds) in hilly(4) {
        let air = Air::of(&place.world);
        let render = |folds: &Folds| {
            let input = RenderInput {
                world: &place.world,
                light: &place.light,
                air: &air,
                cars: &[],
                world_from_cam: &view.world_from_cam,
                intrinsics: &view.intrinsics,
                folds,
            };
            let standing = place.world.primitives.iter().chain(&place.world.far);
            let solids = standing.copied().collect();
            expose(&input, solids, Cores::One, Edges::EachSurface)
        };
        let creases = folds.creases.iter().map(|crease| Crease {
            angle: 0.0,
            ..*crease
        });
        let creased = render(&Folds {
            heading: folds.heading,
            creases: creases.collect(),
        });
        let flat = render(&Folds::default());
        let pairs = creased.depth.data.iter().zip(&flat.depth.data);
        let other = pairs.filter(|(a, b)| (*a - *b).abs() > 1e-4 * *a).count();
        // The last digit decides where a leaf ends, so a few pixels may differ.
        assert!(other < 20, "{other} of {}", flat.depth.data.len());
    }
}

#[test]
fn slopes_are_as_on_real_roads() {
    let (mut ups, mut steep, mut most) = (0, 0, 0);
    let (mut cut, mut all) = (0, 0);
    for (view, place, folds) in hilly(60) {
        let (pieces, creases) = (profile(&folds), &folds.creases);
        assert!((6.0..=44.0).contains(&creases[0].distance));
        let apart = |w: &[Crease]| w[1].distance - w[0].distance;
        assert!(creases.windows(2).all(|w| apart(w) > 7.9));
        assert!(creases.iter().all(|c| c.angle.abs() <= SHARPEST + 1e-12));
        let slopes = pieces.iter().map(|p| p.slope.tan().abs());
        let steepest = slopes.fold(0.0, f64::max);
        assert!(steepest <= 0.15 + 1e-9, "{steepest}");
        assert!(pieces[pieces.len() - 1].slope.abs() < 0.0121);
        let looks = view.world_from_cam.rotate(&Vector3::z());
        assert!(looks.x * folds.heading.cos() + looks.y * folds.heading.sin() > -0.3);
        ups += usize::from(creases[0].angle > 0.0);
        steep += usize::from(steepest > 0.09);
        most = most.max(creases.len());
        let poles = poles(
            &place.world,
            &view.world_from_cam.translation(),
            folds.heading,
        );
        let cuts = |crease: &&Crease| poles.iter().any(|pole| pole.is_at(crease.distance));
        cut += creases.iter().filter(cuts).count();
        all += creases.len();
    }
    println!("{cut} of {all} creases cut a pole");
    assert!(cut * 25 < all, "{cut} of {all}");
    println!("{ups} of 60 begin upwards, {steep} are steep, at most {most} creases");
    assert!((18..42).contains(&ups) && (1..25).contains(&steep) && most < 60);
}
