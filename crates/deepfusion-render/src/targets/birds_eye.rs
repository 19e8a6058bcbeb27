use deepfusion_perception::{Cell, FreeSpace, Ground, Target};
use image::{Rgb, RgbImage};

use super::colour_of;
use super::line::line;
use crate::captioned::{INK, PAPER};
use crate::text::{TextSize, draw_text};

/// Colour of free ground.
const FREE: Rgb<u8> = Rgb([226, 240, 226]);
/// Colour of occupied ground.
const OCCUPIED: Rgb<u8> = Rgb([120, 120, 128]);
/// Colour of the lines, one every ten metres.
const GRID: Rgb<u8> = Rgb([200, 204, 212]);
/// Seconds of motion that an arrow shows.
const ARROW_S: f64 = 1.0;

/// The road from above, `ahead_m` metres from bottom to top: free and occupied ground, boxes with their numbers, and the
/// positions of dynamic targets after one second. `width` × `height` pixels.
#[must_use]
pub fn birds_eye(
    ground: &Ground,
    free_space: Option<&FreeSpace>,
    targets: &[Target],
    ahead_m: f64,
    (width, height): (u32, u32),
) -> RgbImage {
    let mut picture = RgbImage::from_pixel(width, height, PAPER);
    let scale = f64::from(height) / ahead_m;
    let middle = 0.5 * f64::from(width);
    let pixel =
        |right: f64, forward: f64| [middle + right * scale, f64::from(height) - forward * scale];
    if let Some(space) = free_space {
        for (x, y, p) in picture.enumerate_pixels_mut() {
            let right = (f64::from(x) - middle) / scale;
            let forward = (f64::from(height) - f64::from(y)) / scale;
            match space.at(right as f32, forward as f32) {
                Some(Cell::Free) => *p = FREE,
                Some(Cell::Occupied) => *p = OCCUPIED,
                Some(Cell::Unknown) | None => {}
            }
        }
    }
    for step in 1..=(ahead_m / 10.0) as u32 {
        let forward = 10.0 * f64::from(step);
        let [_, y] = pixel(0.0, forward);
        line(&mut picture, [0.0, y], [f64::from(width), y], 1, GRID);
        let at = (2, y as i32 + 2);
        draw_text(
            &mut picture,
            &format!("{forward} m"),
            at,
            TextSize::Small,
            INK,
        );
    }
    let on_ground = |p: [f64; 3]| {
        let [right, forward, _] = ground.locate(p.map(|x| x as f32));
        pixel(f64::from(right), f64::from(forward))
    };
    for target in targets {
        let colour = colour_of(target.id);
        let corners = target.corners().map(on_ground);
        for i in 0..4 {
            line(&mut picture, corners[i], corners[(i + 1) % 4], 2, colour);
        }
        let centre = on_ground(target.center_m);
        if let (Some(true), Some(v)) = (target.moving, target.velocity_mps) {
            let later: [f64; 3] = std::array::from_fn(|i| target.center_m[i] + ARROW_S * v[i]);
            line(&mut picture, centre, on_ground(later), 2, colour);
        }
        let at = (centre[0] as i32 + 4, centre[1] as i32 - 5);
        draw_text(
            &mut picture,
            &target.id.to_string(),
            at,
            TextSize::Small,
            INK,
        );
    }
    // The camera's own position: a wedge that points up.
    let foot = pixel(0.0, 0.0);
    for side in [-1.0, 1.0] {
        line(
            &mut picture,
            [foot[0], foot[1] - 12.0],
            [foot[0] + side * 6.0, foot[1]],
            2,
            INK,
        );
    }
    picture
}
