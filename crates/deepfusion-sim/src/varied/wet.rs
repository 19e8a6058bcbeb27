//! Reflections of wet ground.

use crate::primitive::V3;
use crate::render::{Camera, Exposure, RenderInput, Surface};
use crate::texture::Rgb;
use crate::texture::noise::smoothstep;
use deepfusion_geometry::Se3;

/// Reflectance of water at perpendicular incidence.
const STRAIGHT: f32 = 0.02;

/// Reflectance at grazing incidence: a rough wet road mirrors less than still water.
const GRAZING: f32 = 0.55;

/// Adds reflections to the ground of a wet street. Their colour is that of the picture in the mirrored direction, as if the mirrored object
/// were far away, or that of the sky if this is outside the picture. Depth does not change.
pub(super) fn reflect(input: &RenderInput, exposure: &mut Exposure) {
    let wet = input.air.wet;
    if wet <= 0.0 {
        return;
    }
    let k = input.intrinsics;
    let (width, height) = (k.width as usize, k.height as usize);
    let rotation = |pose: &Se3| pose.rotation().map(|x| x as f32);
    let world_from_cam = rotation(input.world_from_cam);
    let views: Vec<_> = exposure
        .segments
        .iter()
        .map(|pose| {
            let camera = Camera::new(pose, k);
            (camera, rotation(pose).transpose(), pose.translation())
        })
        .collect();
    let source = exposure.light.clone();
    for v in 0..height {
        for u in 0..width {
            let index = v * width + u;
            let hit = exposure.hits[index];
            if !matches!(hit.surface, Surface::Road | Surface::Beside) {
                continue;
            }
            let (camera, cam_from_world, eye) = &views[usize::from(hit.segment)];
            let d = camera.ray(u as f32, v as f32);
            let place = (eye.x as f32 + d.x * hit.t, eye.y as f32 + d.y * hit.t);
            // Puddles and films of water, in coordinates of the ground.
            let minor = hit.t / k.fx as f32;
            let stands = input
                .world
                .noise
                .fractal(place.0 + 31.0, place.1, 3.1, 3, 0.5, minor);
            let film = 0.25 + 0.75 * smoothstep(0.5 - wet, 1.1 - wet, stands);
            let length = d.norm();
            let steep = (-d.z / length).clamp(0.0, 1.0);
            let mirror = STRAIGHT + (GRAZING - STRAIGHT) * (1.0 - steep).powi(5);
            let up = V3::new(d.x, d.y, -d.z);
            let in_cam = cam_from_world * up;
            let seen = mirrored(&source, &exposure.hits, (width, height), &in_cam, k)
                .unwrap_or_else(|| {
                    // The sky does not tilt with a hill.
                    let up = if hit.segment == 0 {
                        up
                    } else {
                        world_from_cam * in_cam
                    };
                    input.air.radiance(&input.world.noise, &up)
                });
            let kept = input
                .air
                .fog
                .map_or(1.0, |fog| (-fog.extinction * hit.t * length).exp());
            exposure.light[index] += seen * (mirror * film * wet * kept);
        }
    }
}

/// The picture's colour in a direction (camera axes), smeared upwards and downwards as by a rough mirror; `None` if that is ground or
/// outside the picture.
fn mirrored(
    light: &[Rgb],
    hits: &[crate::render::Hit],
    (width, height): (usize, usize),
    d: &V3,
    k: &deepfusion_geometry::Intrinsics,
) -> Option<Rgb> {
    if d.z <= 1e-3 {
        return None;
    }
    let u = k.fx as f32 * d.x / d.z + k.cx as f32;
    let v = k.fy as f32 * d.y / d.z + k.cy as f32;
    if !(u > -0.5 && v > -0.5 && u < width as f32 - 0.5 && v < height as f32 - 0.5) {
        return None;
    }
    let column = (u + 0.5) as usize;
    let (mut sum, mut count) = (Rgb::zeros(), 0.0);
    for shift in [-3.0, -1.5, 0.0, 1.5, 3.0] {
        let row = (v + shift + 0.5).clamp(0.0, height as f32 - 1.0) as usize;
        let index = row * width + column;
        if matches!(hits[index].surface, Surface::Sky | Surface::Solid(..)) {
            sum += light[index];
            count += 1.0;
        }
    }
    (count > 0.0).then(|| sum / count)
}
