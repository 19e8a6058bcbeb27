use crate::cli::{SimulateArgs, SimulateFormat, Size};
use crate::error::CliError;
use crate::failure::Result;
use crate::output;
use crate::progress::{Progress, say};
use deepfusion_hint::count_of;
use deepfusion_rosbag::Compression;
use deepfusion_sim::{
    BagSettings, DrawnDrive, Scene, Sensors, SimConfig, Simulation, write_bag, write_kitti,
};

/// `deepfusion simulate`.
pub(super) fn run(args: &SimulateArgs) -> Result<()> {
    check_layout(args)?;
    check_varied(args)?;
    let config = config(args);
    let simulation = Simulation::new(&config)?;
    let mut progress = Progress::new("simulating");
    let mut report = |done, total| progress.set(done, total);
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
        let mut made = serde_json::json!({
            "drive": drive,
            "frames": config.frames,
            "size": [config.width, config.height],
            "seed": config.seed,
        });
        if let Some(drawn) = simulation.drawn() {
            made["varied"] = serde_json::json!(drawn);
        }
        return output::print_json(&made);
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

/// That no option is given that would be silently without effect.
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
            ("--scan-every", "a bag's LiDAR has a rate of its own")
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

/// That nothing is asked for which a varied drive draws or has no room for, nor a place that only varied drives lead to.
///
/// # Errors
/// [`CliError::NotVaried`], [`CliError::OnlyVaried`].
fn check_varied(args: &SimulateArgs) -> Result<(), CliError> {
    let (option, why) = match args {
        args if !args.varied && !Scene::ALL.contains(&args.scene) => {
            let scene = args.scene.name();
            return Err(CliError::OnlyVaried { scene });
        }
        args if args.varied && args.camera_height.is_some() => {
            ("--camera-height", "the height is drawn, too")
        }
        args if args.varied && args.stereo.is_some() => (
            "--stereo",
            "cars may park beside the lane, where the second camera would be",
        ),
        _ => return Ok(()),
    };
    Err(CliError::NotVaried { option, why })
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

/// What to simulate; what is not said follows the layout's data set.
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
