//! Speed and steering from CAN frames, by the signals named in the file beside a bag.

use super::can_config::SignalConfig;
use super::config::BagConfig;
use crate::error::{HIGHEST_EXTENDED, HIGHEST_STANDARD};
use crate::{CanProblem, ConfigProblem, DataWarning, ExpectedValue, MotionWarning, Result};
use deepfusion_motion::can::{CanFrame, CanId, CanSignal, Dbc};
use deepfusion_rosbag::msg::Frame;

/// The signals that are read, each with its factor to m/s or rad.
#[derive(Debug, Default)]
pub(super) struct Can {
    speed: Option<(CanSignal, f64)>,
    steering: Option<(CanSignal, f64)>,
}

/// The values in one frame, with its time in nanoseconds.
#[derive(Debug, Default, PartialEq)]
pub(super) struct CanReading {
    pub(super) speed_mps: Option<(i64, f64)>,
    pub(super) steering_rad: Option<(i64, f64)>,
}

impl Can {
    /// The signals of the file beside a bag.
    ///
    /// # Errors
    /// [`crate::Error::Config`] for a missing or invalid DBC file, signal or unit.
    pub(super) fn of(config: &BagConfig) -> Result<Self> {
        let Some(can) = &config.can else {
            return Ok(Self::default());
        };
        let wrong = |e| config.wrong(CanProblem::Dbc(Box::new(e)));
        let dbc = can.dbc.as_ref();
        let dbc = dbc.map(|dbc| Dbc::open(&config.folder().join(dbc)));
        let dbc = dbc.transpose().map_err(wrong)?;
        let signal = |key: &'static str, signal: &SignalConfig| match (signal, &dbc) {
            (SignalConfig::Named(name), Some(dbc)) => dbc.signal(name).map_err(wrong),
            (SignalConfig::Named(name), None) => Err(config.wrong(CanProblem::NoDbc {
                key,
                signal: name.clone(),
            })),
            (SignalConfig::Inline(signal), _) => {
                check(signal, key).map_err(|problem| config.wrong(problem))?;
                Ok(signal.clone())
            }
        };
        let speed = match &can.speed {
            None => None,
            Some(source) => {
                let found = signal("speed", source)?;
                let unit = can.speed_unit.or_else(|| source.unit(dbc.as_ref()?));
                let unit = unit.ok_or_else(|| {
                    config.wrong(match source {
                        SignalConfig::Named(name) => CanProblem::UnknownSpeedUnit {
                            signal: name.clone(),
                        },
                        SignalConfig::Inline(_) => CanProblem::NoSpeedUnit,
                    })
                })?;
                Some((found, unit.metres_per_second()))
            }
        };
        let steering = match &can.steering {
            None => None,
            Some(source) => {
                let factor = can
                    .steering_rad
                    .ok_or_else(|| config.wrong(CanProblem::NoSteeringUnit))?;
                if !factor.is_finite() || factor == 0.0 {
                    return Err(config.wrong(ConfigProblem::Value {
                        key: "can.steering_rad",
                        value: factor,
                        expected: ExpectedValue::AsNamed,
                    }));
                }
                Some((signal("steering", source)?, factor))
            }
        };
        Ok(Self { speed, steering })
    }

    /// The values in a frame of this time. Remote requests and error frames carry no values, whatever their bytes.
    pub(super) fn read(&self, frame: &Frame, time_ns: i64) -> CanReading {
        let id = if frame.is_extended {
            Some(CanId::Extended { extended: frame.id })
        } else {
            u16::try_from(frame.id).ok().map(CanId::Standard)
        };
        let Some(id) = id.filter(|_| !frame.is_rtr && !frame.is_error) else {
            return CanReading::default();
        };
        let length = usize::from(frame.dlc).min(frame.data.len());
        let seen = CanFrame {
            time_s: 0.0,
            id,
            data: &frame.data[..length],
        };
        let value = |signal: &Option<(CanSignal, f64)>| {
            let (signal, factor) = signal.as_ref()?;
            let value = (signal.id == seen.id).then(|| signal.decode(seen.data))??;
            Some((time_ns, value * factor))
        };
        CanReading {
            speed_mps: value(&self.speed),
            steering_rad: value(&self.steering),
        }
    }

    /// Leaves out values outside their signal's range ([`CanSignal::keep_measured`]), with a warning for each signal.
    pub(super) fn keep_measured(
        &self,
        speeds: &mut Vec<(i64, f64)>,
        angles: &mut Vec<(i64, f64)>,
    ) -> Vec<DataWarning> {
        let signals = [
            ("can.speed", &self.speed, speeds),
            ("can.steering", &self.steering, angles),
        ];
        let mut warnings = Vec::new();
        for (key, signal, values) in signals {
            let Some((signal, factor)) = signal else {
                continue;
            };
            let beyond = signal.keep_measured(values, |(_, value)| value / factor);
            if beyond > 0 {
                let frames = beyond;
                warnings.push(MotionWarning::BeyondRange { key, frames }.into());
            }
        }
        warnings
    }

    /// Warnings about configured signals without any value, for which no other source was looked for.
    pub(super) fn silent(&self, speeds: usize, angles: usize) -> Vec<DataWarning> {
        let signals = [
            ("can.speed", &self.speed, speeds),
            ("can.steering", &self.steering, angles),
        ];
        let silent = signals.into_iter().filter(|(_, _, values)| *values == 0);
        silent
            .filter_map(|(key, signal, _)| {
                let id = signal.as_ref()?.0.id;
                Some(DataWarning::from(MotionWarning::SilentSignal { key, id }))
            })
            .collect()
    }
}

/// Refuses signals that do not fit into a frame.
fn check(signal: &CanSignal, key: &'static str) -> std::result::Result<(), CanProblem> {
    match signal.id {
        CanId::Standard(id) if id > HIGHEST_STANDARD => {
            return Err(CanProblem::StandardId { key, id });
        }
        CanId::Extended { extended } if extended > HIGHEST_EXTENDED => {
            return Err(CanProblem::ExtendedId { key, id: extended });
        }
        CanId::Standard(_) | CanId::Extended { .. } => {}
    }
    if signal.layout.scale == 0.0 {
        return Err(CanProblem::NoScale { key });
    }
    let switches = signal.multiplexed.iter().map(|m| &m.switch);
    for layout in std::iter::once(&signal.layout).chain(switches) {
        let checked = layout.validate(&format!("can.{key}"));
        checked.map_err(|e| CanProblem::Layout(Box::new(e)))?;
    }
    Ok(())
}
