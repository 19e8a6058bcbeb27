//! The 30 numbers of a KITTI OXTS file from the true motion.

use crate::motion::{Drive, rotation};
use crate::road::Road;
use nalgebra::{Matrix3, Vector3};

/// Latitude and longitude of the world's origin, degrees, and its altitude, metres.
const ORIGIN: (f64, f64, f64) = (49.011_212, 8.422_885, 112.83);

/// Radius that KITTI's tools use for their Mercator projection, metres.
const EARTH_RADIUS: f64 = 6_378_137.0;

/// Standard gravity, m/s².
pub(crate) const GRAVITY: f64 = 9.81;

/// One OXTS reading, in the order of KITTI's `dataformat.txt`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OxtsReading {
    /// lat, lon, alt, roll, pitch, yaw, vn, ve, vf, vl, vu, ax, ay, az, af, al, au, wx, wy, wz,
    /// wf, wl, wu, `pos_accuracy`, `vel_accuracy`, `navstat`, `numsats`, `posmode`, `velmode`,
    /// `orimode`.
    pub values: [f64; 30],
}

impl OxtsReading {
    /// What the unit at the IMU's place reads at a time, without noise. The world's x is east, its
    /// y north.
    pub(crate) fn at(drive: &Drive, road: &Road, time_s: f64) -> Self {
        let place = drive.world_from_imu(road, time_s).translation();
        let (yaw, pitch, roll) = drive.attitude(road, time_s);
        let motion = drive.kinematics(road, time_s);
        // "Level" axes turn with the yaw only.
        let world_from_level = rotation(yaw, 0.0, 0.0);
        let world_from_body = rotation(yaw, pitch, roll);
        let into = |axes: &Matrix3<f64>, v: &Vector3<f64>| axes.transpose() * v;
        let velocity = into(&world_from_level, &motion.velocity);
        // An accelerometer measures the force that holds it up.
        let felt = motion.acceleration + Vector3::new(0.0, 0.0, GRAVITY);
        let (body, level) = (
            into(&world_from_body, &felt),
            into(&world_from_level, &felt),
        );
        let turn = motion.angular_rate;
        let turn_level = into(&world_from_level, &(world_from_body * turn));
        // Mercator's scale at the origin, as the field's tools compute it.
        let scale = ORIGIN.0.to_radians().cos();
        let mx = scale * EARTH_RADIUS * ORIGIN.1.to_radians() + place.x;
        let my = scale * EARTH_RADIUS * (0.5 * (90.0 + ORIGIN.0).to_radians()).tan().ln() + place.y;
        let lon = (mx / (scale * EARTH_RADIUS)).to_degrees();
        let lat = 2.0 * (my / (scale * EARTH_RADIUS)).exp().atan().to_degrees() - 90.0;
        let yaw = yaw.sin().atan2(yaw.cos());
        Self {
            values: [
                lat,
                lon,
                ORIGIN.2 + place.z,
                roll,
                pitch,
                yaw,
                motion.velocity.y,
                motion.velocity.x,
                velocity.x,
                velocity.y,
                velocity.z,
                body.x,
                body.y,
                body.z,
                level.x,
                level.y,
                level.z,
                turn.x,
                turn.y,
                turn.z,
                turn_level.x,
                turn_level.y,
                turn_level.z,
                0.05,
                0.02,
                4.0,
                9.0,
                5.0,
                5.0,
                6.0,
            ],
        }
    }

    /// Forward speed, m/s.
    #[must_use]
    pub fn forward_speed(&self) -> f64 {
        self.values[8]
    }

    /// The line of the file; the last five numbers are integers.
    #[must_use]
    pub fn line(&self) -> String {
        let mut words: Vec<String> = self.values[..2]
            .iter()
            .map(|v| format!("{v:.13}"))
            .collect();
        words.extend(self.values[2..25].iter().map(|v| format!("{v:.12}")));
        words.extend(self.values[25..].iter().map(|v| format!("{v:.0}")));
        words.join(" ")
    }
}

/// KITTI's description of the numbers.
pub(crate) const DATA_FORMAT: &str = "\
lat:   latitude of the oxts-unit (deg)
lon:   longitude of the oxts-unit (deg)
alt:   altitude of the oxts-unit (m)
roll:  roll angle (rad),    0 = level, positive = left side up,      range: -pi   .. +pi
pitch: pitch angle (rad),   0 = level, positive = front down,        range: -pi/2 .. +pi/2
yaw:   heading (rad),       0 = east,  positive = counter clockwise, range: -pi   .. +pi
vn:    velocity towards north (m/s)
ve:    velocity towards east (m/s)
vf:    forward velocity, i.e. parallel to earth-surface (m/s)
vl:    leftward velocity, i.e. parallel to earth-surface (m/s)
vu:    upward velocity, i.e. perpendicular to earth-surface (m/s)
ax:    acceleration in x, i.e. in direction of vehicle front (m/s^2)
ay:    acceleration in y, i.e. in direction of vehicle left (m/s^2)
az:    acceleration in z, i.e. in direction of vehicle top (m/s^2)
af:    forward acceleration (m/s^2)
al:    leftward acceleration (m/s^2)
au:    upward acceleration (m/s^2)
wx:    angular rate around x (rad/s)
wy:    angular rate around y (rad/s)
wz:    angular rate around z (rad/s)
wf:    angular rate around forward axis (rad/s)
wl:    angular rate around leftward axis (rad/s)
wu:    angular rate around upward axis (rad/s)
pos_accuracy:  position accuracy (north/east in m)
vel_accuracy:  velocity accuracy (north/east in m/s)
navstat:       navigation status
numsats:       number of satellites tracked by primary GPS receiver
posmode:       position mode of primary GPS receiver
velmode:       velocity mode of primary GPS receiver
orimode:       orientation mode of primary GPS receiver
";
