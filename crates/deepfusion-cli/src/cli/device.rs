//! `--device`: where to compute.

use clap::builder::{PossibleValue, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};

use crate::devices::{Backend, ComputeDevice, NoDevice};

/// Reads `--device`: the names of [`Backend::ALL`], with an index, and `auto`.
pub(super) fn device() -> impl TypedValueParser<Value = ComputeDevice> {
    Parser
}

#[derive(Clone)]
struct Parser;

impl TypedValueParser for Parser {
    type Value = ComputeDevice;

    fn parse_ref(
        &self,
        command: &clap::Command,
        arg: Option<&clap::Arg>,
        value: &std::ffi::OsStr,
    ) -> Result<ComputeDevice, clap::Error> {
        let given = value.to_string_lossy();
        ComputeDevice::chosen(&given).map_err(|why| {
            let mut error = clap::Error::new(ErrorKind::InvalidValue).with_cmd(command);
            if let Some(arg) = arg {
                let named = ContextValue::String(arg.to_string());
                error.insert(ContextKind::InvalidArg, named);
            }
            let given = ContextValue::String(given.into_owned());
            error.insert(ContextKind::InvalidValue, given);
            let valid = match why {
                NoDevice::Index => vec!["cuda:1".into(), "vulkan:0".into()],
                _ => self
                    .possible_values()
                    .into_iter()
                    .flatten()
                    .filter(|value| !value.is_hide_set())
                    .map(|value| value.get_name().to_owned())
                    .collect(),
            };
            error.insert(ContextKind::ValidValue, ContextValue::Strings(valid));
            error
        })
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let auto = PossibleValue::new("auto")
            .help("A GPU if this build and this machine have one, else the processor");
        let named = Backend::ALL.iter().map(|one| {
            let named = PossibleValue::new(one.name());
            named.help(one.meaning()).hide(!one.is_built())
        });
        Some(Box::new(named.chain([auto])))
    }
}
