use deepfusion_jobs::export::{Check, export};
use deepfusion_onnx::OPSET;
use deepfusion_onnx::check::PICTURES;
use serde::Serialize;

use crate::cli::ExportArgs;
use crate::failure::Result;
use crate::model;
use crate::output;
use crate::progress::say;

#[derive(Debug, Serialize)]
struct Report {
    file: String,
    bytes: usize,
    opset: i64,
    size: [usize; 2],
    depth_min_m: f64,
    depth_max_m: f64,
    training_fy_px: Option<f64>,
    /// For networks of many cameras: each camera's depth must be multiplied by its f_y divided by this.
    canonical_fy_px: Option<f64>,
    pictures: [&'static str; 4],
    checks: Vec<CheckReport>,
}

#[derive(Debug, Serialize)]
struct CheckReport {
    engine: String,
    depth_deviation: f64,
    disparity_deviation: f64,
}

/// `deepfusion export`.
pub(super) fn run(args: &ExportArgs) -> Result<()> {
    let out = &args.out;
    output::require_new(out, args.overwrite)?;
    let network = model::chosen(args.model.as_deref())?.load(args.set.as_deref())?;
    let size = args.size.map(Into::into);
    let exported = export(&network, size, args.check_with.as_deref(), out)?;
    if let Some(missing) = &exported.no_runtime {
        say(&format!("not checked with ONNX Runtime: {missing}"));
    }
    let model = &exported.model;
    let checks = exported.checks.into_iter();
    let report = Report {
        file: out.display().to_string(),
        bytes: exported.bytes,
        opset: OPSET,
        size: [model.width, model.height],
        depth_min_m: model.range.min_m,
        depth_max_m: model.range.max_m,
        training_fy_px: model.trained_with.map(|k| k.fy),
        canonical_fy_px: model.trained_with.filter(|_| model.canonical).map(|k| k.fy),
        pictures: PICTURES,
        checks: checks.map(CheckReport::from).collect(),
    };
    if args.json {
        return output::print_json(&report);
    }
    if let Some(focal) = report.canonical_fy_px {
        say(&format!(
            "the network was trained on many cameras, and its depth is for one with a focal length of {focal} pixels: multiply it by f_y / {focal}, \
             where f_y is your camera's vertical focal length in pixels of the image resized to {}x{}",
            model.width, model.height
        ));
    }
    for check in &report.checks {
        say(&format!(
            "checked with {}: depth differs by {:.1e}, disparity by {:.1e} from the network (max |difference| / max |value|, {} pictures)",
            check.engine,
            check.depth_deviation,
            check.disparity_deviation,
            PICTURES.len()
        ));
    }
    output::print(&format!("{}\n", report.file))
}

impl From<Check> for CheckReport {
    fn from(check: Check) -> Self {
        Self {
            engine: check.engine,
            depth_deviation: check.depth_deviation,
            disparity_deviation: check.disparity_deviation,
        }
    }
}
