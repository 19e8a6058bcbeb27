use anyhow::Result;
use deepfusion_data::{convert_to_bag, convert_to_kitti};

use super::evaluate::open_with_camera;
use crate::cli::ConvertArgs;
use crate::error::CliError;
use crate::output;
use crate::progress::{Progress, say};

/// `deepfusion data convert`.
pub fn run(args: &ConvertArgs) -> Result<()> {
    let input = std::slice::from_ref(&args.input);
    let datasets = open_with_camera(input, None, args.camera, args.intrinsics)?;
    let mut progress = Progress::new("converting");
    let mut report = |done, total| progress.set(done, total);
    let to_bag = args
        .out
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("bag"));
    let written = if to_bag {
        let [dataset] = datasets.as_slice() else {
            let drives = datasets.len();
            let input = args.input.clone();
            return Err(CliError::SeveralDrives { input, drives }.into());
        };
        convert_to_bag(dataset, &args.out, args.compression.into(), &mut report)?;
        vec![args.out.clone()]
    } else {
        convert_to_kitti(&datasets, &args.out, &mut report)?
    };
    drop(progress);
    let frames: usize = datasets.iter().map(|d| d.frames().len()).sum();
    if args.json {
        return output::print_json(&serde_json::json!({ "written": written, "frames": frames }));
    }
    say(&format!("{frames} frames written"));
    for path in &written {
        output::print(&format!("{}\n", path.display()))?;
    }
    Ok(())
}
