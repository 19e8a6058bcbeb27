//! Cameras and streams: always takes the newest frame, measures its latency, and makes depth ([`predict`]) or targets ([`perceive`]).

mod depth;
mod feed;
mod figures;
mod folder;
mod targets;

pub use depth::{LiveDepth, predict};
pub use feed::{Feed, LiveEnd, LiveLimits, run};
pub use folder::{VIDEO, make_room};
pub use targets::{LiveTargets, perceive};

use deepfusion_video::{Address, LiveFrame};

use crate::Input;

/// A frame as an input, named by its number in the stream.
#[must_use]
pub fn input(address: &Address, frame: &LiveFrame) -> Input {
    Input {
        path: address.to_string().into(),
        name: folder::frame_name(frame.number),
        frame: None,
    }
}
