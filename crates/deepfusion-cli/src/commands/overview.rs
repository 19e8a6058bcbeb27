use crate::failure::Result;
use crate::output;

const OVERVIEW: &str = "\
deepfusion: metric depth from one camera and a speed signal, learnt without depth labels.

Try it, with no data at all (a few minutes):
  deepfusion demo

With recordings (KITTI raw, ROS bags, videos, folders):
  deepfusion data inspect DRIVE            what is in it, and whether it can train
  deepfusion doctor DRIVE                  what would go wrong, before training
  deepfusion train --data DRIVE            learn from its images and speeds
  deepfusion eval --model RUN --data DRIVE measure against its LiDAR
  deepfusion predict --model RUN IMAGE --out DIR
                                           depth pictures, arrays, point clouds
  deepfusion perceive --model RUN DRIVE --out DIR
                                           3D targets: boxes, tracks, velocities
  deepfusion view DIR                      look at them in the browser

Without recordings:
  deepfusion simulate --out DIR            a drive with exact ground truth

Numbers of any method, from arrays:
  deepfusion data export-gt DRIVE --out gt.npz
  deepfusion eval --pred depth.npz --pred-kind depth --gt gt.npz

Also: adapt (a trained network to a new drive), calibrate (a camera, from a checkerboard), compare
(runs side by side, published tables), ablate (the system's parts on and off), eval-odometry (the
camera's path), eval-targets (boxes), export (ONNX), data import (a log beside a video), data convert,
weights list, average, pack, calibrate and import (networks), bench, config show, completions.
Every command explains itself: deepfusion train --help
";

/// `deepfusion` alone: what it can do, with examples to copy.
pub(super) fn run() -> Result<()> {
    output::print(OVERVIEW)?;
    if cfg!(feature = "train") {
        Ok(())
    } else {
        output::print(
            "\nThis build is without training: demo, train, ablate, eval-odometry, export and weights import are left out.\n",
        )
    }
}
