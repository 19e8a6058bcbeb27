//! Draws every picture of this crate, and a report with them, from a simulated street:
//! `cargo run -p deepfusion-render --example gallery -- OUT_DIR`

use std::path::PathBuf;

use deepfusion_eval::{Crop, Evaluator, Grid, MeanDepthBaseline, Prediction, Protocol};
use deepfusion_geometry::DepthMap;
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_images::to_chw;
use deepfusion_render::{
    CloudView, DepthScale, HtmlReport, LineChart, PictureFormat, SamplePanel, depth_picture,
    error_picture, render_cloud, sample_panel, side_by_side, with_depth_legend,
};
use deepfusion_sim::{SimConfig, Simulation};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out = PathBuf::from(std::env::args().nth(1).ok_or("usage: gallery OUT_DIR")?);
    std::fs::create_dir_all(&out)?;
    let config = SimConfig {
        frames: 12,
        moving_cars: 3,
        ..SimConfig::default()
    };
    let simulation = Simulation::new(&config)?;
    let (first, frame) = (simulation.frame(9), simulation.frame(10));
    let scale = DepthScale::default();
    let save = |name: &str, picture: &image::RgbImage| picture.save(out.join(name));

    save(
        "depth.png",
        &with_depth_legend(&depth_picture(&frame.depth, &scale), &scale),
    )?;
    save(
        "side_by_side.png",
        &side_by_side(&frame.rgb, &frame.depth, &scale)?,
    )?;

    // A prediction that is 10 % too far on the left and 10 % too near on the right.
    let guess = tilted(&frame.depth);
    let errors = error_picture(&frame.rgb, &guess, &frame.depth)?;
    save("errors.png", &errors)?;

    let disparity: Vec<f32> = frame
        .depth
        .data
        .iter()
        .map(|d| if *d > 0.0 { 1.0 / d } else { 0.0 })
        .collect();
    let difference: Vec<f32> = frame
        .rgb
        .pixels()
        .zip(first.rgb.pixels())
        .map(|(a, b)| {
            a.0.iter()
                .zip(b.0)
                .map(|(a, b)| f32::from(a.abs_diff(b)) / 765.0)
                .sum()
        })
        .collect();
    let mask: Vec<f32> = difference
        .iter()
        .map(|d| f32::from(u8::from(*d > 0.01)))
        .collect();
    let panel = sample_panel(&SamplePanel {
        width: config.width,
        height: config.height,
        image: &to_chw(&frame.rgb),
        disparity: &disparity,
        warped: &to_chw(&first.rgb),
        error: &difference,
        mask: &mask,
        flow: None,
        moving: None,
    })?;
    save("panel.png", &panel)?;

    let cloud = PointCloud::from_depth(
        &frame.depth,
        &simulation.intrinsics(),
        Some(frame.rgb.as_raw()),
        60.0,
    )?;
    let map = render_cloud(&cloud, &CloudView::birds_eye(), 600, 600);
    let oblique = render_cloud(&cloud, &CloudView::oblique(), 1000, 600);
    save("cloud_map.png", &map)?;
    save("cloud_oblique.png", &oblique)?;

    let mut baseline = MeanDepthBaseline::new();
    let (mut evaluator, mut mean_depth_baseline) =
        (Evaluator::new(protocol())?, Evaluator::new(protocol())?);
    baseline.add_scan(&Grid::from(&first.depth));
    for i in 4..9 {
        let depth = simulation.frame(i).depth;
        let truth = Grid::from(&depth);
        let name = format!("{i:010}");
        // Where the truth has no depth, the guess has none either, so any number will do.
        let filled = tilted(&depth)
            .data
            .iter()
            .map(|d| if *d > 0.0 { f64::from(*d) } else { 80.0 })
            .collect();
        let prediction = Prediction::Depth(Grid::new(depth.width, depth.height, filled)?);
        evaluator.add(&name, &prediction, &truth)?;
        mean_depth_baseline.add(
            &name,
            &Prediction::Depth(baseline.depth_for(Some(&truth))?),
            &truth,
        )?;
    }
    let report = evaluator
        .report()?
        .with_mean_depth_baseline(&mean_depth_baseline.report()?);
    let steps = |f: fn(f64) -> f64| {
        (0..400)
            .map(|i| (f64::from(i) * 5.0, f(f64::from(i))))
            .collect::<Vec<_>>()
    };
    HtmlReport::new(
        "Gallery",
        "Every picture and table, from a simulated street and an invented prediction",
    )
    .facts(&[
        (
            "Abs Rel, unscaled",
            &format!("{:.3}", report.unscaled.abs_rel),
        ),
        (
            "mean-depth baseline",
            &format!(
                "{:.3}",
                report
                    .mean_depth_baseline
                    .map_or(f64::NAN, |t| t.unscaled.abs_rel)
            ),
        ),
        ("scale ratio", &format!("{:.3}", report.scale.median)),
        ("images", &report.n.to_string()),
    ])
    .section("Depth")
    .picture(
        "An image and its depth in metres",
        &side_by_side(&frame.rgb, &frame.depth, &scale)?,
        PictureFormat::Png,
    )?
    .picture("Relative error", &errors, PictureFormat::Png)?
    .section("Evaluation")
    .evaluation(&report)
    .section("Training")
    .chart(
        &LineChart::new("loss", "step")
            .line("photometric", steps(|i| 0.05 + 0.1 / (1.0 + i / 40.0)))
            .line("total", steps(|i| 0.06 + 0.2 / (1.0 + i / 30.0)))
            .log_y(),
    )
    .chart(
        &LineChart::new("scale ratio", "step")
            .line(
                "ratio",
                steps(|i| 1.0 + 0.5 * (-i / 60.0).exp() * (i / 9.0).cos()),
            )
            .reference(1.0, "metric"),
    )
    .picture("What a step sees", &panel, PictureFormat::Jpeg)?
    .section("Cloud")
    .picture("From above and behind", &oblique, PictureFormat::Jpeg)?
    .picture("From straight above", &map, PictureFormat::Png)?
    .section("How to repeat it")
    .command("cargo run -p deepfusion-render --example gallery -- OUT_DIR")
    .settings("simulator settings", &format!("{config:#?}"))
    .write(&out.join("report.html"))?;
    println!("{}", out.display());
    Ok(())
}

fn protocol() -> Protocol {
    Protocol {
        crop: Crop::Garg,
        ..Protocol::default()
    }
}

fn tilted(depth: &DepthMap) -> DepthMap {
    let mut out = depth.clone();
    for (i, d) in out.data.iter_mut().enumerate() {
        *d *= 1.1 - 0.2 * (i % depth.width) as f32 / depth.width as f32;
    }
    out
}
