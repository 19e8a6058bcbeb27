use deepfusion_geometry::cloud::PointCloud;
use image::{Rgb, RgbImage};
use nalgebra::Vector3;

use crate::DepthScale;
use crate::captioned::PAPER;
use crate::text::{TextSize, draw_text};

/// A viewpoint of a cloud. The cloud is in the camera's axes: x right, y down, z forward, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CloudView {
    /// From straight above, as a map: `ahead_m` metres ahead from bottom to top, with lines every ten metres.
    BirdsEye {
        /// How far ahead the picture reaches, in metres.
        ahead_m: f64,
    },
    /// In perspective from `eye_m`, looking at `at_m`, the picture's sides upright.
    Perspective {
        /// Position of the eye.
        eye_m: [f64; 3],
        /// The point it looks at.
        at_m: [f64; 3],
        /// Horizontal field of view, in radians.
        fov_rad: f64,
    },
}

impl CloudView {
    /// A map of the sixty metres ahead.
    #[must_use]
    pub fn birds_eye() -> Self {
        Self::BirdsEye { ahead_m: 60.0 }
    }

    /// From above and behind the camera, to its left, looking down the street.
    #[must_use]
    pub fn oblique() -> Self {
        Self::Perspective {
            eye_m: [-7.0, -7.0, -4.0],
            at_m: [0.5, 0.5, 14.0],
            fov_rad: 1.1,
        }
    }
}

/// Draws a cloud, near points over far ones. Points without colour are coloured by distance.
///
/// Each point is a square as large as the gap to its neighbours (about 7 cm per 10 m of distance from the camera), 1 to
/// 6 pixels wide.
#[must_use]
pub fn render_cloud(cloud: &PointCloud, view: &CloudView, width: u32, height: u32) -> RgbImage {
    let mut canvas = Canvas {
        picture: RgbImage::from_pixel(width, height, PAPER),
        nearness: vec![f64::INFINITY; width as usize * height as usize],
    };
    let projection = Projection::new(view, width, height);
    if let CloudView::BirdsEye { ahead_m } = view {
        canvas.grid(&projection, *ahead_m);
    }
    let scale = DepthScale::default();
    for (i, xyz) in cloud.xyz.iter().enumerate() {
        let point = Vector3::from(xyz.map(f64::from));
        let Some((u, v, distance, pixels_per_m)) = projection.project(&point) else {
            continue;
        };
        let colour = match &cloud.rgb {
            Some(rgb) => rgb.get(i).map_or(Rgb([255; 3]), |c| Rgb(*c)),
            None => scale.colour(point.norm() as f32),
        };
        let size = (pixels_per_m * point.norm() * 0.007).clamp(1.0, 6.0);
        canvas.square(u, v, distance, size, colour);
    }
    if let CloudView::BirdsEye { ahead_m } = view {
        canvas.labels(&projection, *ahead_m);
    }
    canvas.picture
}

/// Projects a point to a pixel.
struct Projection {
    eye: Vector3<f64>,
    /// Rows: right, down, forward of the picture.
    axes: [Vector3<f64>; 3],
    centre: (f64, f64),
    /// Pixels per metre (map) or focal length in pixels (perspective).
    scale: f64,
    perspective: bool,
}

impl Projection {
    fn new(view: &CloudView, width: u32, height: u32) -> Self {
        let (width, height) = (f64::from(width), f64::from(height));
        match *view {
            CloudView::BirdsEye { ahead_m } => Self {
                // The camera is high above: a higher point is nearer.
                eye: Vector3::new(0.0, -100.0, 0.0),
                axes: [Vector3::x(), -Vector3::z(), Vector3::y()],
                centre: (width / 2.0, height - 1.0),
                scale: height / ahead_m,
                perspective: false,
            },
            CloudView::Perspective {
                eye_m,
                at_m,
                fov_rad,
            } => {
                let (eye, at) = (Vector3::from(eye_m), Vector3::from(at_m));
                let forward = (at - eye).try_normalize(1e-9).unwrap_or(Vector3::z());
                // y points down: down × forward = right.
                let right = Vector3::y()
                    .cross(&forward)
                    .try_normalize(1e-9)
                    .unwrap_or(Vector3::x());
                Self {
                    eye,
                    axes: [right, forward.cross(&right), forward],
                    centre: (width / 2.0, height / 2.0),
                    scale: width / 2.0 / (fov_rad / 2.0).tan(),
                    perspective: true,
                }
            }
        }
    }

    /// Column, row, distance along the view, and pixels per metre at this distance; `None` behind the eye.
    fn project(&self, point: &Vector3<f64>) -> Option<(f64, f64, f64, f64)> {
        let seen = point - self.eye;
        let [right, down, forward] = self.axes.map(|axis| axis.dot(&seen));
        let pixels_per_m = if self.perspective {
            self.scale / forward
        } else {
            self.scale
        };
        (forward > 0.1 && forward.is_finite()).then_some((
            self.centre.0 + right * pixels_per_m,
            self.centre.1 + down * pixels_per_m,
            forward,
            pixels_per_m,
        ))
    }
}

struct Canvas {
    picture: RgbImage,
    nearness: Vec<f64>,
}

impl Canvas {
    /// Draws a filled square around (u, v) where nothing nearer is.
    fn square(&mut self, u: f64, v: f64, distance: f64, size: f64, colour: Rgb<u8>) {
        let (width, height) = self.picture.dimensions();
        let (left, top) = ((u - size / 2.0).round(), (v - size / 2.0).round());
        let side = size.round().max(1.0);
        let columns = left.max(0.0) as u32..(left + side).clamp(0.0, f64::from(width)) as u32;
        for y in top.max(0.0) as u32..(top + side).clamp(0.0, f64::from(height)) as u32 {
            for x in columns.clone() {
                let nearest = &mut self.nearness[y as usize * width as usize + x as usize];
                if distance < *nearest {
                    *nearest = distance;
                    self.picture.put_pixel(x, y, colour);
                }
            }
        }
    }

    fn grid(&mut self, projection: &Projection, ahead_m: f64) {
        const LINE: Rgb<u8> = Rgb([52, 52, 58]);
        let (width, height) = self.picture.dimensions();
        for step in 0..=(ahead_m / 10.0) as u32 {
            let metres = f64::from(step) * 10.0;
            let row = projection.centre.1 - metres * projection.scale;
            for x in 0..width {
                self.put(f64::from(x), row, LINE);
            }
            for side in [-metres, metres] {
                let column = projection.centre.0 + side * projection.scale;
                for y in 0..height {
                    self.put(column, f64::from(y), LINE);
                }
            }
        }
    }

    fn labels(&mut self, projection: &Projection, ahead_m: f64) {
        let size = TextSize::for_width(self.picture.width());
        for step in 1..=(ahead_m / 10.0) as u32 {
            let row = projection.centre.1 - f64::from(step) * 10.0 * projection.scale;
            let label = format!("{} m", step * 10);
            draw_text(
                &mut self.picture,
                &label,
                (4, row as i32 + 3),
                size,
                Rgb([161, 161, 170]),
            );
        }
    }

    fn put(&mut self, x: f64, y: f64, colour: Rgb<u8>) {
        if x >= 0.0
            && y >= 0.0
            && let Some(pixel) = self.picture.get_pixel_mut_checked(x as u32, y as u32)
        {
            *pixel = colour;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: [u8; 3] = [255, 0, 0];
    const BLUE: [u8; 3] = [0, 0, 255];

    fn find(picture: &RgbImage, colour: [u8; 3]) -> Option<(u32, u32)> {
        picture
            .enumerate_pixels()
            .find(|(_, _, p)| p.0 == colour)
            .map(|(x, y, _)| (x, y))
    }

    fn cloud(points: &[([f32; 3], [u8; 3])]) -> PointCloud {
        PointCloud {
            xyz: points.iter().map(|p| p.0).collect(),
            rgb: Some(points.iter().map(|p| p.1).collect()),
            ..PointCloud::default()
        }
    }

    #[test]
    fn the_map_has_right_on_the_right_and_far_at_the_top() {
        let cloud = cloud(&[([10.0, 1.0, 40.0], RED), ([-10.0, 1.0, 10.0], BLUE)]);
        let picture = render_cloud(&cloud, &CloudView::birds_eye(), 240, 300);
        let (red, blue) = (find(&picture, RED).unwrap(), find(&picture, BLUE).unwrap());
        assert!(red.0 > 160 && red.1 < 110, "{red:?}");
        assert!(blue.0 < 80 && blue.1 > 240, "{blue:?}");
    }

    #[test]
    fn near_points_cover_far_ones_in_any_order() {
        let view = CloudView::Perspective {
            eye_m: [0.0; 3],
            at_m: [0.0, 0.0, 1.0],
            fov_rad: 1.0,
        };
        for order in [[0, 1], [1, 0]] {
            let points = [([0.0, 0.0, 5.0], RED), ([0.0, 0.0, 50.0], BLUE)];
            let picture = render_cloud(&cloud(&order.map(|i| points[i])), &view, 100, 60);
            assert_eq!(picture.get_pixel(50, 30).0, RED);
        }
        // Right is right and down is down; points behind the eye are not drawn.
        let picture = render_cloud(
            &cloud(&[([1.0, 0.5, 5.0], RED), ([0.0, 0.0, -5.0], BLUE)]),
            &view,
            100,
            60,
        );
        let red = find(&picture, RED).unwrap();
        assert!(red.0 > 60 && red.1 > 32, "{red:?}");
        assert_eq!(find(&picture, BLUE), None);
    }

    #[test]
    fn points_that_are_nan_are_left_out() {
        let odd = cloud(&[
            ([f32::NAN, 0.0, 5.0], RED),
            ([f32::INFINITY, 1.0, f32::INFINITY], RED),
            ([1e30, 0.0, 3.0], RED),
        ]);
        for view in [CloudView::birds_eye(), CloudView::oblique()] {
            let picture = render_cloud(&odd, &view, 50, 40);
            assert_eq!(find(&picture, RED), None);
        }
    }
}
