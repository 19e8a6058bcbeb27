//! Steps of each network against PyTorch, in single precision, with the kernels: twenty for the two quick networks, eight for the others.

mod steps;

use deepfusion_train::Preset;
use steps::{Numbers, check};

#[test]
fn monodepth2() {
    check(Preset::Monodepth2, Numbers::Single, 20);
}

#[test]
fn monodepth2_with_resnet50() {
    check(Preset::Monodepth2R50, Numbers::Single, 8);
}

#[test]
fn lite_mono() {
    check(Preset::LiteMono, Numbers::Single, 8);
}

#[test]
fn r_msfm3() {
    check(Preset::RMsfm3, Numbers::Single, 8);
}

#[test]
fn r_msfm6() {
    check(Preset::RMsfm6, Numbers::Single, 8);
}

#[test]
fn sfmlearner() {
    check(Preset::Sfmlearner, Numbers::Single, 8);
}

#[test]
fn the_papers_depth_network() {
    check(Preset::Paper, Numbers::Single, 20);
}
