use super::BitLayout;
use serde::{Deserialize, Serialize};

/// The identifier of a frame on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "id must be a number for 11 bits, or { extended = … } for 29"
)]
pub enum CanId {
    /// A standard identifier, 11 bits.
    Standard(u16),
    /// An extended identifier, 29 bits.
    Extended {
        /// The identifier, without the flag for its kind.
        extended: u32,
    },
}

/// A frame from the bus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CanFrame<'a> {
    /// Time when it was received, in seconds.
    pub time_s: f64,
    /// Its identifier.
    pub id: CanId,
    /// Its data: up to 8 bytes, up to 64 for CAN FD.
    pub data: &'a [u8],
}

/// The condition under which a multiplexed signal is present: another number of the frame selects it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MultiplexCondition {
    /// Position of the multiplexor (the number that selects).
    pub switch: BitLayout,
    /// The multiplexor's raw values for which the signal is present, first and last of each range.
    pub ranges: Vec<(u64, u64)>,
}

/// One signal of one frame, as in an `SG_` line of a DBC file or in a configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CanSignal {
    /// The frame's identifier.
    pub id: CanId,
    /// The number's position, type, scale and offset.
    pub layout: BitLayout,
    /// Conditions that must all hold for the signal to be present.
    #[serde(default)]
    pub multiplexed: Vec<MultiplexCondition>,
    /// The smallest and the largest physical value of the signal, if its description gives them.
    #[serde(default)]
    pub range: Option<[f64; 2]>,
}

/// The largest number of distinct values that can mean "not available" or "error".
const MOST_SENTINELS: usize = 3;

impl CanSignal {
    /// The physical value in the data of a frame with this signal's identifier; `None` if the frame
    /// does not carry it, or is too short.
    #[must_use]
    pub fn decode(&self, data: &[u8]) -> Option<f64> {
        let selected = |condition: &MultiplexCondition| {
            let raw = condition.switch.raw(data);
            raw.is_some_and(|raw| {
                condition
                    .ranges
                    .iter()
                    .any(|(a, b)| (*a..=*b).contains(&raw))
            })
        };
        let there = self.multiplexed.iter().all(selected);
        there.then(|| self.layout.decode(data)).flatten()
    }

    /// Removes values outside the [range](Self::range), which mean "not available" or "error" (J1939: all bits set, or all but the last),
    /// and returns their number. If there are more than a few distinct ones, or if they are most of the values, the range itself is wrong,
    /// as in many descriptions, and all values are kept.
    pub fn keep_measured<T>(&self, values: &mut Vec<T>, value: impl Fn(&T) -> f64) -> usize {
        let Some([least, most]) = self.range.filter(|[least, most]| least < most) else {
            return 0;
        };
        // The description's limits may be rounded in the last digit.
        let slack = 1e-6 * (most - least);
        let known = least - slack..=most + slack;
        let beyond = values
            .iter()
            .filter(|v| !known.contains(&value(*v)))
            .count();
        let mut different: Vec<f64> = Vec::new();
        for value in values.iter().map(&value).filter(|v| !known.contains(v)) {
            if !different.contains(&value) {
                different.push(value);
            }
            if different.len() > MOST_SENTINELS {
                return 0;
            }
        }
        if 2 * beyond >= values.len() {
            return 0;
        }
        values.retain(|v| known.contains(&value(v)));
        beyond
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Signal;

    /// A configuration without a DBC file.
    const CONFIG: &str = r#"
        id = 0x158
        layout = { start_bit = 7, length = 16, byte_order = "motorola", scale = 0.0027777778 }
    "#;

    /// The signal over a recording, in its physical unit.
    fn over_time<'a>(signal: &CanSignal, frames: impl IntoIterator<Item = CanFrame<'a>>) -> Signal {
        let own = frames.into_iter().filter(|frame| frame.id == signal.id);
        let mut values: Vec<(f64, f64)> = own
            .filter_map(|frame| Some((frame.time_s, signal.decode(frame.data)?)))
            .collect();
        signal.keep_measured(&mut values, |(_, value)| *value);
        Signal::new(values)
    }

    #[test]
    fn a_signal_from_a_configuration_over_time() {
        let speed: CanSignal = toml::from_str(CONFIG).unwrap();
        let frame = |time_s, id, data| CanFrame { time_s, id, data };
        let own = CanId::Standard(0x158);
        let frames = [
            frame(0.0, own, &[0x0e, 0x10, 0][..]),
            frame(0.005, CanId::Standard(0x159), &[0xff, 0xff, 0]),
            frame(0.006, CanId::Extended { extended: 0x158 }, &[0xff, 0xff, 0]),
            frame(0.01, own, &[0x1c, 0x20, 0]),
            frame(0.015, own, &[0x1c]),
        ];
        let signal = over_time(&speed, frames);
        assert_eq!(signal.times_s(), [0.0, 0.01]);
        assert!((signal.values()[0] - 10.0).abs() < 1e-6, "{signal:?}");
        assert!((signal.values()[1] - 20.0).abs() < 1e-6);
    }

    #[test]
    fn values_for_not_available_are_dropped() {
        let mut speed: CanSignal = toml::from_str(CONFIG).unwrap();
        let (own, later) = (CanId::Standard(0x158), [0x0e, 0x10, 0]);
        let frame = |step: u8, data| CanFrame {
            time_s: 0.01 * f64::from(step),
            id: own,
            data,
        };
        let none = [0xff, 0xff, 0];
        let frames: Vec<CanFrame<'_>> = (0..5)
            .map(|step| frame(step, if step == 0 { &none[..] } else { &later[..] }))
            .collect();
        let count = |speed: &CanSignal| over_time(speed, frames.clone()).values().len();
        assert_eq!(count(&speed), 5, "the range is unknown");
        speed.range = Some([0.0, 70.0]);
        assert_eq!(count(&speed), 4);
        // If most of a car's speeds are outside the range, the range is wrong.
        speed.range = Some([0.0, 1.0]);
        assert_eq!(count(&speed), 5);
        // So is a range that only fits a standing car.
        let drives: Vec<[u8; 3]> = (0..20_u8).map(|i| [i.saturating_sub(12), 0, 0]).collect();
        let frames = (0..)
            .zip(&drives)
            .map(|(step, data)| frame(step, &data[..]));
        assert_eq!(over_time(&speed, frames).values().len(), 20);
    }

    #[test]
    fn a_configuration_survives_its_file() {
        let mut signal: CanSignal = toml::from_str(CONFIG).unwrap();
        signal.id = CanId::Extended {
            extended: 0x18fe_f100,
        };
        let switch = signal.layout;
        signal.multiplexed = vec![MultiplexCondition {
            switch,
            ranges: vec![(0, 2)],
        }];
        let text = toml::to_string(&signal).unwrap();
        assert_eq!(toml::from_str::<CanSignal>(&text).unwrap(), signal);
    }
}
