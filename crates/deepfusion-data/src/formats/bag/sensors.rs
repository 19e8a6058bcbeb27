//! Computes the vehicle's motion from speed, steering and inertial unit.

use super::config::BagConfig;
use super::index::Index;
use crate::{Error, Result};
use deepfusion_geometry::Se3;
use deepfusion_motion::{
    Bicycle, FusedTrack, ImuConfig, ImuMount, ImuSample, MotionConfig, MotionModel, Signal,
    VehicleSensors, VehicleTrack,
};
use std::path::Path;

/// A vehicle's motion.
pub(super) struct Motion {
    pub(super) track: MotionModel,
    /// Whether its turns were measured.
    pub(super) yaw_known: bool,
}

/// The vehicle's motion from all its sensors, on the vehicle's clock counted from `origin_ns`; `None` without a speed.
///
/// # Errors
/// [`Error::InertialUnit`], [`Error::Motion`] if the sensors cannot be used as configured, or contradict each other.
pub(super) fn motion(
    bag: &Path,
    index: &Index,
    config: &BagConfig,
    vehicle_from_imu: Option<&Se3>,
    origin_ns: i64,
) -> Result<Option<Motion>> {
    if index.speed_mps.is_empty() {
        return Ok(None);
    }
    let turns = index.has_yaw_rates();
    // A steering angle without a wheelbase gives no turn, so it cannot replace a measured yaw rate.
    let steered = !index.steering_rad.is_empty() && config.vehicle.wheelbase_m.is_some();
    if turns && index.imu.is_empty() && !steered {
        return Ok(Some(by_twist(index, origin_ns)));
    }
    let seconds = |ns: i64| (ns - origin_ns) as f64 * 1e-9;
    let signal = |values: &[(i64, f64)]| {
        let mut values = values.to_vec();
        values.sort_by_key(|v| v.0);
        Signal::new(values.into_iter().map(|(ns, v)| (seconds(ns), v)))
    };
    let mut imu: Vec<ImuSample> = index
        .imu
        .iter()
        .map(|(ns, sample)| ImuSample {
            time_s: seconds(*ns),
            ..*sample
        })
        .collect();
    imu.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let sensors = VehicleSensors {
        speed_mps: signal(&index.speed_mps),
        steering_rad: (!index.steering_rad.is_empty()).then(|| signal(&index.steering_rad)),
        imu: (!imu.is_empty()).then_some(imu),
    };
    let vehicle = &config.vehicle;
    let mount = vehicle_from_imu.map(|t| ImuMount {
        rotation_rad: t.axis_angle().into(),
        translation_m: t.translation().into(),
    });
    let motion = MotionConfig {
        // The index has already scaled the speeds.
        speed_scale: 1.0,
        bicycle: vehicle.wheelbase_m.map(|wheelbase_m| Bicycle {
            steering_ratio: vehicle.steering_ratio.unwrap_or(1.0),
            steering_offset_rad: vehicle.steering_offset_rad,
            ..Bicycle::new(wheelbase_m)
        }),
        imu: ImuConfig {
            vehicle_from_imu: mount.unwrap_or_default(),
            ..ImuConfig::default()
        },
        fusion: config.fusion,
    };
    let track = FusedTrack::new(&sensors, &motion).map_err(|e| refusal(bag, config, e))?;
    Ok(Some(Motion {
        yaw_known: track.knows_yaw(),
        track: track.into(),
    }))
}

/// The error about unusable sensors. If only the inertial unit is at fault, it can be left out.
fn refusal(bag: &Path, config: &BagConfig, source: deepfusion_motion::Error) -> Error {
    use deepfusion_motion::Error as Reason;
    let path = bag.to_owned();
    let of_unit = matches!(
        source,
        Reason::NotGravity { .. }
            | Reason::NotUp { .. }
            | Reason::TooFewSamples { stream: "imu", .. }
    );
    if of_unit {
        Error::InertialUnit {
            path,
            source: Box::new(source),
            config: config.path.clone(),
        }
    } else {
        Error::Motion { path, source }
    }
}

/// The motion of a vehicle whose speed messages have a yaw rate, without another sensor for it.
fn by_twist(index: &Index, origin_ns: i64) -> Motion {
    let readings = index.speed_mps.iter().zip(&index.yaw_rate);
    let mut samples: Vec<(f64, f64, f64)> = readings
        .map(|((ns, speed), (_, yaw_rate))| ((ns - origin_ns) as f64 * 1e-9, *speed, *yaw_rate))
        .collect();
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut track = VehicleTrack::new(&samples);
    if samples.iter().any(|(_, _, yaw_rate)| !yaw_rate.is_finite()) {
        // Keep speeds without a yaw rate.
        let speeds: Vec<_> = samples
            .iter()
            .map(|(t, speed, _)| (*t, *speed, 0.0))
            .collect();
        let turns = samples
            .iter()
            .filter(|(_, _, yaw_rate)| yaw_rate.is_finite());
        let turns: Vec<_> = turns.map(|(t, _, yaw_rate)| (*t, *yaw_rate)).collect();
        track = VehicleTrack::new(&speeds).with_yaw_rate(&turns, VehicleTrack::MAX_GAP_S);
    }
    if !index.tilts_rad.is_empty() {
        let at_s = |ns: i64| (ns - origin_ns) as f64 * 1e-9;
        let tilts = index.tilts_rad.iter();
        let tilts = tilts.map(|(ns, [roll, pitch])| (at_s(*ns), *roll, *pitch));
        track = track.with_tilt(&tilts.collect::<Vec<_>>());
    }
    if index.tilt_rates.iter().any(|(_, rates)| *rates != [0.0; 2]) {
        track = track.with_tilt_rates(&tilt_rates(index, origin_ns), VehicleTrack::MAX_GAP_S);
    }
    Motion {
        track: track.into(),
        yaw_known: true,
    }
}

/// The rates of roll and pitch with their times. They are only integrated between two frames: integrated from the beginning, their bias
/// would tilt the vehicle, and so would turns on a ramp.
fn tilt_rates(index: &Index, origin_ns: i64) -> Vec<(f64, [f64; 2])> {
    let mut rates = index.tilt_rates.clone();
    rates.sort_by_key(|(ns, _)| *ns);
    let at_s = |ns: i64| (ns - origin_ns) as f64 * 1e-9;
    rates
        .into_iter()
        .map(|(ns, rates)| (at_s(ns), rates))
        .collect()
}
