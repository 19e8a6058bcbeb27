//! `deepfusion compare`: evaluations side by side.

use std::path::Path;

use deepfusion_data::{Cameras, Dataset, GtKind, RgbImage, save_png};
use deepfusion_eval::compare::{Evaluation, Tables, published_tables, run_tables};
use deepfusion_render::{
    DepthScale, HtmlReport, PictureFormat, Tile, depth_legend, depth_picture, model_sheet,
    shrink_depth, shrink_picture, sparse_depth_picture,
};
use deepfusion_runtime::ModelSource;

use super::recordings::open_datasets;
use super::{eval, run_report};
use crate::cli::{CompareArgs, TableFormat};
use crate::engine;
use crate::error::CliError;
use crate::failure::Result;
use crate::output;
use crate::progress::{Progress, say};

/// Width of each picture, and of the legend in the page.
const TILE_WIDTH: u32 = 420;
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
    let frames = spread(&datasets, usize::from(args.picture_count));
    if frames.is_empty() {
        return Err(CliError::NoImages {
            input: recording.display().to_string(),
        }
        .into());
    }
    let scale = DepthScale::default();
    let mut rows: Vec<Vec<Tile>> = vec![Vec::new(); frames.len()];
    let mut truths = Vec::new();
    for (row, (number, frame)) in rows.iter_mut().zip(&frames) {
        let dataset = &datasets[*number];
        let image = dataset.load_image(*frame)?;
        let depth = dataset.ground_truth(*frame, GtKind::Z)?;
        let small = shrink_picture(&image, TILE_WIDTH);
        truths.push(match depth {
            Some(depth) => Some(sparse_depth_picture(
                &small,
                &shrink_depth(&depth, small.dimensions()),
                &scale,
            )?),
            None => None,
        });
        let name = format!("image {}", dataset.frames()[*frame].number);
        row.push(Tile::new(name, small));
    }
    let mut progress = Progress::new("predicting");
    for (done, run) in args.runs.iter().enumerate() {
        let mut estimator = engine::load(&ModelSource::named(run)?, &args.engine)?;
        for (row, (number, frame)) in rows.iter_mut().zip(&frames) {
            let dataset = &datasets[*number];
            let image = dataset.load_image(*frame)?;
            let camera = dataset.intrinsics(*frame);
            let prediction = eval::predict(&mut estimator, &image, &camera, true)?;
            let (width, height) = row[0].picture.dimensions();
            let depth = prediction.depth_at(width as usize, height as usize);
            row.push(Tile::new(
                output::name_of(run),
                depth_picture(&depth, &scale),
            ));
        }
        progress.set(done + 1, args.runs.len());
    }
    if truths.iter().any(Option::is_some) {
        for (row, truth) in rows.iter_mut().zip(truths) {
            let (width, height) = row[0].picture.dimensions();
            let none = || RgbImage::new(width, height);
            row.push(Tile::new("ground truth", truth.unwrap_or_else(none)));
        }
    }
    Ok(rows)
}

/// Frames that are evenly spread over all recordings, those with ground truth first of all where there are enough.
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
    // The middles of equal stretches.
    (0..count)
        .map(|i| frames[(2 * i + 1) * frames.len() / (2 * count)])
        .collect()
}
