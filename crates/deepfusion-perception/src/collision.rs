//! Time to collision of the vehicle and a target, if both keep their motion.

use crate::Target;
use serde::{Deserialize, Serialize};

/// Dimensions of the vehicle around its camera, in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VehicleShape {
    /// Width.
    pub width_m: f64,
    /// From the camera forward to the bumper.
    pub front_m: f64,
    /// From the camera back to the rear axle, about which the vehicle turns.
    pub axle_m: f64,
    /// Margin on each side.
    pub margin_m: f64,
    /// Yaw of the camera relative to straight ahead, in radians, positive to the left.
    pub camera_yaw_rad: f64,
}

impl Default for VehicleShape {
    fn default() -> Self {
        Self {
            width_m: 1.8,
            front_m: 1.7,
            axle_m: 1.7,
            margin_m: 0.2,
            camera_yaw_rad: 0.0,
        }
    }
}

/// A predicted collision.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Collision {
    /// The target's id.
    pub id: u64,
    /// Seconds from now.
    pub time_s: f64,
}

/// Prediction horizon and time step, seconds.
const HORIZON_S: f64 = 10.0;
/// See [`HORIZON_S`].
const STEP_S: f64 = 0.05;

/// The first target that the vehicle's front would touch at its present speed (m/s) and yaw rate (rad/s, positive to the left), if every
/// target keeps its velocity. For a target whose velocity is not certain yet, the likeliest velocity is used. Targets without a track count
/// as static.
#[must_use]
pub fn time_to_collision(
    targets: &[Target],
    speed_mps: f64,
    yaw_rate: f64,
    vehicle: &VehicleShape,
) -> Option<Collision> {
    let steps = (HORIZON_S / STEP_S) as usize;
    (0..=steps).find_map(|step| {
        let time_s = step as f64 * STEP_S;
        let pose = Pose::after(time_s, speed_mps, yaw_rate, vehicle);
        targets
            .iter()
            .find(|target| pose.touches(target, time_s, vehicle))
            .map(|target| Collision {
                id: target.id,
                time_s,
            })
    })
}

/// The camera's future pose: x right, z forward, and its yaw to the left.
struct Pose {
    x: f64,
    z: f64,
    turn: f64,
}

impl Pose {
    /// The pose after driving along the rear axle's arc.
    fn after(time_s: f64, speed: f64, yaw_rate: f64, vehicle: &VehicleShape) -> Self {
        let (way, turn) = (speed * time_s, yaw_rate * time_s);
        let chord = if turn.abs() < 1e-6 {
            way
        } else {
            way * (0.5 * turn).sin() / (0.5 * turn)
        };
        // The axle moves along the chord; the camera is ahead of it.
        let axle = (-chord * (0.5 * turn).sin(), chord * (0.5 * turn).cos());
        Self {
            x: axle.0 - vehicle.axle_m * turn.sin(),
            z: axle.1 + vehicle.axle_m * (turn.cos() - 1.0),
            turn,
        }
    }

    fn touches(&self, target: &Target, time_s: f64, vehicle: &VehicleShape) -> bool {
        let velocity = target.velocity_mps.or(target.likely_velocity_mps);
        let velocity = velocity.unwrap_or_default();
        // From the camera's axes to the vehicle's.
        let (turned, ahead) = vehicle.camera_yaw_rad.sin_cos();
        let level = |[x, _, z]: [f64; 3]| [ahead * x - turned * z, turned * x + ahead * z];
        let velocity = level(velocity);
        let half = 0.5 * vehicle.width_m + vehicle.margin_m;
        let (sin, cos) = self.turn.sin_cos();
        let corners = target.corners();
        // The footprint's outline, in the vehicle's axes at that time.
        let points: Vec<(f64, f64)> = corners[..4]
            .iter()
            .map(|c| {
                let [x, z] = level(*c);
                let x = x + velocity[0] * time_s - self.x;
                let z = z + velocity[1] * time_s - self.z;
                (cos * x + sin * z, -sin * x + cos * z)
            })
            .collect();
        // Between the bumper and the camera: the front does not hit what is beside the car.
        let inside = |(x, z): (f64, f64)| x.abs() <= half && (0.0..=vehicle.front_m).contains(&z);
        (0..4).any(|i| {
            let (a, b) = (points[i], points[(i + 1) % 4]);
            // A point every quarter of a metre along each side cannot miss the car's front.
            let steps = (((b.0 - a.0).hypot(b.1 - a.1) / 0.25).ceil() as usize).max(1);
            (0..=steps).any(|k| {
                let share = k as f64 / steps as f64;
                inside((a.0 + share * (b.0 - a.0), a.1 + share * (b.1 - a.1)))
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(id: u64, x: f64, z: f64, velocity: [f64; 3]) -> Target {
        Target {
            id,
            center_m: [x, 1.0, z],
            size_m: [4.0, 1.8, 1.5],
            yaw_rad: std::f64::consts::FRAC_PI_2,
            distance_m: x.hypot(z),
            sigma_m: None,
            velocity_mps: Some(velocity),
            likely_velocity_mps: None,
            moving: None,
            confidence: 1.0,
            pixels: 1,
            bounds: None,
            class: None,
            detection: None,
        }
    }

    #[test]
    fn the_time_is_the_gap_divided_by_the_closing_speed() {
        let vehicle = VehicleShape::default();
        // The rear is 2 m before the centre, the bumper 1.7 m before the camera: 20 - 2 - 1.7 = 16.3 m.
        let standing = [target(1, 0.0, 20.0, [0.0; 3])];
        let collision = time_to_collision(&standing, 10.0, 0.0, &vehicle).unwrap();
        assert!((collision.time_s - 1.63).abs() < STEP_S, "{collision:?}");
        let fleeing = [target(1, 0.0, 20.0, [0.0, 0.0, 6.0])];
        let collision = time_to_collision(&fleeing, 10.0, 0.0, &vehicle).unwrap();
        assert!(
            (collision.time_s - 16.3 / 4.0).abs() < STEP_S,
            "{collision:?}"
        );
        let faster = [target(1, 0.0, 20.0, [0.0, 0.0, 12.0])];
        assert_eq!(time_to_collision(&faster, 10.0, 0.0, &vehicle), None);
    }

    #[test]
    fn the_likeliest_velocity_is_used_until_it_is_certain() {
        let vehicle = VehicleShape::default();
        let mut ahead = target(1, 0.0, 20.0, [0.0; 3]);
        ahead.velocity_mps = None;
        assert!(time_to_collision(&[ahead.clone()], 10.0, 0.0, &vehicle).is_some());
        ahead.likely_velocity_mps = Some([0.0, 0.0, 10.0]);
        assert_eq!(time_to_collision(&[ahead], 10.0, 0.0, &vehicle), None);
    }

    #[test]
    fn the_path_is_the_vehicles_and_not_the_cameras() {
        // The camera looks five degrees to the left, so a target straight ahead of the vehicle appears to the right.
        let yaw = 5.0_f64.to_radians();
        let vehicle = VehicleShape {
            camera_yaw_rad: yaw,
            ..VehicleShape::default()
        };
        let (right, ahead) = (30.0 * yaw.sin(), 30.0 * yaw.cos());
        let of =
            |x: f64, z: f64| time_to_collision(&[target(1, x, z, [0.0; 3])], 10.0, 0.0, &vehicle);
        assert!(of(right, ahead).is_some());
        assert_eq!(of(0.0, 30.0), None, "it is 2.6 m to the left of the path");
    }

    #[test]
    fn a_target_in_the_next_lane_is_hit_only_in_a_bend() {
        let vehicle = VehicleShape::default();
        let left = [target(4, -3.5, 25.0, [0.0; 3])];
        assert_eq!(time_to_collision(&left, 10.0, 0.0, &vehicle), None);
        // A left bend with a radius of about 89 m: 25² / 178 = 3.5 m to the side at 25 m.
        let collision = time_to_collision(&left, 10.0, 0.112, &vehicle).unwrap();
        assert_eq!(collision.id, 4);
        assert_eq!(time_to_collision(&left, 10.0, -0.112, &vehicle), None);
    }

    #[test]
    fn the_first_collision_is_reported_even_for_a_standing_vehicle() {
        let vehicle = VehicleShape::default();
        let two = [
            target(1, 0.0, 30.0, [0.0; 3]),
            target(2, 0.2, 18.0, [0.0; 3]),
        ];
        assert_eq!(time_to_collision(&two, 8.0, 0.0, &vehicle).unwrap().id, 2);
        let coming = [target(3, 0.0, 30.0, [0.0, 0.0, -10.0])];
        let collision = time_to_collision(&coming, 0.0, 0.0, &vehicle).unwrap();
        assert!((collision.time_s - 2.63).abs() < STEP_S);
        assert_eq!(time_to_collision(&[], 30.0, 0.0, &vehicle), None);
    }
}
