use anyhow::Result;
use deepfusion_sim::{Scene, SimConfig, Simulation, write_kitti};

use crate::cli::{SceneChoice, SimulateArgs, SimulateFormat};
use crate::output;
use crate::progress::{Progress, say};

/// `deepfusion simulate`.
pub fn run(args: &SimulateArgs) -> Result<()> {
    let config = SimConfig {
        seed: args.seed,
        frames: args.frames,
        width: args.size.width,
        height: args.size.height,
        moving_cars: args.moving_cars,
        fps: args.fps,
        scene: match args.scene {
            SceneChoice::Urban => Scene::Urban,
        },
        scan_every: args.scan_every,
        ..SimConfig::default()
    };
    let simulation = Simulation::new(&config)?;
    let drive = match args.format {
        SimulateFormat::Kitti => {
            let mut progress = Progress::new("simulating");
            write_kitti(&simulation, &args.out, &mut |done, total| {
                progress.set(done, total)
            })?
        }
    };
    if args.json {
        return output::print_json(&serde_json::json!({
            "drive": drive,
            "frames": config.frames,
            "size": [config.width, config.height],
            "seed": config.seed,
        }));
    }
    say(&format!(
        "{} frames of {}x{} written",
        config.frames, config.width, config.height
    ));
    output::print(&format!("{}\n", drive.display()))
}
