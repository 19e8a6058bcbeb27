//! The page of evaluations side by side.

use std::path::{Path, PathBuf};

use deepfusion_eval::compare::Tables;
use deepfusion_render::{DepthScale, HtmlReport, PictureFormat, Tile, depth_legend};

use crate::{Result, name_of};

/// Width of the legend.
const LEGEND_WIDTH: u32 = 700;

/// The page of these tables of runs, with pictures of a recording where there are any ([`super::ModelSheet`]); `command` makes it again.
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
    Ok(page.section("Again").command(command))
}
