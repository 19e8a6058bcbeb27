use clap::Args;

use super::values::positive;

/// What only live sources (cameras, streams, standard input) have.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct LiveArgs {
    /// Stop this many seconds after the first frame.
    #[arg(long, allow_negative_numbers = true, value_name = "S", help_heading = HEADING, value_parser = positive)]
    pub duration: Option<f64>,
    /// Give up on a source that sends nothing for this many seconds [default: 10].
    #[arg(long, allow_negative_numbers = true, value_name = "S", help_heading = HEADING, value_parser = positive)]
    pub timeout: Option<f64>,
}

/// Heading of these options in the help.
pub(super) const HEADING: &str = "Live sources";

impl LiveArgs {
    /// The first option that was given.
    pub(crate) fn given(&self) -> Option<&'static str> {
        [
            (self.duration.is_some(), "--duration"),
            (self.timeout.is_some(), "--timeout"),
        ]
        .into_iter()
        .find_map(|(given, name)| given.then_some(name))
    }

    /// Seconds of silence after which the source is given up.
    pub(crate) fn timeout_s(&self) -> f64 {
        self.timeout.unwrap_or(10.0)
    }
}
