//! What `predict` and `perceive` do alike with a camera or a stream: always the newest frame, and how late it is.

mod feed;
mod figures;
mod folder;

pub(super) use self::feed::{Feed, run};
pub(super) use self::folder::{VIDEO, make_room};

use std::io::IsTerminal;

use deepfusion_jobs::Input;
use deepfusion_video::{Address, LiveFrame};

use crate::cli::LiveArgs;
use crate::error::CliError;
use crate::failure::Result;

/// The live source among the arguments, if they name one; it is then alone, and options of live sources are for it.
pub(super) fn source(inputs: &[String], args: &LiveArgs) -> Result<Option<Address>, CliError> {
    let mut found = inputs.iter().filter_map(|input| Address::parse(input));
    match (found.next(), args.given()) {
        (Some(address), _) if inputs.len() > 1 => Err(CliError::LiveAlone {
            address: address.to_string(),
        }),
        (Some(address), _) if address.is_stdin() && std::io::stdin().is_terminal() => {
            Err(CliError::Terminal)
        }
        (Some(address), _) => Ok(Some(address)),
        (None, Some(option)) => Err(CliError::OnlyLive { option }),
        (None, None) => Ok(None),
    }
}

/// A frame as an input among others: named by its place in the stream.
pub(super) fn input(address: &Address, frame: &LiveFrame) -> Input {
    Input {
        path: address.to_string().into(),
        name: folder::name(frame.number),
        frame: None,
    }
}
