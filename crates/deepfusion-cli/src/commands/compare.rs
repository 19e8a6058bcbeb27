//! `deepfusion compare`: evaluations side by side.

use std::path::{Path, PathBuf};

use deepfusion_data::{Cameras, save_png};
use deepfusion_eval::compare::{Evaluation, Tables, published_tables, run_tables};
use deepfusion_jobs::evaluation::{ModelSheet, comparison_page};
use deepfusion_render::{DepthScale, Tile, model_sheet};
use deepfusion_runtime::ModelSource;

use super::command_line;
use super::recordings::open_datasets;
use crate::cli::{CompareArgs, TableFormat};
use crate::engine;
use crate::error::CliError;
use crate::failure::Result;
use crate::output;
use crate::progress::{Progress, say};

/// `deepfusion compare`.
pub(super) fn run(args: &CompareArgs) -> Result<()> {
    let sheet = pictures_beside(args)?;
    for file in args.out.iter().chain(&sheet) {
        output::require_new(file, args.overwrite)?;
    }
    let mut tables = run_tables(&Evaluation::collect(&args.runs)?);
    if args.published {
        tables = tables.and(published_tables()?);
    }
    let rows = match (&args.pictures, &sheet) {
        (Some(recording), Some(path)) => {
            let rows = pictures(args, recording)?;
            save_png(&model_sheet(&rows, &DepthScale::default()), path)?;
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
        Some(path) => {
            output::write(path, text)?;
            say(&format!("tables    {}", path.display()));
            Ok(())
        }
        None => output::print(&text),
    }
}

/// The file for the pictures, if there are any: the name of the tables' file with the ending `png`.
fn pictures_beside(args: &CompareArgs) -> Result<Option<PathBuf>> {
    let (Some(_), Some(out)) = (&args.pictures, &args.out) else {
        return Ok(None);
    };
    let sheet = out.with_extension("png");
    if sheet == *out {
        return Err(CliError::TablesInPicture { path: sheet }.into());
    }
    Ok(Some(sheet))
}

fn html(args: &CompareArgs, tables: &Tables, rows: &[Vec<Tile>]) -> Result<String> {
    let recording = args.pictures.as_deref().filter(|_| !rows.is_empty());
    let pictures = recording.map(|recording| (recording, rows));
    let command = command_line::typed_again();
    Ok(comparison_page(&args.runs, tables, pictures, &command)?.to_html())
}

/// The same images predicted by each model: one row per image and one column per model, with the scans if there are any.
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
