use std::path::Path;

use crate::cli::{SimulateArgs, SimulateFormat, Size};
use crate::error::CliError;
use crate::failure::Result;
use crate::interrupt;
use crate::output;
use crate::progress::{Progress, say};
use deepfusion_hint::count_of;
use deepfusion_rosbag::Compression;
use deepfusion_sim::{
    BagSettings, DrawnDrive, Scene, Sensors, SimConfig, Simulation, VariedConflict, write_bag,
    write_kitti,
};

/// What was made, for scripts.
#[derive(serde::Serialize)]
struct Made<'a> {
    drive: &'a Path,
    frames: usize,
    size: [u32; 2],
    seed: u64,
    moving_cars: usize,
    /// What was drawn for a varied drive.
    #[serde(skip_serializing_if = "Option::is_none")]
    varied: Option<&'a DrawnDrive>,
}

/// `deepfusion simulate`.
pub(super) fn run(args: &SimulateArgs) -> Result<()> {
    check_layout(args)?;
    check_varied(args)?;
    let config = config(args);
    let simulation = Simulation::new(&config)?;
    if let Some(warning) = fewer_cars(config.moving_cars, simulation.moving_cars()) {
        tracing::warn!("{warning}");
    }
    interrupt::catch("stopping after the current frames");
    let mut progress = Progress::new("simulating");
    let mut report = |done, total| {
        progress.set(done, total);
        interrupt::flow()
    };
    let drive = match args.format {
        SimulateFormat::Kitti => write_kitti(&simulation, &args.out, &mut report)?,
        SimulateFormat::Bag => {
            let settings = BagSettings {
                compression: args.compression.unwrap_or(Compression::Lz4),
                clock_offset_s: 1e-3 * args.clock_offset,
                ..BagSettings::default()
            };
            write_bag(&simulation, &args.out, &settings, &mut report)?
        }
    };
    drop(progress);
    if args.json {
        return output::print_json(&Made {
            drive: &drive,
            frames: config.frames,
            size: [config.width, config.height],
            seed: config.seed,
            moving_cars: simulation.moving_cars(),
            varied: simulation.drawn(),
        });
    }
    say(&format!(
        "{} of {}x{} written",
        count_of(config.frames, "frame"),
        config.width,
        config.height
    ));
    if let Some(drawn) = simulation.drawn() {
        say(&in_a_line(drawn));
    }
    output::print(&format!("{}\n", drive.display()))
}

/// Refuses options that would silently have no effect.
///
/// # Errors
/// [`CliError::OtherLayout`].
fn check_layout(args: &SimulateArgs) -> Result<(), CliError> {
    let is_bag = args.format == SimulateFormat::Bag;
    let (option, why) = match args {
        args if !is_bag && args.clock_offset != 0.0 => {
            ("--clock-offset", "a KITTI drive has one clock")
        }
        args if !is_bag && args.compression.is_some() => {
            ("--compression", "a KITTI drive is a folder of files")
        }
        args if is_bag && args.scan_every.is_some() => {
            ("--scan-every", "a bag's LiDAR has its own rate")
        }
        _ => return Ok(()),
    };
    let layout = if is_bag { "kitti" } else { "bag" };
    Err(CliError::OtherLayout {
        option,
        why,
        layout,
    })
}

/// Refuses options that a varied drive draws or cannot have, and scenes that only varied drives have. The library refuses the same, but
/// cannot distinguish a given height from the default.
///
/// # Errors
/// [`CliError::Varied`].
fn check_varied(args: &SimulateArgs) -> Result<(), CliError> {
    let (given, why) = match (args.camera_height, args.stereo) {
        _ if !args.varied && !Scene::ALL.contains(&args.scene) => {
            let given = format!("--scene {}", args.scene.name());
            (given, VariedConflict::OnlyVaried)
        }
        (Some(metres), _) if args.varied => {
            let given = format!("--camera-height {metres}");
            (given, VariedConflict::CameraHeight)
        }
        (_, Some(metres)) if args.varied => {
            let given = format!("--stereo {metres}");
            (given, VariedConflict::SecondCamera)
        }
        _ => return Ok(()),
    };
    Err(CliError::Varied { given, why })
}

/// The warning if fewer cars drive than were asked for.
fn fewer_cars(asked: usize, driving: usize) -> Option<String> {
    let drive = if driving == 1 { "drives" } else { "drive" };
    (driving < asked).then(|| {
        format!("--moving-cars {asked}: only {driving} {drive}; the others would hit something that stands on this street")
    })
}

/// The camera and the weather of a varied drive, for people.
fn in_a_line(drawn: &DrawnDrive) -> String {
    let camera = &drawn.camera;
    let k = &camera.intrinsics;
    let field = 2.0 * (0.5 * f64::from(k.width) / k.fx).atan();
    let looks = if camera.pitch_degrees < 0.0 {
        "up"
    } else {
        "down"
    };
    format!(
        "varied: a camera {:.2} m above the road, {:.0}° wide, looking {:.1}° {looks}; weather: {}",
        camera.height_m.unwrap_or_default(),
        field.to_degrees(),
        camera.pitch_degrees.abs(),
        drawn.light.weather.name()
    )
}

/// What to simulate. Defaults follow the data set whose layout is written.
fn config(args: &SimulateArgs) -> SimConfig {
    let (sensors, size, fps) = match args.format {
        SimulateFormat::Kitti => (Sensors::Kitti, (640, 192), 10.0),
        SimulateFormat::Bag => (Sensors::Umad, (640, 480), 25.0),
    };
    let (width, height) = args
        .size
        .map_or(size, |Size { width, height }| (width, height));
    let usual = SimConfig::default();
    SimConfig {
        seed: args.seed,
        frames: args.frames,
        width,
        height,
        moving_cars: args.moving_cars,
        riders: args.riders,
        fps: args.fps.unwrap_or(fps),
        scene: args.scene,
        sensors: args.sensors.unwrap_or(sensors),
        varied: args.varied,
        camera_height_m: args.camera_height.unwrap_or(usual.camera_height_m),
        stereo_baseline_m: args.stereo.unwrap_or(0.0),
        scan_every: args.scan_every.unwrap_or(1),
        ..usual
    }
}

#[cfg(test)]
mod tests {
    use super::fewer_cars;

    #[test]
    fn a_street_with_room_for_fewer_cars_gives_a_warning() {
        let warning = fewer_cars(6, 1).unwrap();
        assert!(warning.starts_with("--moving-cars 6: only 1 drives"));
        assert_eq!(fewer_cars(6, 6), None);
        assert_eq!(fewer_cars(0, 0), None);
    }
}
