//! The drives' own cameras, which simulated views are rendered through.

use deepfusion_data::{Dataset, PLAUSIBLE_HEIGHT_M, road_camera_height};
use deepfusion_geometry::{Intrinsics, Se3};
use deepfusion_model::SimulatedCamera;
use nalgebra::Vector3;

use crate::Result;

/// Cameras whose intrinsics differ by less than this, as a share of the focal length, count as one.
const SAME: f64 = 0.01;
/// The most drives on which a camera's height is measured.
const MEASURED_ON: usize = 3;
/// The most cameras: a fleet has few kinds of them.
const MOST: usize = 16;

/// The cameras of the drives, each once: the lens as recorded; pitch and roll from the mount's calibration, if there is one; the height
/// measured by the motion of the road in the images ([`road_camera_height`]; the median of up to three drives), if they show it.
///
/// # Errors
/// An image that cannot be read.
pub(super) fn of_drives(drives: &[Dataset]) -> Result<Vec<SimulatedCamera>> {
    let mut groups: Vec<(Intrinsics, Vec<&Dataset>)> = Vec::new();
    for drive in drives {
        let Some(&frame) = drive.selected().first() else {
            continue;
        };
        let k = drive.intrinsics(frame);
        match groups.iter_mut().find(|(other, _)| is_same(other, &k)) {
            Some((_, of_camera)) => of_camera.push(drive),
            None => groups.push((k, vec![drive])),
        }
    }
    groups
        .iter()
        .take(MOST)
        .map(|(k, drives)| Ok(camera(k, tilt(drives), height(drives)?)))
        .collect()
}

fn is_same(a: &Intrinsics, b: &Intrinsics) -> bool {
    let near = |a: f64, b: f64, focal: f64| (a - b).abs() < SAME * focal;
    (a.width, a.height) == (b.width, b.height)
        && near(a.fx, b.fx, a.fx)
        && near(a.fy, b.fy, a.fy)
        && near(a.cx, b.cx, a.fx)
        && near(a.cy, b.cy, a.fy)
}

fn camera(k: &Intrinsics, (pitch, roll): (f64, f64), height_m: Option<f64>) -> SimulatedCamera {
    SimulatedCamera {
        width: k.width,
        height: k.height,
        fx: k.fx,
        fy: k.fy,
        cx: k.cx,
        cy: k.cy,
        height_m,
        pitch_degrees: pitch.to_degrees(),
        roll_degrees: roll.to_degrees(),
    }
}

/// Height above the road in metres; `None` if the images do not show it, or the camera is not on a vehicle.
fn height(drives: &[&Dataset]) -> Result<Option<f64>> {
    let mut heights = Vec::new();
    for drive in drives.iter().take(MEASURED_ON) {
        let seen = road_camera_height(drive)?.map(|(height, _)| height);
        heights.extend(seen.filter(|height| PLAUSIBLE_HEIGHT_M.contains(height)));
    }
    heights.sort_by(f64::total_cmp);
    Ok(heights.get(heights.len() / 2).copied())
}

/// Pitch and roll of the first known mount, otherwise zero.
fn tilt(drives: &[&Dataset]) -> (f64, f64) {
    let known = drives.iter().find_map(|drive| drive.cam_from_vehicle());
    known.map_or((0.0, 0.0), |mounting| tilt_of(&mounting))
}

/// The camera's downward pitch and its clockwise roll, in radians.
fn tilt_of(cam_from_vehicle: &Se3) -> (f64, f64) {
    let vehicle_from_cam = cam_from_vehicle.inverse();
    let up = |axis| vehicle_from_cam.rotate(&axis).z;
    let pitch = (-up(Vector3::z())).clamp(-1.0, 1.0).asin();
    let roll = (-up(Vector3::x())).atan2(-up(Vector3::y()));
    (pitch, roll)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Rotation3};

    #[test]
    fn the_tilt_of_a_mount_is_found() {
        // Right, down and forward of a level camera, in the vehicle's axes (forward, left, up).
        let level = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
        for (pitch, roll) in [(0.0, 0.0), (0.1, 0.0), (-0.2, 0.05), (0.05, -0.3)] {
            let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.02)
                * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch)
                * Rotation3::from_axis_angle(&Vector3::x_axis(), roll);
            let vehicle_from_cam =
                Se3::from_parts(&(turned.matrix() * level), Vector3::new(1.0, 0.0, 1.2));
            let found = tilt_of(&vehicle_from_cam.inverse());
            assert!(
                (found.0 - pitch).abs() < 1e-12 && (found.1 - roll).abs() < 1e-12,
                "{found:?}"
            );
        }
    }

    #[test]
    fn nearly_equal_cameras_count_as_one() {
        let k = Intrinsics::from_numbers([721.5, 721.5, 609.6, 172.9], (1242, 375));
        let near = Intrinsics {
            fx: 718.9,
            cx: 607.2,
            ..k
        };
        assert!(is_same(&k, &near));
        assert!(!is_same(&k, &Intrinsics { fx: 700.0, ..k }));
        assert!(!is_same(&k, &Intrinsics { width: 1241, ..k }));
    }
}
