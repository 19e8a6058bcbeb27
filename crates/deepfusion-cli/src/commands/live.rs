//! What `predict` and `perceive` share for a camera or a stream.

use std::io::IsTerminal;

use deepfusion_jobs::bulk::CameraSource;
use deepfusion_jobs::live::{Feed, LiveEnd, LiveLimits};
use deepfusion_video::Address;

use crate::cli::{LiveArgs, PredictionArgs};
use crate::error::CliError;
use crate::failure::Result;
use crate::interrupt;

/// The live source among the inputs, if there is one. It must be the only input; options of live sources are refused without one.
pub(super) fn source(inputs: &[String], args: &LiveArgs) -> Result<Option<Address>> {
    let mut found = inputs.iter().filter_map(|input| Address::parse(input));
    match (found.next(), args.given()) {
        (Some(address), _) if inputs.len() > 1 => Err(CliError::LiveAlone {
            address: address.to_string(),
        }
        .into()),
        (Some(address), _) if address.is_stdin() && std::io::stdin().is_terminal() => {
            Err(CliError::Terminal.into())
        }
        (Some(address), _) => {
            address.check()?;
            Ok(Some(address))
        }
        (None, Some(option)) => Err(CliError::OnlyLive { option }.into()),
        (None, None) => Ok(None),
    }
}

/// Starts reading a source, until Ctrl-C or the limits of the options. A camera is asked for images of its calibration's size, unless its
/// address asks for another: the driver's default is often the smallest.
pub(super) fn open(
    address: &Address,
    camera: &CameraSource,
    args: &PredictionArgs,
) -> Result<Feed> {
    let address = match camera.image_size() {
        Some(size) => address.clone().or_of_size(size),
        None => address.clone(),
    };
    let until = LiveLimits {
        frames: args.frames,
        duration_s: args.live.duration,
        timeout_s: args.live.timeout_s(),
        stop: interrupt::asked,
    };
    Ok(Feed::open(&address, &until)?)
}

/// Warns if a source's end may be a lost connection.
pub(super) fn warn_of_end(address: &Address, ending: &Result<LiveEnd>) {
    if matches!(ending, Ok(LiveEnd::Closed)) {
        tracing::warn!(
            "{address}: the other side closed the stream; it may have ended or been lost"
        );
    }
}
