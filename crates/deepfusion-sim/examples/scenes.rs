//! A picture of every scene: `cargo run -p deepfusion-sim --example scenes -- FOLDER [SEED]`.

use deepfusion_sim::{Scene, Sensors, SimConfig, Simulation};
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "scenes".into()));
    let seed = arguments.next().map_or(Ok(1), |seed| seed.parse())?;
    std::fs::create_dir_all(&folder)?;
    for scene in Scene::ALL {
        let config = SimConfig {
            seed,
            frames: 101,
            width: 640,
            height: 480,
            fps: 25.0,
            moving_cars: 6,
            scene,
            sensors: Sensors::Umad,
            ..SimConfig::default()
        };
        let simulation = Simulation::new(&config)?;
        let path = folder.join(format!("{}.png", scene.name()));
        simulation.frame(100).rgb.save(&path)?;
        println!("{}", path.display());
    }
    Ok(())
}
