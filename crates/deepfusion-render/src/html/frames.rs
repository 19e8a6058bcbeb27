//! Single frames in a report: image, prediction, truth, error, and the clouds.

use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics};
use image::imageops::{self, FilterType};
use image::{Rgb, RgbImage};

use super::HtmlReport;
use crate::shrink::shrunk_size;
use crate::{
    CloudView, DepthScale, PictureFormat, Result, depth_picture, error_picture, render_cloud,
    shrink_depth, sparse_depth_picture, with_depth_legend,
};

/// Pictures of frames are at most this wide: two stand side by side on a page of 1,030 units.
const WIDEST: u32 = 640;
/// Size of the views of clouds.
const CLOUD_SIZE: (u32, u32) = (640, 400);
/// More distant points are left out of clouds.
const CLOUD_DEPTH_M: f32 = 60.0;

/// A frame shown in a report.
#[derive(Debug, Clone)]
pub struct ShownFrame {
    /// Its heading: the reason for showing it, its name, its score.
    pub title: String,
    /// The image; black without one.
    pub image: Option<RgbImage>,
    /// Predicted depth at the truth's size, metres, 0 where there is none.
    pub prediction: DepthMap,
    /// True depth, metres, 0 where there is none.
    pub truth: DepthMap,
    /// The camera at the truth's size, for the clouds.
    pub camera: Option<Intrinsics>,
}

impl ShownFrame {
    fn picture_size(&self) -> (u32, u32) {
        let (width, height) = (self.truth.width as u32, self.truth.height as u32);
        shrunk_size((width, height), WIDEST)
    }

    fn image_of_size(&self, (width, height): (u32, u32)) -> RgbImage {
        match &self.image {
            Some(image) if image.dimensions() == (width, height) => image.clone(),
            Some(image) => imageops::resize(image, width, height, FilterType::Triangle),
            None => RgbImage::from_pixel(width, height, Rgb([0; 3])),
        }
    }
}

impl HtmlReport {
    /// Image, prediction, ground truth and error of a frame, two side by side.
    ///
    /// # Errors
    /// [`crate::Error::Size`] if prediction and truth differ in size, [`crate::Error::Encode`].
    pub fn frame(self, frame: &ShownFrame) -> Result<Self> {
        let scale = DepthScale::default();
        let size = frame.picture_size();
        let image = frame.image_of_size(size);
        let prediction = shrink_depth(&frame.prediction, size);
        let truth = shrink_depth(&frame.truth, size);
        let depth = with_depth_legend(&depth_picture(&prediction, &scale), &scale);
        let mut page = self.heading(&frame.title);
        if frame.image.is_some() {
            page = page.half_picture("Image", &image, PictureFormat::Jpeg)?;
        }
        page.half_picture("Predicted depth", &depth, PictureFormat::Jpeg)?
            .half_picture(
                "Ground truth",
                &with_depth_legend(&sparse_depth_picture(&image, &truth, &scale)?, &scale),
                PictureFormat::Jpeg,
            )?
            .half_picture(
                "Relative error of the prediction",
                &error_picture(&image, &prediction, &truth)?,
                PictureFormat::Jpeg,
            )
    }

    /// Predicted and true points of a frame, from above and behind and as a map. Adds nothing without a camera of the truth's
    /// size.
    ///
    /// # Errors
    /// [`crate::Error::Encode`].
    pub fn clouds(mut self, frame: &ShownFrame) -> Result<Self> {
        let (width, height) = (frame.truth.width as u32, frame.truth.height as u32);
        let Some(k) = frame
            .camera
            .filter(|k| (k.width, k.height) == (width, height))
        else {
            return Ok(self);
        };
        let image = frame
            .image
            .is_some()
            .then(|| frame.image_of_size((width, height)));
        let rgb = image.as_ref().map(|i| i.as_raw().as_slice());
        for (view, place) in [
            (CloudView::oblique(), "from above and behind the camera"),
            (CloudView::birds_eye(), "from straight above, 10 m grid"),
        ] {
            for (depth, what) in [(&frame.prediction, "Predicted"), (&frame.truth, "True")] {
                // The sizes were compared above; without points there is nothing to draw.
                if let Ok(cloud) = PointCloud::from_depth(depth, &k, rgb, CLOUD_DEPTH_M) {
                    let picture = render_cloud(&cloud, &view, CLOUD_SIZE.0, CLOUD_SIZE.1);
                    let caption = format!("{what} points, {place}");
                    self = self.half_picture(&caption, &picture, PictureFormat::Jpeg)?;
                }
            }
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_shown_with_and_without_image_and_camera() {
        let depth = DepthMap {
            width: 32,
            height: 16,
            data: vec![10.0; 512],
        };
        let mut frame = ShownFrame {
            title: "best: frame 3".into(),
            image: Some(RgbImage::new(64, 32)),
            prediction: depth.clone(),
            truth: depth,
            camera: Some(Intrinsics {
                fx: 20.0,
                fy: 20.0,
                cx: 16.0,
                cy: 8.0,
                width: 32,
                height: 16,
            }),
        };
        let page = |frame: &ShownFrame| {
            let page = HtmlReport::new("t", "s").frame(frame).unwrap();
            page.clouds(frame).unwrap().to_html()
        };
        assert_eq!(page(&frame).matches("<figure").count(), 8);
        (frame.image, frame.camera) = (None, None);
        assert_eq!(page(&frame).matches("<figure").count(), 3);
    }
}
