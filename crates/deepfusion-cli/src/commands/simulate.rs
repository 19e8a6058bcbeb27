use crate::cli::{SimulateArgs, SimulateFormat, Size};
use crate::error::CliError;
use crate::failure::Result;
use crate::output;
use crate::progress::{Progress, say};
use deepfusion_hint::count_of;
use deepfusion_rosbag::Compression;
use deepfusion_sim::{BagSettings, Sensors, SimConfig, Simulation, write_bag, write_kitti};

/// `deepfusion simulate`.
pub(super) fn run(args: &SimulateArgs) -> Result<()> {
    check_layout(args)?;
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
        return output::print_json(&serde_json::json!({
            "drive": drive,
            "frames": config.frames,
            "size": [config.width, config.height],
            "seed": config.seed,
        }));
    }
    say(&format!(
        "{} of {}x{} written",
        count_of(config.frames, "frame"),
        config.width,
        config.height
    ));
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

/// What to simulate; what is not said follows the layout's data set.
fn config(args: &SimulateArgs) -> SimConfig {
    let (sensors, size, fps) = match args.format {
        SimulateFormat::Kitti => (Sensors::Kitti, (640, 192), 10.0),
        SimulateFormat::Bag => (Sensors::Umad, (640, 480), 25.0),
    };
    let (width, height) = args
        .size
        .map_or(size, |Size { width, height }| (width, height));
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
        camera_height_m: args.camera_height,
        stereo_baseline_m: args.stereo.unwrap_or(0.0),
        scan_every: args.scan_every.unwrap_or(1),
        ..SimConfig::default()
    }
}
