//! Wheelbase and steering ratio identified from the simulator's streams: CAN speed at 50 Hz, wheel angle at 80 Hz, a 6-axis unit at 100 Hz,
//! each quantised or noisy in its own way, and the gyro with an unknown bias. The ground truth is the road's geometry, not the fitted
//! model.

use deepfusion_motion::{
    Estimate, Identified, IdentifyConfig, ImuConfig, ImuSample, ImuTrack, Signal, Unidentifiable,
    UnidentifiableReason, identify,
};
use deepfusion_sim::{Scene, Sensors, SimConfig, Simulation, WHEELBASE_M};

const SECONDS: f64 = 120.0;
const FPS: f64 = 10.0;
/// Ratio of a car whose CAN bus sends the steering wheel's angle; the simulator sends the road wheels' angle.
const RATIO: f64 = 15.3;
/// Largest relative error of an estimate.
const SHARE: f64 = 0.03;

struct Drive {
    name: String,
    speed: Signal,
    /// Angle of the road wheels.
    steering: Signal,
    yaw_rate: Signal,
}

impl Drive {
    fn simulate(scene: Scene, seed: u64) -> Self {
        let config = SimConfig {
            seed,
            frames: (SECONDS * FPS) as usize,
            fps: FPS,
            width: 32,
            height: 24,
            scene,
            sensors: Sensors::Umad,
            ..SimConfig::default()
        };
        let simulation = Simulation::new(&config).unwrap();
        let speed = simulation.speed_readings();
        let speed = Signal::new(speed.iter().map(|r| (r.time_s, r.speed_mps)));
        let steering = simulation.steering_readings();
        let steering = Signal::new(steering.iter().map(|r| (r.time_s, r.angle_rad)));
        let readings = simulation.imu_readings();
        let samples = readings.iter().map(|r| ImuSample {
            time_s: r.time_s,
            acceleration_mps2: r.acceleration,
            angular_rate_radps: r.angular_rate,
        });
        let samples: Vec<ImuSample> = samples.collect();
        let imu = ImuTrack::new(&samples, &speed, &ImuConfig::default()).unwrap();
        // The car never stands, so the bias is left for `identify` to find.
        assert!(imu.standstills().is_empty());
        Self {
            name: format!("{} {seed}", scene.name()),
            yaw_rate: imu.yaw_rate().clone(),
            speed,
            steering,
        }
    }

    /// The same drive with a steering signal that is `factor` times the road wheels' angle.
    fn identify(
        &self,
        factor: f64,
        wheelbase_m: Option<f64>,
        steering_ratio: Option<f64>,
    ) -> Result<Identified, Unidentifiable> {
        let config = IdentifyConfig {
            wheelbase_m,
            steering_ratio,
            ..IdentifyConfig::default()
        };
        let steering = self.steering.map(|angle| factor * angle);
        identify(&self.speed, &steering, &self.yaw_rate, &config)
    }

    /// Keeps the parts in which the wheels' angle, smoothed over half a second, stays within `largest_rad` for at least `shortest_s`;
    /// everything else is cut out of all streams. Returns the seconds kept as well.
    fn straight_parts(&self, largest_rad: f64, shortest_s: f64) -> (Self, f64) {
        let mut parts: Vec<(f64, f64)> = Vec::new();
        let mut from_s = None;
        let times = self.steering.times_s();
        for &time_s in times {
            let smooth = self.steering.integral(time_s - 0.25, time_s + 0.25);
            if smooth.is_some_and(|sum| (sum / 0.5).abs() <= largest_rad) {
                from_s = from_s.or(Some(time_s));
                continue;
            }
            parts.extend(from_s.take().map(|from_s| (from_s, time_s)));
        }
        parts.extend(from_s.map(|from_s| (from_s, times[times.len() - 1])));
        parts.retain(|(from_s, to_s)| to_s - from_s >= shortest_s);
        let inside = |t: f64| {
            parts
                .iter()
                .any(|(from_s, to_s)| (*from_s..*to_s).contains(&t))
        };
        let cut = |signal: &Signal| {
            let samples = signal.times_s().iter().zip(signal.values());
            Signal::new(samples.map(|(t, v)| (*t, *v)).filter(|(t, _)| inside(*t)))
        };
        let cut = Self {
            name: self.name.clone(),
            speed: cut(&self.speed),
            steering: cut(&self.steering),
            yaw_rate: cut(&self.yaw_rate),
        };
        (cut, parts.iter().map(|(from_s, to_s)| to_s - from_s).sum())
    }
}

fn bends() -> impl Iterator<Item = Drive> {
    let urban = (1..=4).map(|seed| (Scene::Urban, seed));
    let drives = urban.chain([(Scene::Park, 5), (Scene::Commercial, 6)]);
    drives.map(|(scene, seed)| Drive::simulate(scene, seed))
}

#[track_caller]
fn is_near(estimate: Estimate, truth: f64, drive: &Drive) {
    let share = estimate.value / truth - 1.0;
    let (name, relative) = (&drive.name, estimate.relative_error());
    eprintln!("{name}: {estimate:.4?}, off by {:+.2} %", 100.0 * share);
    assert!(share.abs() < SHARE, "{name}: {estimate:?}, {truth}");
    // The stated standard error is neither far too small nor too large to be useful.
    assert!(
        share.abs() < 4.0 * relative,
        "{name}: {estimate:?}, {truth}"
    );
    assert!(relative < SHARE, "{name}: {estimate:?}");
}

#[test]
fn bends_show_the_wheelbase_or_the_ratio_within_three_percent() {
    for drive in bends() {
        let found = drive.identify(1.0, None, Some(1.0)).unwrap();
        is_near(found.wheelbase_m, WHEELBASE_M, &drive);
        let found = drive.identify(RATIO, None, Some(RATIO)).unwrap();
        is_near(found.wheelbase_m, WHEELBASE_M, &drive);
        let found = drive.identify(RATIO, Some(WHEELBASE_M), None).unwrap();
        is_near(found.steering_ratio, RATIO, &drive);
        // A steering signal that grows to the right.
        let found = drive.identify(-RATIO, Some(WHEELBASE_M), None).unwrap();
        is_near(found.steering_ratio, -RATIO, &drive);
        eprintln!("turning {:.1} s", found.turning_s);
    }
}

/// The simulator's streets bend with a radius of at least 32 m, 0.09 rad of the road wheels: there the two parameters differ by half a
/// percent.
#[test]
fn without_either_the_streets_show_only_the_product() {
    for seed in [1, 4] {
        let drive = Drive::simulate(Scene::Urban, seed);
        let error = drive.identify(RATIO, None, None).unwrap_err();
        assert_eq!(error.why, UnidentifiableReason::OnlyTheProduct, "{error}");
        is_near(error.product_m.unwrap(), WHEELBASE_M * RATIO, &drive);
    }
}

#[test]
fn the_straight_parts_of_the_same_drives_show_nothing() {
    for drive in bends() {
        let (straight, seconds) = drive.straight_parts(0.006, 1.0);
        let refused = |factor, wheelbase, ratio| {
            let error = straight.identify(factor, wheelbase, ratio).unwrap_err();
            assert_eq!(
                error.why,
                UnidentifiableReason::Straight,
                "{}: {error}",
                drive.name
            );
            assert!(error.product_m.is_none(), "{error}");
            error.figure
        };
        // So long that counting seconds instead of turning would accept it.
        let least_s = IdentifyConfig::default().least_turning_s;
        assert!(seconds > 4.0 * least_s, "{}: {seconds} s", drive.name);
        refused(1.0, None, Some(1.0));
        refused(RATIO, Some(WHEELBASE_M), None);
        let turning_s = refused(RATIO, None, None);
        eprintln!("{}: {turning_s:.1} of {seconds:.1} s turning", drive.name);
    }
}
