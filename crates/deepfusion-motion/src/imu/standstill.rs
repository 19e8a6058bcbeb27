//! Standstills: the gyro's reading there is its bias.

use super::{GRAVITY, ImuSample, StandstillConfig};
use crate::Signal;
use nalgebra::Vector3;

/// A stretch in which the vehicle stood still, and the unit's mean readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standstill {
    /// Start, in seconds.
    pub from_s: f64,
    /// End, in seconds.
    pub to_s: f64,
    /// Mean angular rate about the vehicle's axes, in rad/s: the gyro's bias.
    pub gyro_bias_radps: Vector3<f64>,
    /// Mean specific force along the vehicle's axes, in m/s²: the direction of up. A bias across it cannot be distinguished from a slope of
    /// the road, and is treated as one.
    pub specific_force_mps2: Vector3<f64>,
    /// Norm of the specific force minus gravity, in m/s²: the only part of the accelerometer's bias
    /// that a standstill determines.
    pub up_bias_mps2: f64,
}

/// Finds the standstills of a recording in vehicle axes, by the speed and by the unit's own variance. While the speed is unknown, the
/// vehicle does not count as standing.
#[must_use]
pub fn standstills(
    samples: &[ImuSample],
    speed: &Signal,
    config: &StandstillConfig,
) -> Vec<Standstill> {
    let slow = |s: &ImuSample| {
        speed
            .at(s.time_s)
            .is_some_and(|v| v.abs() <= config.speed_mps)
    };
    let mut found = Vec::new();
    let same_stretch =
        |a: &ImuSample, b: &ImuSample| slow(a) == slow(b) && b.time_s - a.time_s < config.window_s;
    for run in samples.chunk_by(same_stretch).filter(|run| slow(&run[0])) {
        found.extend(quiet_stretches(run, config));
    }
    found
}

/// The gyro's bias at a time, interpolated between the standstills before and after, because biases slowly follow the unit's temperature.
/// `None` if there are none.
pub(super) fn gyro_bias(standstills: &[Standstill], time_s: f64) -> Option<Vector3<f64>> {
    let middle = |s: &Standstill| 0.5 * (s.from_s + s.to_s);
    let after = standstills.partition_point(|s| middle(s) <= time_s);
    let (before, next) = match (after.checked_sub(1), standstills.get(after)) {
        (Some(before), Some(next)) => (&standstills[before], next),
        (Some(before), None) => return Some(standstills[before].gyro_bias_radps),
        (None, next) => return next.map(|s| s.gyro_bias_radps),
    };
    let fraction = (time_s - middle(before)) / (middle(next) - middle(before));
    Some(before.gyro_bias_radps.lerp(&next.gyro_bias_radps, fraction))
}

/// The quiet windows of a slow stretch, with adjacent ones joined.
fn quiet_stretches(run: &[ImuSample], config: &StandstillConfig) -> Vec<Standstill> {
    let begin = run[0].time_s;
    let window = |s: &ImuSample| ((s.time_s - begin) / config.window_s) as u64;
    let mut joined: Vec<Vec<ImuSample>> = Vec::new();
    let mut last_quiet = None;
    for samples in run.chunk_by(|a, b| window(a) == window(b)) {
        let index = window(&samples[0]);
        // The car still rocks in the first window after stopping, and the last window is rarely complete.
        let whole = samples[samples.len() - 1].time_s - samples[0].time_s > 0.5 * config.window_s;
        if index == 0 || !whole || !is_quiet(samples, config) {
            continue;
        }
        match joined.last_mut() {
            Some(stretch) if last_quiet == Some(index - 1) => stretch.extend_from_slice(samples),
            _ => joined.push(samples.to_vec()),
        }
        last_quiet = Some(index);
    }
    joined.iter().map(|stretch| summary(stretch)).collect()
}

fn is_quiet(samples: &[ImuSample], config: &StandstillConfig) -> bool {
    let largest_std = |of: fn(&ImuSample) -> Vector3<f64>| {
        let mean = mean(samples, of);
        let squares: Vector3<f64> = samples.iter().map(|s| (of(s) - mean).map(|d| d * d)).sum();
        (squares.max() / samples.len() as f64).sqrt()
    };
    samples.len() >= 3
        && largest_std(|s| s.angular_rate_radps) <= config.gyro_std_radps
        && largest_std(|s| s.acceleration_mps2) <= config.acceleration_std_mps2
}

fn summary(samples: &[ImuSample]) -> Standstill {
    let force = mean(samples, |s| s.acceleration_mps2);
    Standstill {
        from_s: samples[0].time_s,
        to_s: samples[samples.len() - 1].time_s,
        gyro_bias_radps: mean(samples, |s| s.angular_rate_radps),
        specific_force_mps2: force,
        up_bias_mps2: force.norm() - GRAVITY,
    }
}

fn mean(samples: &[ImuSample], of: fn(&ImuSample) -> Vector3<f64>) -> Vector3<f64> {
    samples.iter().map(of).sum::<Vector3<f64>>() / samples.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 20 s at 100 Hz: standing from 5 to 10 s according to the speed; `shake` is the unit's vibration then.
    fn drive(shake: f64) -> (Vec<ImuSample>, Signal) {
        let standing = |t: f64| (5.0..10.0).contains(&t);
        let samples = (0..2000)
            .map(|i| {
                let t = f64::from(i) * 0.01;
                let unrest = if standing(t) { shake } else { 1.0 } * (40.0 * t).sin();
                ImuSample {
                    time_s: t,
                    acceleration_mps2: Vector3::new(unrest, 0.0, 9.85),
                    angular_rate_radps: Vector3::new(0.0, 0.02 * unrest, 0.004),
                }
            })
            .collect();
        let speed = (0..400).map(|i| {
            let t = f64::from(i) * 0.05;
            (t, if standing(t) { 0.0 } else { 8.0 })
        });
        (samples, Signal::new(speed))
    }

    #[test]
    fn a_stop_gives_the_bias() {
        let (samples, speed) = drive(0.02);
        let found = standstills(&samples, &speed, &StandstillConfig::default());
        assert_eq!(found.len(), 1);
        assert!(found[0].from_s >= 5.9 && found[0].to_s <= 10.0, "{found:?}");
        assert!(found[0].to_s - found[0].from_s > 2.5, "{found:?}");
        assert!((found[0].gyro_bias_radps.z - 0.004).abs() < 1e-9);
        assert!((found[0].up_bias_mps2 - (9.85 - GRAVITY)).abs() < 1e-3);
    }

    #[test]
    fn creeping_is_not_standing() {
        let (samples, speed) = drive(1.0);
        assert!(standstills(&samples, &speed, &StandstillConfig::default()).is_empty());
    }

    #[test]
    fn without_a_speed_there_is_no_standstill() {
        let (samples, _) = drive(0.0);
        let config = StandstillConfig::default();
        assert!(standstills(&samples, &Signal::default(), &config).is_empty());
        assert!(standstills(&[], &Signal::default(), &config).is_empty());
    }

    #[test]
    fn the_bias_drifts_between_two_stops() {
        let stop = |at: f64, z: f64| Standstill {
            from_s: at - 1.0,
            to_s: at + 1.0,
            gyro_bias_radps: Vector3::new(0.0, 0.0, z),
            specific_force_mps2: Vector3::z() * GRAVITY,
            up_bias_mps2: 0.0,
        };
        let stops = [stop(10.0, 0.001), stop(30.0, 0.003)];
        let z = |t| gyro_bias(&stops, t).unwrap().z;
        assert!((z(0.0) - 0.001).abs() < 1e-12 && (z(99.0) - 0.003).abs() < 1e-12);
        assert!((z(15.0) - 0.0015).abs() < 1e-12);
        assert!(gyro_bias(&[], 3.0).is_none());
    }
}
