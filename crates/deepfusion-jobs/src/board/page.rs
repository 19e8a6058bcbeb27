//! A calibration as an HTML page.

use deepfusion_data::RgbImage;
use deepfusion_render::{HtmlReport, PictureFormat};
use image::Rgb;

use super::CalibrationReport;
use crate::Result;

/// Width of the picture of all corners.
const WIDTH: u32 = 720;

impl CalibrationReport<'_> {
    /// The page: the numbers, where corners were seen, every view and its error, and the `command` that makes it again.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub fn page(&self, command: &str) -> Result<HtmlReport> {
        let found = self.calibration;
        let subtitle = format!("{}, error {:.3} px", self.written.display(), found.rms_px);
        let mut page = HtmlReport::new("Camera calibration", subtitle).properties(&self.rows());
        if !self.warnings.is_empty() {
            let warnings = self.warnings.iter().map(ToString::to_string);
            page = page
                .section("How to improve it")
                .list(&warnings.collect::<Vec<_>>());
        }
        page = page.section("Where corners were seen").picture(
            "All corners of the views used, in the image; those of views left out are red",
            &self.corners(),
            PictureFormat::Png,
        )?;
        let number =
            |n: Option<f64>, digits: usize| n.map_or("–".into(), |n| format!("{n:.digits$}"));
        let rows: Vec<Vec<String>> = found
            .views
            .iter()
            .map(|view| {
                vec![
                    view.name.clone(),
                    if view.used { "yes" } else { "no" }.into(),
                    number(view.rms_px, 3),
                    number(view.distance_m, 3),
                    number(view.tilt_deg, 0),
                ]
            })
            .collect();
        let header = ["View", "used", "error, px", "distance, m", "tilt, degrees"];
        page = page.section("Views").table(&header, &rows);
        Ok(page.section("Reproduce").command(command))
    }

    /// The image's area, with a dot for each corner.
    fn corners(&self) -> RgbImage {
        let camera = &self.calibration.intrinsics;
        let scale = f64::from(WIDTH) / f64::from(camera.width);
        let height = ((f64::from(camera.height) * scale).round() as u32).max(1);
        let mut picture = RgbImage::from_pixel(WIDTH, height, Rgb([246, 246, 246]));
        for (view, fit) in self.views.iter().zip(&self.calibration.views) {
            let colour = if fit.used {
                [31, 119, 180]
            } else {
                [214, 39, 40]
            };
            for corner in &view.corners {
                let at = corner.map(|n| ((n + 0.5) * scale - 0.5).round() as i64);
                for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
                    let (x, y) = (u32::try_from(at.x + dx), u32::try_from(at.y + dy));
                    if let (Ok(x), Ok(y)) = (x, y)
                        && let Some(pixel) = picture.get_pixel_mut_checked(x, y)
                    {
                        *pixel = Rgb(colour);
                    }
                }
            }
        }
        picture
    }
}
