//! Trains on a KITTI drive and prints the pace: `cargo run --release --example drive -- DRIVE PRESET STEPS WIDTH HEIGHT BATCH OUT`.
use burn::tensor::Device;
use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_train::*;
#[global_allocator]
static GLOBAL: mimalloc::MiMalloc = mimalloc::MiMalloc;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let mut config = Preset::ALL.iter().find(|p| p.1 == a[2]).unwrap().0.config();
    config.steps = Some(a[3].parse().unwrap());
    config.size.width = a[4].parse().unwrap();
    config.size.height = a[5].parse().unwrap();
    config.batch = a[6].parse().unwrap();
    config.validate_every = 100;
    for kv in &a[8..] {
        let (k, v) = kv.split_once('=').unwrap();
        match k {
            "lr" => config.learning_rate = v.parse().unwrap(),
            "pose" => {
                config.reversed_pose = if v == "inv" {
                    ReversedPose::Inverted
                } else {
                    ReversedPose::Predicted
                }
            }
            "moving" => config.start_moving = v == "1",
            "seed" => config.seed = v.parse().unwrap(),
            "speed" => config.loss.speed = v.parse().unwrap(),
            "smooth" => config.loss.smoothness = v.parse().unwrap(),
            _ => panic!(),
        }
    }
    let sets = Dataset::open(std::path::Path::new(&a[1]), &OpenOptions::default()).unwrap();
    let (train, val, skipped) = SampleSet::split(&config, sets, None).unwrap();
    println!("{} {} {skipped:?}", train.samples.len(), val.samples.len());
    let folder = RunFolder::create(std::path::Path::new(&a[7])).unwrap();
    let mut t = Trainer::create(config, folder, (train, val), &Device::flex(), Ok).unwrap();
    let s = t.run(&mut |e| {
        match e {
            TrainEvent::Step { step, losses, images_per_second, remaining_s, scale_ratio, gradient_norm, .. } => if step % 20 == 0 || step < 5 {
                println!("{step} {:.4} rp {:.4} sm {:.4} sp {:.4} valid {:.3} expl {:.3} img/s {images_per_second:.1} rem {remaining_s:.0} ratio {scale_ratio:.3} g {gradient_norm:.3}", losses.total, losses.reprojection, losses.smoothness, losses.speed, losses.valid_share, losses.explained_share);
            },
            TrainEvent::Panel { .. } | TrainEvent::Saved { .. } => {}
            e => println!("{e:?}"),
        }
        Control::Continue
    }).unwrap();
    println!("{s:?}");
}
