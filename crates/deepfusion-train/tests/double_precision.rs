//! The first steps of each network beside PyTorch's, in double precision, by the tensor operations that GPUs compute, too: the networks and
//! losses are PyTorch's, and gradients the same to 1e-5, where no rounding decides for a pixel.
//!
//! A program of its own, since a device's numbers are chosen once in a process.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

#[path = "whole_step/steps.rs"]
mod steps;

use std::sync::Once;

use burn::tensor::{Device, FloatDType};
use deepfusion_train::Preset;
use steps::{Numbers, check};

/// Two steps: the second's loss has the first's gradients and update in it.
fn check_in_double(preset: Preset) {
    static CHOSEN: Once = Once::new();
    CHOSEN.call_once(|| Device::flex().configure(FloatDType::F64).unwrap());
    check(preset, Numbers::Double, 2);
}

#[test]
fn monodepth2() {
    check_in_double(Preset::Monodepth2);
}

#[test]
fn monodepth2_with_resnet50() {
    check_in_double(Preset::Monodepth2R50);
}

#[test]
fn lite_mono() {
    check_in_double(Preset::LiteMono);
}

#[test]
fn r_msfm3() {
    check_in_double(Preset::RMsfm3);
}

#[test]
fn r_msfm6() {
    check_in_double(Preset::RMsfm6);
}

#[test]
fn sfmlearner() {
    check_in_double(Preset::Sfmlearner);
}

#[test]
fn the_papers_depth_network() {
    check_in_double(Preset::Paper);
}
