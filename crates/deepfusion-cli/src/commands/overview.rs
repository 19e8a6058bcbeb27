use crate::failure::Result;
use crate::output;

const OVERVIEW: &str = "\
deepfusion: metric depth from one camera and a speed signal, learned without depth labels.

Try it without any data (takes a few minutes):
  deepfusion demo

With your own recordings (KITTI raw, ROS bags, videos, folders):
  deepfusion data inspect DRIVE            what it contains, and whether you can train on it
  deepfusion doctor DRIVE                  what would go wrong in training
  deepfusion train --data DRIVE            learn from its images and speeds
  deepfusion eval --model RUN --data DRIVE measure against its LiDAR
  deepfusion predict --model RUN IMAGE --out DIR
                                           depth pictures, arrays, point clouds
  deepfusion perceive --model RUN DRIVE --out DIR
                                           3D targets: boxes, tracks, velocities
  deepfusion view DIR                      look at the results in the browser

Without recordings:
  deepfusion simulate --out DIR            a drive with exact ground truth

Metrics of any method, from arrays:
  deepfusion data export-gt DRIVE --out gt.npz
  deepfusion eval --pred depth.npz --pred-kind depth --gt gt.npz

Also: adapt (fine-tune a network on a new drive), calibrate (a camera, with a checkerboard),
compare (runs side by side, and with published tables), ablate (switch parts of the system off),
eval-odometry (the camera's trajectory), eval-targets (boxes), export (ONNX), data import (a speed
log and its video), data convert, weights list, average, pack, calibrate and import, bench, config
show, completions.
Every command has its own help: deepfusion train --help
";

/// `deepfusion` without arguments: what it can do, with examples to copy.
pub(super) fn run() -> Result<()> {
    output::print(OVERVIEW)?;
    if cfg!(feature = "train") {
        Ok(())
    } else {
        output::print(
            "\nThis build cannot train: it has no demo, train, adapt, ablate, eval-odometry, export and weights import.\n",
        )
    }
}
