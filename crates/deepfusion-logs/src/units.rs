use deepfusion_hint::Hint;
use std::fmt;
use std::str::FromStr;

/// Units of speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpeedUnit {
    /// m/s.
    MetresPerSecond,
    /// km/h.
    KilometresPerHour,
    /// Miles per hour.
    MilesPerHour,
    /// Nautical miles per hour.
    Knots,
}

impl SpeedUnit {
    /// All units.
    pub const ALL: [Self; 4] = [
        Self::MetresPerSecond,
        Self::KilometresPerHour,
        Self::MilesPerHour,
        Self::Knots,
    ];

    /// One unit in m/s.
    #[must_use]
    pub fn mps(self) -> f64 {
        match self {
            Self::MetresPerSecond => 1.0,
            Self::KilometresPerHour => 1.0 / 3.6,
            Self::MilesPerHour => 0.447_04,
            Self::Knots => 1852.0 / 3600.0,
        }
    }
}

impl fmt::Display for SpeedUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::MetresPerSecond => "m/s",
            Self::KilometresPerHour => "km/h",
            Self::MilesPerHour => "mph",
            Self::Knots => "knots",
        })
    }
}

impl FromStr for SpeedUnit {
    type Err = UnknownUnit;

    /// The spellings that recorders use.
    fn from_str(word: &str) -> Result<Self, UnknownUnit> {
        match word.trim().to_lowercase().as_str() {
            "m/s" | "mps" | "m s^-1" | "m s-1" | "ms^-1" | "meters/second" | "metres/second"
            | "meters per second" | "metres per second" | "m/sec" => Ok(Self::MetresPerSecond),
            "km/h" | "kmh" | "kph" | "kmph" | "km/hr" | "км/ч" => Ok(Self::KilometresPerHour),
            "mph" | "mi/h" | "miles/h" | "miles/hour" => Ok(Self::MilesPerHour),
            "kn" | "kt" | "kts" | "knot" | "knots" => Ok(Self::Knots),
            _ => Err(UnknownUnit(word.to_owned())),
        }
    }
}

/// The text does not name a unit of speed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not a unit of speed: m/s, km/h, mph or knots")]
#[non_exhaustive]
pub struct UnknownUnit(pub String);

impl Hint for UnknownUnit {
    /// The message itself lists the units.
    fn hint(&self) -> Option<String> {
        None
    }
}
