//! Pictures of a frame for a demo's page, each also saved as a file.

use std::path::{Path, PathBuf};

use deepfusion_data::{Dataset, RgbImage, save_png, write_depth_png};
use deepfusion_eval::IntervalFactors;
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_render::{
    CloudView, DepthScale, HtmlReport, PictureFormat, depth_picture, error_picture, render_cloud,
    side_by_side, with_depth_legend,
};
use deepfusion_runtime::DepthEstimator;

use crate::{Result, files, intervals};

/// Largest depth of the cloud's points, in metres.
const CLOUD_REACH_M: f32 = 60.0;

/// A frame and the depth that a network predicts for it.
pub struct ShownPrediction {
    number: u64,
    image: RgbImage,
    camera: Intrinsics,
    depth: DepthMap,
    /// Standard deviation in metres, if the network predicts it.
    sigma: Option<DepthMap>,
    truth: DepthMap,
    scale: DepthScale,
    /// Folder for the pictures.
    folder: PathBuf,
}

impl ShownPrediction {
    /// Predicts a frame of a simulated drive; `factors` are the network's interval factors. The pictures' folder is created.
    ///
    /// # Errors
    /// A folder that cannot be created; an image or exact depth that cannot be read; the error of the network's engine.
    pub fn of(
        (estimator, factors): (&mut DepthEstimator, &IntervalFactors),
        drive: &Dataset,
        frame: usize,
        folder: PathBuf,
    ) -> Result<Self> {
        std::fs::create_dir_all(&folder).map_err(|e| deepfusion_data::Error::file(&folder, e))?;
        let image = drive.load_image(frame)?;
        let camera = drive.intrinsics(frame);
        let prediction = estimator.predict(&image, Some(&camera), true, true)?;
        let depth = prediction.depth();
        Ok(Self {
            number: drive.frames()[frame].number,
            image,
            camera,
            sigma: intervals::sigma(&prediction, &depth, factors),
            depth,
            truth: exact_depth(drive, frame)?,
            scale: DepthScale::default(),
            folder,
        })
    }

    fn path(&self, what: &str) -> PathBuf {
        self.folder.join(format!("{:010}_{what}.png", self.number))
    }

    /// Writes the image beside its depth, and the depth; `mark` is added to the files' names. Returns the first file's path.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, mark: &str) -> Result<PathBuf> {
        let side = side_by_side(&self.image, &self.depth, &self.scale)?;
        let path = self.path(&format!("side{mark}"));
        save_png(&side, &path)?;
        write_depth_png(&self.depth, &self.path(&format!("depth{mark}")))?;
        Ok(path)
    }

    /// Writes the point cloud, with the standard deviation of each point.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_cloud(&self, path: &Path) -> Result<()> {
        let mut cloud = self.cloud()?;
        let sigma = self.sigma.as_ref();
        cloud.sigma =
            sigma.map(|sigma| PointCloud::column(&sigma.data, &self.depth, CLOUD_REACH_M));
        let mut bytes = Vec::new();
        cloud.write_ply(&mut bytes)?;
        Ok(files::write(path, bytes)?)
    }

    /// The picture of the frame with its targets, from the output folder of a run that found them; `None` if it is missing.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn overlay_in(&self, targets: &Path) -> Result<Option<PathBuf>> {
        let end = format!("{:010}_overlay.png", self.number);
        let failed = |e| deepfusion_data::Error::file(targets, e);
        for entry in std::fs::read_dir(targets).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if path.to_string_lossy().ends_with(&end) {
                return Ok(Some(path));
            }
        }
        Ok(None)
    }

    fn cloud(&self) -> Result<PointCloud> {
        let colours = Some(self.image.as_raw().as_slice());
        Ok(PointCloud::from_depth(
            &self.depth,
            &self.camera,
            colours,
            CLOUD_REACH_M,
        )?)
    }

    /// Adds the image beside its depth.
    pub(super) fn add_to(&self, page: HtmlReport, what: &str) -> Result<HtmlReport> {
        let side = side_by_side(&self.image, &self.depth, &self.scale)?;
        let caption = format!("Frame {}: the image, and {what}", self.number);
        Ok(page.picture(&caption, &side, PictureFormat::Jpeg)?)
    }

    /// Adds the exact depth and the error of the prediction, and saves both as files.
    pub(super) fn add_truth_to(&self, page: HtmlReport) -> Result<HtmlReport> {
        let exact = with_depth_legend(&depth_picture(&self.truth, &self.scale), &self.scale);
        save_png(&exact, &self.path("truth"))?;
        let page = page.picture("The same frame: exact depth", &exact, PictureFormat::Png)?;
        self.add_error_to(page, "error", "Relative error of the prediction")
    }

    /// Adds a picture of the prediction's error; `mark` is the file's name.
    pub(super) fn add_error_to(
        &self,
        page: HtmlReport,
        mark: &str,
        caption: &str,
    ) -> Result<HtmlReport> {
        let errors = error_picture(&self.image, &self.depth, &self.truth)?;
        save_png(&errors, &self.path(mark))?;
        Ok(page.picture(caption, &errors, PictureFormat::Png)?)
    }

    /// Adds the point cloud, seen from two directions.
    pub(super) fn add_cloud_to(&self, mut page: HtmlReport) -> Result<HtmlReport> {
        let cloud = self.cloud()?;
        for (view, caption) in [
            (
                CloudView::oblique(),
                "The point cloud, from above and behind the camera",
            ),
            (
                CloudView::birds_eye(),
                "The point cloud from straight above, 10 m grid",
            ),
        ] {
            let picture = render_cloud(&cloud, &view, 960, 540);
            page = page.picture(caption, &picture, PictureFormat::Png)?;
        }
        Ok(page)
    }
}

/// Reads the exact depth that the simulator wrote for a frame.
fn exact_depth(drive: &Dataset, frame: usize) -> Result<DepthMap> {
    let name = format!("{:010}.png", drive.frames()[frame].number);
    let folder = drive.folder().join("proj_depth/groundtruth/image_02");
    Ok(deepfusion_data::read_depth_png(&folder.join(name))?)
}
