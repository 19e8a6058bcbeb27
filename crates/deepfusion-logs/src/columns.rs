//! Which column holds what, from its name and its unit.

use crate::units::SpeedUnit;

/// The parts of one column's header: `speed_kmh`, `Speed [km/h]` and `Speed (OBD)(km/h)` have the unit km/h.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Column {
    /// The header as it is in the file.
    pub(crate) header: String,
    /// The name in lower case, words separated by single spaces, without the unit.
    pub(crate) name: String,
    /// The unit, as written.
    pub(crate) unit: Option<String>,
    pub(crate) index: usize,
}

/// Names of a column of times, in order of preference: a phone's own clock before the satellites' time, which a log has once a second.
pub(crate) const TIMES: [&str; 20] = [
    "time",
    "timestamp",
    "device time",
    "datetime",
    "date time",
    "date/time",
    "t",
    "stamp",
    "timestamps",
    "unixtimemillis",
    "unix time",
    "unix timestamp",
    "utc time",
    "utc",
    "gps time",
    "seconds elapsed",
    "elapsed time",
    "elapsed",
    "seconds",
    "offset",
];
/// Names of a vehicle's own speed, in order of preference.
const OF_VEHICLE: [&str; 12] = [
    "speed",
    "velocity",
    "vehicle speed",
    "speed (obd)",
    "obd speed",
    "car speed",
    "vehicle speed sensor",
    "vss",
    "v",
    "wheel speed",
    "spd",
    "speedmps",
];
/// Names of a receiver's speed.
const OF_RECEIVER: [&str; 8] = [
    "gps speed",
    "speed (gps)",
    "gps velocity",
    "ground speed",
    "groundspeed",
    "speed over ground",
    "sog",
    "speed 2d",
];
/// Words for speed in the languages of the apps, and words that turn such a name into another quantity.
const SPEED_WORDS: [&str; 7] = [
    "speed",
    "velocity",
    "geschwindigkeit",
    "vitesse",
    "velocidad",
    "velocità",
    "скорость",
];
const OTHER_QUANTITIES: [&str; 9] = [
    "average",
    "maximum",
    "minimum",
    "limit",
    "engine",
    "accuracy",
    "vertical",
    "durchschnitt",
    "средн",
];
/// Such words that count only as whole words: "Geschwindigkeit" contains "wind".
const OTHER_WORDS: [&str; 8] = ["avg", "mean", "max", "min", "wind", "fan", "rpm", "turbine"];

impl Column {
    pub(crate) fn parse(index: usize, header: &str) -> Self {
        let text = header
            .trim()
            .trim_matches('"')
            .trim_start_matches('#')
            .trim();
        let (name, unit) = split_unit(text);
        let words: Vec<String> = name
            .to_lowercase()
            .split(|c: char| c.is_whitespace() || c == '_' || c == '-')
            .filter(|w| !w.is_empty())
            .map(str::to_owned)
            .collect();
        Self {
            header: header.to_owned(),
            name: words.join(" "),
            unit: unit
                .map(|u| u.trim().to_lowercase())
                .filter(|u| !u.is_empty()),
            index,
        }
    }

    /// The unit of speed in its header.
    pub(crate) fn speed_unit(&self) -> Option<SpeedUnit> {
        self.unit.as_deref()?.parse().ok()
    }

    /// How well its name fits a vehicle's speed: lower is better, `None` if it does not fit.
    pub(crate) fn speed_rank(&self) -> Option<usize> {
        speed_rank(&self.name)
    }
}

/// [`Column::speed_rank`] of a name in lower case.
pub(crate) fn speed_rank(name: &str) -> Option<usize> {
    if let Some(rank) = OF_VEHICLE.iter().position(|n| *n == name) {
        return Some(rank);
    }
    if let Some(rank) = OF_RECEIVER.iter().position(|n| *n == name) {
        return Some(100 + rank);
    }
    let speaks_of_speed = SPEED_WORDS.iter().any(|w| name.contains(w));
    let words = || name.split(|c: char| !c.is_alphanumeric());
    let of_another = OTHER_QUANTITIES.iter().any(|w| name.contains(w))
        || OTHER_WORDS.iter().any(|w| words().any(|word| word == *w));
    let of_receiver = name.contains("gps") || name.contains("gnss");
    (speaks_of_speed && !of_another).then_some(if of_receiver { 150 } else { 50 })
}

/// A name, and the unit in the brackets at its end or after its last underscore.
fn split_unit(text: &str) -> (&str, Option<&str>) {
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let Some(inside) = text.strip_suffix(close)
            && let Some((name, unit)) = inside.rsplit_once(open)
            && !name.trim().is_empty()
        {
            // "Speed (GPS)": a source and not a unit.
            return match unit.trim().to_lowercase().as_str() {
                "gps" | "obd" | "gnss" | "x" | "y" | "z" => (text, None),
                _ => (name, Some(unit)),
            };
        }
    }
    const UNITS: [&str; 22] = [
        "s", "sec", "ms", "us", "ns", "mps", "kmh", "kph", "kmph", "mph", "kn", "kts", "knots",
        "radps", "dps", "degps", "deg", "rad", "m", "g", "mps2", "m/s",
    ];
    match text.rsplit_once(['_', ' ']) {
        Some((name, unit)) if UNITS.contains(&unit.to_lowercase().as_str()) && name.len() > 1 => {
            (name, Some(unit))
        }
        _ => (text, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_split_into_name_and_unit() {
        for (header, name, unit) in [
            ("time_s", "time", Some("s")),
            ("Time (s)", "time", Some("s")),
            ("Speed (OBD)(km/h)", "speed (obd)", Some("km/h")),
            (
                " GPS Speed (Meters/second)",
                "gps speed",
                Some("meters/second"),
            ),
            ("Speed (GPS)", "speed (gps)", None),
            ("Vehicle Speed [mph]", "vehicle speed", Some("mph")),
            ("Gyroscope x (rad/s)", "gyroscope x", Some("rad/s")),
            ("seconds_elapsed", "seconds elapsed", None),
            ("[BMS] Speed (km/h)", "[bms] speed", Some("km/h")),
            ("Geschwindigkeit km/h", "geschwindigkeit km/h", None),
            ("SpeedMps", "speedmps", None),
        ] {
            let column = Column::parse(0, header);
            assert_eq!(
                (column.name.as_str(), column.unit.as_deref()),
                (name, unit),
                "{header}"
            );
        }
    }

    #[test]
    fn the_vehicles_speed_is_found_among_others() {
        let rank = |name: &str| speed_rank(name);
        assert!(rank("speed (obd)") < rank("gps speed"));
        assert!(rank("fahrzeuggeschwindigkeit") < rank("gps geschwindigkeit"));
        for other in [
            "average trip speed",
            "engine speed",
            "wind speed",
            "speedaccuracymps",
            "speed accuracy",
            "speed limit",
            "altitude",
        ] {
            assert_eq!(rank(other), None, "{other}");
        }
    }
}
