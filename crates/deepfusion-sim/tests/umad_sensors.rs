//! The FMCW LiDAR, the 6-axis unit and the CAN bus compared with the exact motion.

use deepfusion_sim::{SceneObject, Sensors, SimConfig, Simulation, WHEELBASE_M};
use nalgebra::Vector3;

fn drive(moving_cars: usize, frames: usize) -> Simulation {
    let config = SimConfig {
        seed: 5,
        frames,
        width: 160,
        height: 120,
        fps: 25.0,
        moving_cars,
        sensors: Sensors::Umad,
        ..SimConfig::default()
    };
    Simulation::new(&config).unwrap()
}

/// For a static point, the radial velocity is the sensor's own velocity along the ray, apart from noise.
#[test]
fn static_points_have_the_radial_velocity_of_the_sensor() {
    let simulation = drive(8, 60);
    let (before, now, after) = (39, 40, 41);
    let places = [before, now, after].map(|f| simulation.world_from_velo(f).translation());
    let dt = simulation.time_s(after) - simulation.time_s(before);
    let velocity = (places[2] - places[0]) / dt;
    let in_sensor = simulation.world_from_velo(now).inverse().rotate(&velocity);
    let scan = simulation.fmcw(simulation.time_s(now));
    let radial = scan.cloud.radial_velocity.as_ref().unwrap();
    assert!(scan.cloud.len() > 20_000, "{}", scan.cloud.len());
    assert_eq!(radial.len(), scan.moving.len());
    let (mut sum, mut n) = (0.0, 0);
    for (i, point) in scan.cloud.xyz.iter().enumerate() {
        let ray = Vector3::from(point.map(f64::from)).normalize();
        let own = -in_sensor.dot(&ray);
        let expected = own + f64::from(scan.ground_radial_mps[i]);
        let error = f64::from(radial[i]) - expected;
        // Six standard deviations of the noise. Range noise does not change the direction of the ray.
        assert!(error.abs() < 0.35, "{error} at {point:?}");
        (sum, n) = (sum + error * error, n + 1);
        assert!(scan.moving[i] || scan.ground_radial_mps[i] == 0.0);
    }
    let rms = (sum / f64::from(n)).sqrt();
    assert!((0.04..0.07).contains(&rms), "{rms}");
}

/// A dynamic point has the speed of its object.
#[test]
fn moving_points_have_their_car_s_velocity() {
    let simulation = drive(10, 80);
    let mut seen = 0;
    for frame in (0..80).step_by(8) {
        let scan = simulation.fmcw(simulation.time_s(frame));
        let world_from_velo = simulation.world_from_velo(frame);
        let objects = simulation.objects(frame);
        for (i, point) in scan
            .cloud
            .xyz
            .iter()
            .enumerate()
            .filter(|(i, _)| scan.moving[*i])
        {
            let ray = world_from_velo.rotate(&Vector3::from(point.map(f64::from)).normalize());
            let place = world_from_velo.transform(&Vector3::from(point.map(f64::from)));
            // In its box, apart from range noise.
            let inside = |o: &&SceneObject| {
                let local = o.world_from_object.inverse().transform(&place);
                (0..3).all(|k| local[k].abs() < 0.5 * o.size[k] + 0.2)
            };
            let mut driving = objects.iter().filter(|o| o.velocity.norm() > 0.0);
            let car = driving.find(inside).unwrap();
            let expected = car.velocity.dot(&ray);
            // In a bend the ends of a car move differently from its middle.
            let error = (f64::from(scan.ground_radial_mps[i]) - expected).abs();
            assert!(error < 0.15 * car.velocity.norm(), "{error} of {expected}");
            seen += 1;
        }
    }
    assert!(seen > 500, "only {seen} points on moving cars");
}

/// The integrals of the readings agree with the distance and the turn of the poses.
#[test]
fn speed_gyro_and_steering_agree_with_the_poses() {
    let simulation = drive(0, 500);
    let end = simulation.time_s(499);
    let exact_distance: f64 = (1..500)
        .map(|f| {
            let place = |f| simulation.world_from_imu(f).translation().xy();
            (place(f) - place(f - 1)).norm()
        })
        .sum();
    let speeds = simulation.speed_readings();
    let dt = speeds[1].time_s - speeds[0].time_s;
    let distance: f64 = speeds
        .windows(2)
        .map(|w| 0.5 * dt * (w[0].speed_mps + w[1].speed_mps))
        .sum();
    assert!(
        (distance / exact_distance - 1.0).abs() < 0.01,
        "{distance} {exact_distance}"
    );

    let turn = |f: usize| {
        let forward = simulation.world_from_imu(f).rotate(&Vector3::x());
        forward.y.atan2(forward.x)
    };
    let wrapped = |a: f64| a.sin().atan2(a.cos());
    let exact_turn: f64 = (1..500).map(|f| wrapped(turn(f) - turn(f - 1))).sum();
    let readings = simulation.imu_readings();
    let dt = readings[1].time_s - readings[0].time_s;
    let gyro: f64 = readings
        .windows(2)
        .map(|w| 0.5 * dt * (w[0].angular_rate.z + w[1].angular_rate.z))
        .sum();
    // The bias is at most 0.008 rad/s per axis.
    assert!(
        (gyro - exact_turn).abs() < 0.009 * end + 0.02,
        "{gyro} {exact_turn}"
    );
    let up: f64 = readings.iter().map(|r| r.acceleration.z).sum::<f64>() / readings.len() as f64;
    assert!((up - 9.81).abs() < 0.12, "{up}");

    let steering = simulation.steering_readings();
    let dt = steering[1].time_s - steering[0].time_s;
    let speed_at = |t: f64| {
        let after = speeds
            .partition_point(|s| s.time_s < t)
            .min(speeds.len() - 1);
        speeds[after].speed_mps
    };
    let by_wheels: f64 = steering
        .iter()
        .map(|s| dt * speed_at(s.time_s) / WHEELBASE_M * s.angle_rad.tan())
        .sum();
    assert!(
        (by_wheels - exact_turn).abs() < 0.03 * exact_turn.abs() + 0.03,
        "{by_wheels} {exact_turn}"
    );
}

#[test]
fn equal_drives_give_equal_readings() {
    let (a, b) = (drive(3, 30), drive(3, 30));
    assert_eq!(a.fmcw(0.5), b.fmcw(0.5));
    assert_eq!(a.imu_readings(), b.imu_readings());
    assert_eq!(a.speed_readings(), b.speed_readings());
}
