//! The drawn points as a table, for making one's own figures: the paper's Table 2 and Fig. 10.

use crate::compare::Result;
use crate::{DrawnPoint, ImageScore};

/// The columns. Positions are in the camera frame (x right, y down, z forward), in metres. `scaled` is after each image's depth was
/// multiplied by median(gt) / median(prediction).
const HEADER: [&str; 16] = [
    "image",
    "u",
    "v",
    "gt_x_m",
    "gt_y_m",
    "gt_z_m",
    "pred_x_m",
    "pred_y_m",
    "pred_z_m",
    "error_m",
    "abs_rel",
    "scaled_x_m",
    "scaled_y_m",
    "scaled_z_m",
    "scaled_error_m",
    "scaled_abs_rel",
];

/// Drawn points as CSV, one row each, in the order they were drawn. `images` are the images they come from. Without a camera (`in_space` is
/// false), x and y are empty and errors are along z.
///
/// # Errors
/// The CSV writer's errors.
pub fn points_csv(points: &[DrawnPoint], images: &[ImageScore], in_space: bool) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(HEADER)?;
    for point in points {
        let image = images.get(point.image);
        let mut row = vec![image.map_or_else(String::new, |image| image.name.clone())];
        row.extend(point.pixel.map(|side| side.to_string()));
        row.extend(place(point.truth, in_space));
        for (predicted, error) in [
            (point.predicted, point.distance_m()),
            (point.median_scaled, point.median_scaled_distance_m()),
        ] {
            row.extend(place(predicted, in_space));
            row.push(metres(error));
            let (z, true_z) = (predicted[2], point.truth[2]);
            row.push(format!("{:.5}", (z - true_z).abs() / true_z));
        }
        writer.write_record(row)?;
    }
    let bytes = writer.into_inner();
    Ok(bytes.map_err(|e| csv::Error::from(e.into_error()))?)
}

fn metres(m: f64) -> String {
    format!("{m:.4}")
}

fn place([x, y, z]: [f64; 3], in_space: bool) -> [String; 3] {
    let sideways = |m: f64| if in_space { metres(m) } else { String::new() };
    [sideways(x), sideways(y), metres(z)]
}
