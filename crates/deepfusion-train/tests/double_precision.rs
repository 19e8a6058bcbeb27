//! The first steps of each network against PyTorch, in double precision, by the tensor operations that GPUs run, too. Networks and losses
//! equal PyTorch's, and gradients to 1e-5: in double precision, rounding does not decide about pixels.
//!
//! A test binary of its own, since a process chooses a device's number format once.

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

/// Two steps: the loss of the second depends on the first step's gradients and update.
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
