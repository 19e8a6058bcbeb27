use deepfusion_geometry::Intrinsics;
use deepfusion_perception::Target;
use image::{Rgb, RgbImage};
use nalgebra::Vector3;

use super::colour_of;
use super::line::line;
use crate::text::{TextSize, draw_text, text_width};

/// Nearest depth at which an edge is still drawn, metres.
const NEAR_M: f64 = 0.3;

/// The image with the targets' boxes, farthest first. The front face of a dynamic one is crossed; above each is its
/// class (if known), number, distance and, if dynamic, speed.
#[must_use]
pub fn box_overlay(image: &RgbImage, k: &Intrinsics, targets: &[Target]) -> RgbImage {
    let mut picture = image.clone();
    let thickness = if image.width() >= 1000 { 2 } else { 1 };
    let mut order: Vec<&Target> = targets.iter().collect();
    order.sort_by(|a, b| b.distance_m.total_cmp(&a.distance_m));
    for target in order {
        draw_box(&mut picture, k, target, thickness);
        draw_label(&mut picture, k, target);
    }
    picture
}

fn draw_box(picture: &mut RgbImage, k: &Intrinsics, target: &Target, thickness: u32) {
    let corners = target.corners().map(Vector3::from);
    let colour = colour_of(target.id);
    let mut edge = |a: usize, b: usize| {
        if let Some([from, to]) = projected(k, corners[a], corners[b]) {
            line(picture, from, to, thickness, colour);
        }
    };
    for i in 0..4 {
        edge(i, (i + 1) % 4);
        edge(4 + i, 4 + (i + 1) % 4);
        edge(i, 4 + i);
    }
    if target.moving == Some(true) {
        // Corners 0 and 3 are the front ones.
        edge(0, 7);
        edge(3, 4);
    }
}

/// Both ends of an edge in the image, clipped to the space in front of the camera.
fn projected(k: &Intrinsics, mut a: Vector3<f64>, mut b: Vector3<f64>) -> Option<[[f64; 2]; 2]> {
    if a.z < NEAR_M && b.z < NEAR_M {
        return None;
    }
    let at_near = |near: &Vector3<f64>, far: &Vector3<f64>| {
        near + (far - near) * ((NEAR_M - near.z) / (far.z - near.z))
    };
    if a.z < NEAR_M {
        a = at_near(&a, &b);
    } else if b.z < NEAR_M {
        b = at_near(&b, &a);
    }
    let pixel = |p: &Vector3<f64>| k.project(p).map(|p| [p.x, p.y]);
    Some([pixel(&a)?, pixel(&b)?])
}

fn draw_label(picture: &mut RgbImage, k: &Intrinsics, target: &Target) {
    let [x, y, z] = target.center_m;
    let top = Vector3::new(x, y - 0.5 * target.size_m[2], z);
    let Some(place) = k.project(&top).filter(|_| z > 1.0) else {
        return;
    };
    let mut text = format!("{} {:.1}m", target.id, target.distance_m);
    if let Some(class) = &target.class {
        text = format!("{class} {text}");
    }
    if let (Some(true), Some(v)) = (target.moving, target.velocity_mps) {
        let speed = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        text += &format!(" {speed:.1}m/s");
    }
    let size = TextSize::for_width(picture.width() / 2);
    let (width, height) = (text_width(&text, size) as i32, size.height() as i32);
    let left = (place.x as i32 - width / 2).clamp(0, (picture.width() as i32 - width).max(0));
    let up = (place.y as i32 - height - 2).clamp(0, (picture.height() as i32 - height).max(0));
    for (px, py) in
        (left - 1..left + width + 1).flat_map(|x| (up..up + height).map(move |y| (x, y)))
    {
        if px >= 0
            && py >= 0
            && let Some(pixel) = picture.get_pixel_mut_checked(px as u32, py as u32)
        {
            *pixel = Rgb(pixel.0.map(|c| c / 3));
        }
    }
    draw_text(picture, &text, (left, up), size, colour_of(target.id));
}
