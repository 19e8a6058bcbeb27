//! `[can]` of the file beside a bag: the CAN signals for speed and steering.

use deepfusion_motion::can::{CanSignal, Dbc};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::path::PathBuf;

/// The table `[can]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CanConfig {
    /// Path of the DBC file, relative to this file; needed for signals given by name.
    pub(super) dbc: Option<PathBuf>,
    pub(super) speed: Option<SignalConfig>,
    pub(super) speed_unit: Option<SpeedUnit>,
    pub(super) steering: Option<SignalConfig>,
    /// Radians per unit of the steering signal: 0.0174533 if it is in degrees.
    pub(super) steering_rad: Option<f64>,
}

/// A signal: the name `Message.Signal` in the DBC file, or a full definition.
#[derive(Debug, Clone)]
pub(super) enum SignalConfig {
    Named(String),
    Inline(CanSignal),
}

/// Unit of a speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub(super) enum SpeedUnit {
    #[serde(rename = "m/s")]
    MetresPerSecond,
    #[serde(rename = "km/h")]
    KilometresPerHour,
    #[serde(rename = "mph")]
    MilesPerHour,
}

impl SpeedUnit {
    pub(super) fn metres_per_second(self) -> f64 {
        match self {
            Self::MetresPerSecond => 1.0,
            Self::KilometresPerHour => 1.0 / 3.6,
            Self::MilesPerHour => 0.44704,
        }
    }
}

impl SignalConfig {
    /// The unit in the DBC file, for a signal given by name.
    pub(super) fn unit(&self, dbc: &Dbc) -> Option<SpeedUnit> {
        match self {
            Self::Named(name) => unit_of(dbc.unit(name)?),
            Self::Inline(_) => None,
        }
    }
}

fn unit_of(text: &str) -> Option<SpeedUnit> {
    match text.trim().to_lowercase().as_str() {
        "m/s" => Some(SpeedUnit::MetresPerSecond),
        "km/h" | "kph" | "kmh" => Some(SpeedUnit::KilometresPerHour),
        "mph" => Some(SpeedUnit::MilesPerHour),
        _ => None,
    }
}

/// Written by hand, because the errors of an untagged enum do not name the wrong field.
impl<'de> Deserialize<'de> for SignalConfig {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct SignalVisitor;

        impl<'de> Visitor<'de> for SignalVisitor {
            type Value = SignalConfig;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"Message.Signal\" from the DBC file, or { id = …, layout = { … } }")
            }

            fn visit_str<E: serde::de::Error>(
                self,
                name: &str,
            ) -> std::result::Result<Self::Value, E> {
                if name.is_empty() {
                    Err(E::invalid_length(0, &self))
                } else {
                    Ok(SignalConfig::Named(name.to_owned()))
                }
            }

            fn visit_map<A: MapAccess<'de>>(
                self,
                map: A,
            ) -> std::result::Result<Self::Value, A::Error> {
                CanSignal::deserialize(MapAccessDeserializer::new(map))
                    .map(SignalConfig::Inline)
                    .map_err(A::Error::custom)
            }
        }

        deserializer.deserialize_any(SignalVisitor)
    }
}
