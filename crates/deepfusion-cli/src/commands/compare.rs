//! `deepfusion compare`: evaluations side by side.

use std::path::Path;

use deepfusion_data::{Cameras, save_png};
use deepfusion_eval::compare::{Evaluation, Tables, published_tables, run_tables};
use deepfusion_jobs::evaluation::ModelSheet;
use deepfusion_render::{DepthScale, HtmlReport, PictureFormat, Tile, depth_legend, model_sheet};
use deepfusion_runtime::ModelSource;

use super::recordings::open_datasets;
use super::run_report;
use crate::cli::{CompareArgs, TableFormat};
use crate::engine;
use crate::error::CliError;
use crate::failure::Result;
use crate::output;
use crate::progress::{Progress, say};

/// Width of the legend in the page.
const LEGEND_WIDTH: u32 = 700;

/// `deepfusion compare`.
pub(super) fn run(args: &CompareArgs) -> Result<()> {
    if let Some(file) = &args.out {
        output::require_folder_of(file)?;
    }
    let mut tables = run_tables(&Evaluation::collect(&args.runs)?);
    if args.published {
        tables = tables.and(published_tables()?);
    }
    let rows = match (&args.pictures, &args.out) {
        (Some(recording), Some(out)) => {
            let rows = pictures(args, recording)?;
            let path = out.with_extension("png");
            save_png(&model_sheet(&rows, &DepthScale::default()), &path)?;
            say(&format!("pictures  {}", path.display()));
            rows
        }
        _ => Vec::new(),
    };
    let text = match args.format {
        TableFormat::Text => tables.to_text(),
        TableFormat::Csv => tables.to_csv()?,
        TableFormat::Latex => tables.to_latex(),
        TableFormat::Html => html(args, &tables, &rows)?,
    };
    match &args.out {
        Some(path) => output::write(path, text),
        None => output::print(&text),
    }
}

fn html(args: &CompareArgs, tables: &Tables, rows: &[Vec<Tile>]) -> Result<String> {
    let names: Vec<_> = args.runs.iter().map(|p| output::name_of(p)).collect();
    let mut page = HtmlReport::new("Depth, side by side", names.join(", ")).wide();
    page = page.comparison(tables);
    if let (false, Some(recording)) = (rows.is_empty(), &args.pictures) {
        page = page
            .section(&format!("Pictures of {}", output::name_of(recording)))
            .picture_grid(rows)?
            .picture(
                "Depth in metres, the same colours in all pictures",
                &depth_legend(LEGEND_WIDTH, &DepthScale::default()),
                PictureFormat::Png,
            )?;
    }
    Ok(page
        .section("Again")
        .command(&run_report::command())
        .to_html())
}

/// The same images by each model: a row an image, a column a model, with the scans where there are any.
fn pictures(args: &CompareArgs, recording: &Path) -> Result<Vec<Vec<Tile>>> {
    if let Some(file) = args.runs.iter().find(|p| !p.is_dir()) {
        return Err(CliError::NoModel { path: file.clone() }.into());
    }
    let datasets = open_datasets(&[recording.to_owned()], None, Cameras::default())?;
    let Some(mut sheet) = ModelSheet::of(&datasets, usize::from(args.picture_count))? else {
        let input = recording.display().to_string();
        return Err(deepfusion_jobs::Error::NoImages { input }.into());
    };
    let mut progress = Progress::new("predicting");
    for (done, run) in args.runs.iter().enumerate() {
        let mut estimator = engine::load(&ModelSource::named(run)?, &args.engine)?;
        sheet.add(&output::name_of(run), &mut estimator)?;
        progress.set(done + 1, args.runs.len());
    }
    Ok(sheet.into_rows())
}
