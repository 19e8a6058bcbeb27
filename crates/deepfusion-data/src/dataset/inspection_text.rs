//! An inspection as text.

use super::inspection::{DriveInspection, Inspection, SpeedRange, Stream, Unreadable};
use super::kind::DatasetKind;
use deepfusion_hint::count_of;
use std::fmt;

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let layout = self.kind.label();
        match self.size {
            Some([w, h]) => {
                let frames = count_of(self.frames, "frame");
                writeln!(f, "{layout}, {frames} of {w}x{h}")?;
            }
            None if self.drives.is_empty() => writeln!(f, "{layout}, unreadable")?,
            None => writeln!(f, "{layout} without images")?,
        }
        if let Some(k) = &self.intrinsics {
            writeln!(
                f,
                "camera: fx {:.2}, fy {:.2}, cx {:.2}, cy {:.2} px",
                k.fx, k.fy, k.cx, k.cy
            )?;
        }
        for one in &self.drives {
            drive(f, self.kind, one)?;
        }
        for Unreadable { path, error } in &self.unreadable {
            writeln!(f, "\n{}\n  cannot be read: {error}", path.display())?;
        }
        if self.drives.is_empty() {
            return Ok(());
        }
        streams(f, &self.streams)
    }
}

/// Writes the lines about a drive.
fn drive(f: &mut fmt::Formatter<'_>, kind: DatasetKind, drive: &DriveInspection) -> fmt::Result {
    let known = |value: Option<f64>, unit: &str| match value {
        Some(value) => format!("{:.1} {unit}", unsigned_zero(value)),
        None => "unknown".into(),
    };
    let speed = |range: Option<SpeedRange>| match range {
        Some(r) => {
            let [min, max, mean] = [r.min, r.max, r.mean].map(unsigned_zero);
            format!("{min:.1} to {max:.1} m/s, mean {mean:.1}")
        }
        None => "unknown".into(),
    };
    // Only KITTI numbers its cameras.
    match kind {
        DatasetKind::KittiRaw => writeln!(f, "\n{} (camera {})", drive.name, drive.camera)?,
        _ => writeln!(f, "\n{}", drive.name)?,
    }
    writeln!(
        f,
        "  frames    {}{}",
        drive.frames,
        missing(&drive.missing_frames)
    )?;
    writeln!(
        f,
        "  driven    {} in {}, turned {}",
        known(drive.distance_m, "m"),
        known(drive.duration_s, "s"),
        known(drive.turn_rad.map(f64::to_degrees), "degrees")
    )?;
    writeln!(f, "  speed     {}", speed(drive.speed_mps))?;
    let ms = |seconds: f64| 1e3 * seconds;
    if drive.camera_ahead_s != 0.0 {
        writeln!(
            f,
            "  clocks    camera ahead by {:.0} ms (as given), subtracted from its times",
            ms(drive.camera_ahead_s)
        )?;
    }
    if let Some(offset) = drive.time_offset {
        writeln!(
            f,
            "  clocks    vehicle minus camera {:.0} ms, standard error {:.0} ms",
            ms(offset.vehicle_minus_camera_s),
            ms(offset.std_error_s)
        )?;
    }
    writeln!(f, "  pairs     {} usable for training", drive.usable_pairs)?;
    if let Some(why) = &drive.why_no_pairs {
        writeln!(f, "            {why}")?;
    }
    writeln!(
        f,
        "  scans     {} with ground truth",
        count_of(drive.scans, "frame")
    )?;
    for mount in &drive.mounts {
        let three = |v: [f64; 3], digits: usize| {
            v.map(|x| format!("{:.digits$}", unsigned_zero(x)))
                .join(", ")
        };
        writeln!(
            f,
            "  mount     {}: {} m, turned by {} rad; {}",
            mount.name,
            three(mount.translation, 3),
            three(mount.rotation, 4),
            mount.source
        )?;
    }
    for warning in &drive.warnings {
        writeln!(f, "  note      {warning}")?;
    }
    Ok(())
}

/// Writes the table of streams.
fn streams(f: &mut fmt::Formatter<'_>, streams: &[Stream]) -> fmt::Result {
    let width = streams.iter().map(|s| s.name.len()).max().unwrap_or(0);
    let width = width.max("stream".len());
    writeln!(
        f,
        "\n{:width$}  {:11}  {:>6}  {:>7}  {:>4}",
        "stream", "type", "count", "rate", "gaps"
    )?;
    for s in streams {
        let rate = s
            .rate_hz
            .map_or_else(|| "-".into(), |r| format!("{r:.1} Hz"));
        writeln!(
            f,
            "{:width$}  {:11}  {:>6}  {rate:>7}  {:>4}",
            s.name, s.kind, s.count, s.gaps
        )?;
    }
    Ok(())
}

/// The value, or 0 if it would be printed as −0.0.
fn unsigned_zero(value: f64) -> f64 {
    if value.abs() < 0.05 { 0.0 } else { value }
}

/// `, missing 3, 7-9` with the first few ranges.
fn missing(ranges: &[[u64; 2]]) -> String {
    if ranges.is_empty() {
        return String::new();
    }
    let show = |[from, to]: &[u64; 2]| {
        if from == to {
            from.to_string()
        } else {
            format!("{from}-{to}")
        }
    };
    let shown: Vec<String> = ranges.iter().take(6).map(show).collect();
    let more = if ranges.len() > shown.len() {
        ", …"
    } else {
        ""
    };
    format!(", missing {}{more}", shown.join(", "))
}
