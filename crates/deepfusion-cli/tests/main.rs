//! The program as its users run it.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

mod ablate;
mod adapt;
mod architecture;
mod average;
mod bag;
mod bag_video;
mod bulk;
mod calibrate;
mod clocks;
mod compare;
mod demo;
mod doctor;
mod drive;
mod evaluation;
mod export;
mod import;
mod int8;
mod layouts;
mod learned_camera;
mod live;
mod paper;
mod perceive;
mod recipes;
mod rgbd;
mod scale;
mod shipped;
mod splits;
mod stopped;
mod support;
mod texts;
mod train;
mod uncertainty;
mod verdict;
mod view;
