//! The car's motion: speed over time, and the pose of its IMU at any time.

use crate::road::Road;
use deepfusion_geometry::Se3;
use nalgebra::{Matrix3, Vector3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Step of the speed table, seconds.
const STEP: f64 = 0.01;

/// The table begins this long before time 0, so that derivatives exist there.
const LEAD: f64 = 1.0;

/// Lowest and highest speed of the car, m/s.
const SPEED: (f64, f64) = (3.0, 14.0);

/// The largest lateral acceleration that the driver accepts in a bend, m/s².
const MAX_LATERAL: f64 = 2.3;

/// Lateral position of the car on the road: metres left of the centreline.
const LANE: f64 = -1.65;

/// Height of the IMU above the road, metres.
pub(crate) const IMU_HEIGHT: f64 = 0.93;

/// Motion of the IMU at one instant, in its own axes (x forward, y left, z up).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Kinematics {
    /// Velocity, world axes, m/s.
    pub velocity: Vector3<f64>,
    /// Acceleration, world axes, m/s².
    pub acceleration: Vector3<f64>,
    /// Angular rate, body axes, rad/s.
    pub angular_rate: Vector3<f64>,
}

/// A sum of slow waves with random phases.
struct Wander {
    waves: [(f64, f64, f64); 3],
}

impl Wander {
    fn new(rng: &mut ChaCha8Rng, amplitude: f64, shortest: f64, longest: f64) -> Self {
        let mut wave = || {
            let length: f64 = rng.random_range(shortest..longest);
            (
                amplitude * rng.random_range(0.25..0.5),
                std::f64::consts::TAU / length,
                rng.random_range(0.0..std::f64::consts::TAU),
            )
        };
        Self {
            waves: [wave(), wave(), wave()],
        }
    }

    fn at(&self, x: f64) -> f64 {
        self.waves
            .iter()
            .map(|(a, w, p)| a * (w * x + p).sin())
            .sum()
    }

    fn slope(&self, x: f64) -> f64 {
        self.waves
            .iter()
            .map(|(a, w, p)| a * w * (w * x + p).cos())
            .sum()
    }
}

/// A drive along a road.
pub(crate) struct Drive {
    /// Distance, speed and acceleration at each step of the table.
    table: Vec<[f64; 3]>,
    lateral: Wander,
    roll: Wander,
    pitch: Wander,
    bounce: Wander,
}

impl Drive {
    /// Drives along `road` from s = 0 for `duration_s` seconds; `pace` scales the speed (1: as on a street).
    pub(crate) fn simulate(rng: &mut ChaCha8Rng, road: &Road, duration_s: f64, pace: f64) -> Self {
        let wish = Wander::new(rng, 7.0, 9.0, 40.0);
        let mean = rng.random_range(7.5..9.5);
        let wanted = |s: f64, t: f64| {
            let bend = (0..12)
                .map(|i| road.centre(s + 2.5 * f64::from(i)).3.abs())
                .fold(1e-6, f64::max);
            let free = (mean + wish.at(t)).clamp(SPEED.0 + 0.3, SPEED.1 - 0.4);
            (pace * free).min((MAX_LATERAL / bend).sqrt())
        };
        let mut speed = wanted(0.0, 0.0);
        let (mut s, mut acceleration) = (-speed * LEAD, 0.0f64);
        let steps = ((duration_s + 2.0 * LEAD) / STEP).ceil() as usize + 2;
        let mut table = Vec::with_capacity(steps);
        for step in 0..steps {
            table.push([s, speed, acceleration]);
            let time = step as f64 * STEP - LEAD;
            let command = (0.9 * (wanted(s, time) - speed)).clamp(-2.6, 1.8);
            // The pedals react with a lag, which bounds the jerk and keeps the acceleration continuous.
            let next = acceleration + STEP / 0.35 * (command - acceleration);
            let middle = 0.5 * (acceleration + next);
            s += STEP * speed + 0.5 * STEP * STEP * acceleration;
            speed = (speed + STEP * middle).clamp(pace * SPEED.0, pace * SPEED.1);
            acceleration = next;
        }
        // Start exactly at s = 0.
        let zero = table[(LEAD / STEP) as usize][0];
        for entry in &mut table {
            entry[0] -= zero;
        }
        Self {
            table,
            lateral: Wander::new(rng, 0.3, 35.0, 90.0),
            roll: Wander::new(rng, 0.006, 1.1, 4.0),
            pitch: Wander::new(rng, 0.005, 0.9, 3.0),
            bounce: Wander::new(rng, 0.015, 0.9, 3.0),
        }
    }

    /// Distance along the road and speed at a time: cubic Hermite, so that the speed is the
    /// derivative of the distance.
    pub(crate) fn progress(&self, time_s: f64) -> (f64, f64, f64) {
        let position = ((time_s + LEAD) / STEP).clamp(0.0, (self.table.len() - 2) as f64);
        let index = (position.floor() as usize).min(self.table.len() - 2);
        let (a, b) = (&self.table[index], &self.table[index + 1]);
        let t = position - index as f64;
        let (t2, t3) = (t * t, t * t * t);
        let s = (2.0 * t3 - 3.0 * t2 + 1.0) * a[0]
            + (t3 - 2.0 * t2 + t) * STEP * a[1]
            + (3.0 * t2 - 2.0 * t3) * b[0]
            + (t3 - t2) * STEP * b[1];
        let mix = |k: usize| a[k] + (b[k] - a[k]) * t;
        (s, mix(1), mix(2))
    }

    /// World frame (z up) from the IMU's frame at a time: Rz(yaw)·Ry(pitch)·Rx(roll), as OXTS has it.
    pub(crate) fn world_from_imu(&self, road: &Road, time_s: f64) -> Se3 {
        let (yaw, pitch, roll) = self.attitude(road, time_s);
        let (s, ..) = self.progress(time_s);
        let (x, y, _) = road.world(s, LANE + self.lateral.at(s));
        let z = IMU_HEIGHT + self.bounce.at(time_s);
        Se3::from_parts(&rotation(yaw, pitch, roll), Vector3::new(x, y, z))
    }

    /// Yaw, pitch and roll in radians (OXTS: pitch positive with the front down).
    pub(crate) fn attitude(&self, road: &Road, time_s: f64) -> (f64, f64, f64) {
        let (s, _, acceleration) = self.progress(time_s);
        let (_, _, heading, curvature) = road.centre(s);
        let lateral = LANE + self.lateral.at(s);
        // The tangent of the path driven: the wheels do not slip.
        let drift = self.lateral.slope(s).atan2(1.0 - curvature * lateral);
        (
            heading + drift,
            self.pitch.at(time_s) - 0.004 * acceleration,
            self.roll.at(time_s),
        )
    }

    /// Velocity, acceleration and angular rate of the IMU, by central differences of its pose.
    pub(crate) fn kinematics(&self, road: &Road, time_s: f64) -> Kinematics {
        const H: f64 = 0.02;
        let [before, now, after] =
            [-H, 0.0, H].map(|offset| self.world_from_imu(road, time_s + offset));
        Kinematics {
            velocity: (after.translation() - before.translation()) / (2.0 * H),
            acceleration: (after.translation() - 2.0 * now.translation() + before.translation())
                / (H * H),
            angular_rate: (before.inverse() * after).axis_angle() / (2.0 * H),
        }
    }
}

/// Rz(yaw)·Ry(pitch)·Rx(roll).
pub(crate) fn rotation(yaw: f64, pitch: f64, roll: f64) -> Matrix3<f64> {
    let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
    Matrix3::new(cy, -sy, 0.0, sy, cy, 0.0, 0.0, 0.0, 1.0)
        * Matrix3::new(cp, 0.0, sp, 0.0, 1.0, 0.0, -sp, 0.0, cp)
        * Matrix3::new(1.0, 0.0, 0.0, 0.0, cr, -sr, 0.0, sr, cr)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn drive(seed: u64, duration_s: f64) -> (Road, Drive) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let road = Road::generate(&mut rng, -60.0, 60.0 + 14.0 * duration_s);
        let drive = Drive::simulate(&mut rng, &road, duration_s, 1.0);
        (road, drive)
    }

    #[test]
    fn speeds_and_accelerations_are_those_of_a_car() {
        let (mut slowest, mut fastest) = (f64::MAX, 0.0f64);
        for seed in 0..8 {
            let (road, drive) = drive(seed, 60.0);
            for step in 0..600 {
                let time = f64::from(step) * 0.1;
                let motion = drive.kinematics(&road, time);
                let speed = motion.velocity.xy().norm();
                (slowest, fastest) = (slowest.min(speed), fastest.max(speed));
                assert!((2.7..14.5).contains(&speed), "{speed}");
                assert!(
                    motion.acceleration.norm() < 5.0,
                    "{:?}",
                    motion.acceleration
                );
                assert!(motion.angular_rate.z.abs() < 0.6);
            }
        }
        assert!(slowest < 5.0 && fastest > 11.0, "{slowest} {fastest}");
    }

    #[test]
    fn the_car_moves_along_its_heading() {
        let (road, drive) = drive(4, 40.0);
        for step in 0..400 {
            let time = f64::from(step) * 0.1;
            let velocity = drive.kinematics(&road, time).velocity;
            let (yaw, ..) = drive.attitude(&road, time);
            let leftward = -velocity.x * yaw.sin() + velocity.y * yaw.cos();
            assert!(leftward.abs() < 0.03, "{leftward} m/s at {time}");
        }
    }

    #[test]
    fn the_drive_starts_at_zero_metres() {
        assert!(drive(9, 5.0).1.progress(0.0).0.abs() < 1e-9);
    }
}
