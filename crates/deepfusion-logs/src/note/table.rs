//! How a table was interpreted.

use crate::units::SpeedUnit;
use deepfusion_hint::count_of;

/// How a table was interpreted, or what was left out.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TableNote {
    /// A column holds the speeds.
    #[error("time from column '{time}', speed from column '{speed}' in {unit}")]
    Column {
        /// The header of the column of times.
        time: String,
        /// The header of the column of speeds.
        speed: String,
        /// The speeds' unit.
        unit: SpeedUnit,
    },
    /// Rows with one name hold the speeds.
    #[error("time from column '{time}', speed from the rows of '{name}' in {unit}")]
    Rows {
        /// The header of the column of times.
        time: String,
        /// The name of these rows.
        name: String,
        /// The speeds' unit.
        unit: SpeedUnit,
    },
    /// The speeds follow from positions.
    #[error("time from column '{time}', positions from '{latitude}' and '{longitude}'")]
    Positions {
        /// The header of the column of times.
        time: String,
        /// The header of the column of latitudes.
        latitude: String,
        /// The header of the column of longitudes.
        longitude: String,
    },
    /// The header is repeated among the rows.
    #[error("the header is repeated {} among the rows", times(*more))]
    HeaderAgain {
        /// Number of repetitions.
        more: usize,
    },
    /// Rows without a speed.
    #[error(
        "{absent} of {} {} left out",
        count_of(*rows, "row"),
        if *absent == 1 { "has no speed and is" } else { "have no speed and are" }
    )]
    NoSpeed {
        /// Number of rows without a speed.
        absent: usize,
        /// Number of rows that could have one.
        rows: usize,
    },
    /// Rows with the same time as the one above.
    #[error(
        "{repeated} of {} {} left out",
        count_of(*rows, "row"),
        if *repeated == 1 { "repeats the time of the row above and is" } else { "repeat the time of the row above and are" }
    )]
    Repeated {
        /// Number of such rows.
        repeated: usize,
        /// Number of rows that could have a speed.
        rows: usize,
    },
    /// Rows that go back in time.
    #[error(
        "{back} of {} {} left out",
        count_of(*rows, "row"),
        if *back == 1 { "goes back in time and is" } else { "go back in time and are" }
    )]
    Backwards {
        /// Number of such rows.
        back: usize,
        /// Number of rows that could be used.
        rows: usize,
    },
    /// Rows whose time is later than that of the rows that follow.
    #[error(
        "{ahead} of {} {} left out",
        count_of(*rows, "row"),
        if *ahead == 1 { "jumps ahead in time and is" } else { "jump ahead in time and are" }
    )]
    Ahead {
        /// Number of such rows.
        ahead: usize,
        /// Number of rows that could be used.
        rows: usize,
    },
    /// Rows whose latitude or longitude is invalid.
    #[error(
        "left out, as they have no valid latitude and longitude: {beyond} of {}",
        count_of(*rows, "row")
    )]
    NoDegrees {
        /// Number of such rows.
        beyond: usize,
        /// Number of rows in the table.
        rows: usize,
    },
    /// A column of yaw rates whose unit is not known.
    #[error(
        "column '{column}' is left out, as {}: name it yaw_rate_radps or yaw_rate_dps (positive to the left)",
        not_known(unit.as_deref())
    )]
    YawRateUnit {
        /// Header of the column.
        column: String,
        /// The unit in the header, if it has one.
        unit: Option<String>,
    },
    /// A column holds the yaw rates.
    #[error(
        "yaw rate from column '{column}', taken as positive to the left: if it is not, change its sign"
    )]
    YawRate {
        /// Header of the column.
        column: String,
    },
}

fn times(count: usize) -> String {
    match count {
        1 => "once".to_owned(),
        n => format!("{n} times"),
    }
}

fn not_known(unit: Option<&str>) -> String {
    match unit {
        Some(unit) => format!("its unit '{unit}' is not known"),
        None => "it has no unit".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_columns_are_named() {
        let time = || "Time (s)".to_owned();
        let unit = SpeedUnit::MilesPerHour;
        for (note, text) in [
            (
                TableNote::Column {
                    time: time(),
                    speed: "Vehicle speed".into(),
                    unit,
                },
                "time from column 'Time (s)', speed from column 'Vehicle speed' in mph",
            ),
            (
                TableNote::Rows {
                    time: time(),
                    name: "Vehicle speed".into(),
                    unit,
                },
                "time from column 'Time (s)', speed from the rows of 'Vehicle speed' in mph",
            ),
            (
                TableNote::Positions {
                    time: time(),
                    latitude: "lat".into(),
                    longitude: "lon".into(),
                },
                "time from column 'Time (s)', positions from 'lat' and 'lon'",
            ),
            (
                TableNote::YawRateUnit {
                    column: "yaw rate".into(),
                    unit: None,
                },
                "column 'yaw rate' is left out, as it has no unit: name it yaw_rate_radps or yaw_rate_dps (positive to the left)",
            ),
            (
                TableNote::YawRateUnit {
                    column: "yaw rate (rpm)".into(),
                    unit: Some("rpm".into()),
                },
                "column 'yaw rate (rpm)' is left out, as its unit 'rpm' is not known: name it yaw_rate_radps or yaw_rate_dps (positive to \
                 the left)",
            ),
            (
                TableNote::YawRate {
                    column: "yaw_rate_dps".into(),
                },
                "yaw rate from column 'yaw_rate_dps', taken as positive to the left: if it is not, change its sign",
            ),
        ] {
            assert_eq!(note.to_string(), text);
        }
    }

    #[test]
    fn rows_are_counted() {
        let rows = 20;
        for (note, text) in [
            (
                TableNote::HeaderAgain { more: 3 },
                "the header is repeated 3 times among the rows",
            ),
            (
                TableNote::NoSpeed { absent: 2, rows },
                "2 of 20 rows have no speed and are left out",
            ),
            (
                TableNote::Repeated { repeated: 4, rows },
                "4 of 20 rows repeat the time of the row above and are left out",
            ),
            (
                TableNote::NoSpeed { absent: 1, rows },
                "1 of 20 rows has no speed and is left out",
            ),
            (
                TableNote::Repeated {
                    repeated: 1,
                    rows: 1,
                },
                "1 of 1 row repeats the time of the row above and is left out",
            ),
            (
                TableNote::Backwards { back: 1, rows: 200 },
                "1 of 200 rows goes back in time and is left out",
            ),
            (
                TableNote::Backwards { back: 2, rows: 200 },
                "2 of 200 rows go back in time and are left out",
            ),
            (
                TableNote::Ahead {
                    ahead: 1,
                    rows: 200,
                },
                "1 of 200 rows jumps ahead in time and is left out",
            ),
            (
                TableNote::Ahead {
                    ahead: 2,
                    rows: 200,
                },
                "2 of 200 rows jump ahead in time and are left out",
            ),
            (
                TableNote::NoDegrees { beyond: 1, rows: 1 },
                "left out, as they have no valid latitude and longitude: 1 of 1 row",
            ),
        ] {
            assert_eq!(note.to_string(), text);
        }
    }
}
