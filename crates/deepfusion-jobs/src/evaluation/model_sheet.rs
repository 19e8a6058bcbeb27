//! Several models side by side: a sheet with the same images predicted by each, and the page with it.

use std::path::{Path, PathBuf};

use deepfusion_data::{Dataset, GtKind, RgbImage};
use deepfusion_eval::compare::Tables;
use deepfusion_render::{
    DepthScale, HtmlReport, PictureFormat, Tile, depth_legend, depth_picture, shrink_depth,
    shrink_picture, sparse_depth_picture,
};
use deepfusion_runtime::DepthEstimator;

use super::predict;
use crate::{Result, name_of};

/// Width of each picture.
const TILE_WIDTH: u32 = 420;
/// Width of the colour legend.
const LEGEND_WIDTH: u32 = 700;

/// A sheet with a row for each image and a column for each model; scans are in the last column, if there are any.
pub struct ModelSheet<'a> {
    datasets: &'a [Dataset],
    /// For each row, the index of its recording and of its frame.
    frames: Vec<(usize, usize)>,
    rows: Vec<Vec<Tile>>,
    truths: Vec<Option<RgbImage>>,
}

impl<'a> ModelSheet<'a> {
    /// A sheet of at most `count` images, evenly spread over the recordings; frames with ground truth are preferred if there are enough.
    /// `None` if there is no image.
    ///
    /// # Errors
    /// An image or a scan that cannot be read.
    pub fn of(datasets: &'a [Dataset], count: usize) -> Result<Option<Self>> {
        let frames = spread(datasets, count);
        if frames.is_empty() {
            return Ok(None);
        }
        let (mut rows, mut truths) = (Vec::new(), Vec::new());
        for (number, frame) in &frames {
            let dataset = &datasets[*number];
            let small = shrink_picture(&dataset.load_image(*frame)?, TILE_WIDTH);
            let truth = match dataset.ground_truth(*frame, GtKind::Z)? {
                Some(depth) => Some(sparse_depth_picture(
                    &small,
                    &shrink_depth(&depth, small.dimensions()),
                    &DepthScale::default(),
                )?),
                None => None,
            };
            truths.push(truth);
            let name = format!("image {}", dataset.frames()[*frame].number);
            rows.push(vec![Tile::new(name, small)]);
        }
        Ok(Some(Self {
            datasets,
            frames,
            rows,
            truths,
        }))
    }

    /// Adds a model's column.
    ///
    /// # Errors
    /// An image that cannot be read; the error of the network's engine.
    pub fn add(&mut self, name: &str, estimator: &mut DepthEstimator) -> Result<()> {
        for (row, (number, frame)) in self.rows.iter_mut().zip(&self.frames) {
            let dataset = &self.datasets[*number];
            let image = dataset.load_image(*frame)?;
            let camera = dataset.intrinsics(*frame);
            let prediction = predict(estimator, &image, &camera, true)?;
            let (width, height) = row[0].picture.dimensions();
            let depth = prediction.depth_at(width as usize, height as usize);
            row.push(Tile::new(
                name,
                depth_picture(&depth, &DepthScale::default()),
            ));
        }
        Ok(())
    }

    /// The finished rows.
    #[must_use]
    pub fn into_rows(mut self) -> Vec<Vec<Tile>> {
        if self.truths.iter().any(Option::is_some) {
            for (row, truth) in self.rows.iter_mut().zip(self.truths) {
                let (width, height) = row[0].picture.dimensions();
                let none = || RgbImage::new(width, height);
                row.push(Tile::new("ground truth", truth.unwrap_or_else(none)));
            }
        }
        self.rows
    }
}

/// Frames evenly spread over all recordings: indices of recording and frame.
fn spread(datasets: &[Dataset], count: usize) -> Vec<(usize, usize)> {
    let all = |wanted: &dyn Fn(&Dataset, usize) -> bool| -> Vec<(usize, usize)> {
        let each = datasets.iter().enumerate();
        each.flat_map(|(number, dataset)| {
            let frames = dataset.selected().iter().copied();
            let frames = frames.filter(move |f| wanted(dataset, *f));
            frames.map(move |f| (number, f)).collect::<Vec<_>>()
        })
        .collect()
    };
    let known = all(&|dataset, frame| dataset.has_ground_truth(frame, GtKind::Z));
    let frames = if known.len() >= count {
        known
    } else {
        all(&|_, _| true)
    };
    let count = count.min(frames.len());
    // The middles of equal sections.
    (0..count)
        .map(|i| frames[(2 * i + 1) * frames.len() / (2 * count)])
        .collect()
}

/// The page with tables that compare runs, and with pictures of a recording if there are any ([`ModelSheet`]); `command` makes it again.
///
/// # Errors
/// A picture that cannot be encoded.
pub fn comparison_page(
    runs: &[PathBuf],
    tables: &Tables,
    pictures: Option<(&Path, &[Vec<Tile>])>,
    command: &str,
) -> Result<HtmlReport> {
    let names: Vec<_> = runs.iter().map(|p| name_of(p)).collect();
    let mut page = HtmlReport::new("Depth, side by side", names.join(", ")).wide();
    page = page.comparison(tables);
    if let Some((recording, rows)) = pictures {
        page = page
            .section(&format!("Pictures of {}", name_of(recording)))
            .picture_grid(rows)?
            .picture(
                "Depth in metres, the same colours in all pictures",
                &depth_legend(LEGEND_WIDTH, &DepthScale::default()),
                PictureFormat::Png,
            )?;
    }
    Ok(page.section("Reproduce").command(command))
}
