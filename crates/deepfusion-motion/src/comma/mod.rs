//! A segment of comma2k19 (Schafer et al. 2018): one minute of a car's CAN bus, inertial unit and
//! satellite-fused pose, as arrays in a folder.
//!
//! | Folder | Arrays | Read as |
//! |---|---|---|
//! | `processed_log/CAN/speed` | `t`, `value` (N×1) | forward speed, m/s |
//! | `processed_log/CAN/steering_angle` | `t`, `value` (N) | steering wheel, degrees, positive to the left |
//! | `processed_log/CAN/wheel_speed` | `t`, `value` (N×4) | their mean is the speed if there is no `speed` |
//! | `processed_log/IMU/accelerometer`, `gyro` | `t`, `value` (N×3) | x forward, y right, z down of the device; m/s², rad/s |
//! | `global_pose/frame_*` | times, positions, velocities (ECEF), orientations (`ecef_from_device`, w x y z) | the reference |
//!
//! All times are seconds since the device's boot. Axes and signs were found by comparing the gyro with
//! the derivative of the orientations: each axis correlates at 0.92 to 1.00 with itself, and the
//! accelerometer at rest reads −9.7 along the device's z.

mod npy;
mod reference;

pub use crate::error::{ArrayProblem, TimesArray};
use crate::{Error, ImuSample, Result, Signal, VehicleSensors};
use deepfusion_geometry::Trajectory;
use nalgebra::Vector3;
use npy::Table;
use std::path::Path;

/// A comma2k19 segment.
#[derive(Debug, Clone)]
pub struct CommaSegment {
    /// Speed, steering wheel's angle and inertial unit (axes: [`crate::ImuMount::forward_right_down`]).
    pub sensors: VehicleSensors,
    /// Speeds of the four wheels in m/s, in the file's order, if the segment has them.
    pub wheel_speeds_mps: Vec<Signal>,
    /// The car's reference trajectory: `world_from_vehicle` over time. World: east, north, up at the
    /// first pose, in metres; vehicle: x forward, y left, z up of the **device**, which looks a few
    /// degrees down. Empty without `global_pose`.
    pub reference: Trajectory,
    /// Times of the video's frames, in seconds. Empty without `global_pose`.
    pub frame_times_s: Vec<f64>,
}

impl CommaSegment {
    /// Reads a segment's folder. Steering, inertial unit and pose may be absent; the speed may not.
    ///
    /// # Errors
    /// [`Error::ArrayFile`] and [`Error::Array`], naming the array that is missing or does not match the layout.
    pub fn open(folder: &Path) -> Result<Self> {
        let (sensors, wheel_speeds_mps) = recorded(folder)?;
        let (reference, frame_times_s) = reference::read(&folder.join("global_pose"))?;
        Ok(Self {
            sensors,
            wheel_speeds_mps,
            reference,
            frame_times_s,
        })
    }
}

/// Reads a segment's [`CommaSegment::sensors`] without its reference.
///
/// # Errors
/// As [`CommaSegment::open`].
pub fn sensors(folder: &Path) -> Result<VehicleSensors> {
    recorded(folder).map(|(sensors, _)| sensors)
}

/// Reads the numbers of an array with shape N or N×1, such as `processed_log/CAN/speed/t`.
///
/// # Errors
/// [`Error::ArrayFile`]; [`Error::Array`] if it is not such an array.
pub fn numbers(path: &Path) -> Result<Vec<f64>> {
    Ok(Table::read(path, 1)?.values)
}

/// The sensors, and the speed of each wheel.
fn recorded(folder: &Path) -> Result<(VehicleSensors, Vec<Signal>)> {
    let log = folder.join("processed_log");
    let wheels = optional(&log.join("CAN/wheel_speed"), 4)?;
    let wheel_speeds_mps: Vec<Signal> = wheels
        .iter()
        .flat_map(|w| (0..4).map(|wheel| column(w, wheel)))
        .collect();
    let speed_folder = log.join("CAN/speed");
    let speed_mps = match wheels {
        Some(wheels) if !speed_folder.exists() => {
            let mean = |row: &[f64]| row.iter().sum::<f64>() / row.len() as f64;
            Signal::new(wheels.rows().map(|(t, row)| (t, mean(row))))
        }
        _ => column(&Stream::read(&speed_folder, 1)?, 0),
    };
    let steering_rad =
        optional(&log.join("CAN/steering_angle"), 1)?.map(|s| column(&s, 0).map(f64::to_radians));
    let accelerometer = optional(&log.join("IMU/accelerometer"), 3)?;
    let gyro = optional(&log.join("IMU/gyro"), 3)?;
    let imu = accelerometer.zip(gyro).map(|(a, g)| join_imu(&a, &g));
    let sensors = VehicleSensors {
        speed_mps,
        steering_rad,
        imu,
    };
    Ok((sensors, wheel_speeds_mps))
}

/// A folder with the arrays `t` and `value`.
struct Stream {
    time_s: Vec<f64>,
    value: Table,
}

impl Stream {
    fn read(folder: &Path, columns: usize) -> Result<Self> {
        let time_s = Table::read(&folder.join("t"), 1)?.values;
        let path = folder.join("value");
        let value = Table::read(&path, columns)?;
        if value.values.len() != time_s.len() * columns {
            return Err(Error::Array {
                path,
                problem: ArrayProblem::Rows {
                    rows: value.values.len() / columns,
                    times: TimesArray::Beside,
                    expected: time_s.len(),
                },
            });
        }
        Ok(Self { time_s, value })
    }

    fn rows(&self) -> impl Iterator<Item = (f64, &[f64])> {
        let columns = self.value.columns;
        let rows = self.value.values.chunks_exact(columns);
        self.time_s.iter().copied().zip(rows)
    }
}

fn optional(folder: &Path, columns: usize) -> Result<Option<Stream>> {
    folder
        .exists()
        .then(|| Stream::read(folder, columns))
        .transpose()
}

fn column(stream: &Stream, index: usize) -> Signal {
    Signal::new(stream.rows().map(|(t, row)| (t, row[index])))
}

/// Accelerometer and gyro at the gyro's times: the two arrive together, but have separate files.
fn join_imu(accelerometer: &Stream, gyro: &Stream) -> Vec<ImuSample> {
    let axes = [0, 1, 2].map(|i| column(accelerometer, i));
    let joined = gyro.rows().filter_map(|(time_s, rate)| {
        let [x, y, z] = [&axes[0], &axes[1], &axes[2]].map(|axis| axis.at(time_s));
        Some(ImuSample {
            time_s,
            acceleration_mps2: Vector3::new(x?, y?, z?),
            angular_rate_radps: Vector3::new(rate[0], rate[1], rate[2]),
        })
    });
    joined.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;
    use ndarray::{Array1, Array2};
    use ndarray_npy::write_npy;
    use std::fs;

    fn write(folder: &Path, times: &[f64], rows: &[Vec<f64>]) {
        fs::create_dir_all(folder).unwrap();
        write_npy(folder.join("t.npy"), &Array1::from(times.to_vec())).unwrap();
        let flat: Vec<f64> = rows.concat();
        let shape = (rows.len(), rows[0].len());
        let array = Array2::from_shape_vec(shape, flat).unwrap();
        write_npy(folder.join("value.npy"), &array).unwrap();
        for name in ["t", "value"] {
            fs::rename(folder.join(format!("{name}.npy")), folder.join(name)).unwrap();
        }
    }

    fn times(n: usize) -> Vec<f64> {
        (0..n).map(|i| 100.0 + i as f64 * 0.01).collect()
    }

    #[test]
    fn a_segment_without_pose_and_imu_has_its_speed() {
        let dir = tempfile::tempdir().unwrap();
        let can = dir.path().join("processed_log/CAN");
        write(&can.join("speed"), &times(50), &vec![vec![12.0]; 50]);
        write(
            &can.join("steering_angle"),
            &times(50),
            &vec![vec![90.0]; 50],
        );
        let segment = CommaSegment::open(dir.path()).unwrap();
        assert_eq!(segment.sensors.speed_mps.at(100.2), Some(12.0));
        let steering = segment.sensors.steering_rad.unwrap().at(100.2).unwrap();
        assert!((steering - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert!(segment.sensors.imu.is_none() && segment.reference.poses().is_empty());
    }

    #[test]
    fn wheel_speeds_replace_a_missing_speed() {
        let dir = tempfile::tempdir().unwrap();
        let can = dir.path().join("processed_log/CAN");
        let rows = vec![vec![9.0, 11.0, 10.0, 10.4]; 50];
        write(&can.join("wheel_speed"), &times(50), &rows);
        let segment = CommaSegment::open(dir.path()).unwrap();
        assert!((segment.sensors.speed_mps.at(100.1).unwrap() - 10.1).abs() < 1e-12);
        assert_eq!(segment.wheel_speeds_mps[1].at(100.1), Some(11.0));
    }

    #[test]
    fn missing_and_mismatched_arrays_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let error = CommaSegment::open(dir.path()).unwrap_err();
        assert!(
            error
                .to_string()
                .ends_with("CAN/speed/t: no such file or folder"),
            "{error}"
        );
        assert!(error.hint().unwrap().contains("processed_log"));

        let speed = dir.path().join("processed_log/CAN/speed");
        write(&speed, &times(50), &vec![vec![12.0]; 40]);
        let error = CommaSegment::open(dir.path()).unwrap_err().to_string();
        assert!(
            error.contains("40 rows") && error.contains("has 50"),
            "{error}"
        );

        write(&speed, &times(50), &vec![vec![12.0, 1.0]; 50]);
        let error = CommaSegment::open(dir.path()).unwrap_err().to_string();
        assert!(error.contains("50×2"), "{error}");
    }
}
