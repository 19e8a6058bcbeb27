use crate::cli::{SimulateArgs, SimulateFormat, Size};
use crate::error::CliError;
use crate::failure::Result;
use crate::output;
use crate::progress::{Progress, say};
use deepfusion_hint::count_of;
use deepfusion_sim::{BagSettings, Sensors, SimConfig, Simulation, write_bag, write_kitti};

/// `deepfusion simulate`.
pub(super) fn run(args: &SimulateArgs) -> Result<()> {
    if args.format == SimulateFormat::Kitti && args.clock_offset != 0.0 {
        return Err(CliError::OneClock.into());
    }
    let config = config(args);
    let simulation = Simulation::new(&config)?;
    let mut progress = Progress::new("simulating");
    let mut report = |done, total| progress.set(done, total);
    let drive = match args.format {
        SimulateFormat::Kitti => write_kitti(&simulation, &args.out, &mut report)?,
        SimulateFormat::Bag => {
            let settings = BagSettings {
                compression: args.compression,
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
        fps: args.fps.unwrap_or(fps),
        scene: args.scene,
        sensors: args.sensors.unwrap_or(sensors),
        camera_height_m: args.camera_height,
        stereo_baseline_m: args.stereo.unwrap_or(0.0),
        scan_every: args.scan_every,
        ..SimConfig::default()
    }
}
