use std::cmp::Ordering;
use std::fmt;

const NANOS: u64 = 1_000_000_000;

/// A ROS 1 time stamp: seconds and nanoseconds since the Unix epoch (or since the start of a simulation), as
/// stored in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Time {
    /// Whole seconds.
    pub sec: u32,
    /// Additional nanoseconds; below 10⁹ in valid files, but nothing enforces it.
    pub nsec: u32,
}

impl Time {
    /// The earliest time.
    pub const ZERO: Self = Self { sec: 0, nsec: 0 };

    /// The time `nanos` nanoseconds after the epoch; the year 2106 and later become the last second before it.
    #[must_use]
    pub fn from_nanos(nanos: u64) -> Self {
        match u32::try_from(nanos / NANOS) {
            Ok(sec) => Self {
                sec,
                nsec: (nanos % NANOS) as u32,
            },
            Err(_) => Self {
                sec: u32::MAX,
                nsec: 999_999_999,
            },
        }
    }

    /// The time nearest to `seconds` after the epoch; for times before the epoch, and NaN, it is [`Time::ZERO`].
    #[must_use]
    pub fn from_seconds(seconds: f64) -> Self {
        // `as` saturates: neither infinity nor NaN panics.
        let whole = seconds.floor() as u32;
        let nanos = ((seconds - f64::from(whole)) * NANOS as f64).round() as u64;
        Self::from_nanos(u64::from(whole) * NANOS + nanos)
    }

    /// Nanoseconds since the epoch.
    #[must_use]
    pub fn nanos(self) -> u64 {
        u64::from(self.sec) * NANOS + u64::from(self.nsec)
    }

    /// Seconds since the epoch. An f64 of today's epoch resolves 0.24 µs: subtract [`Time::nanos`] for intervals.
    #[must_use]
    pub fn seconds(self) -> f64 {
        f64::from(self.sec) + f64::from(self.nsec) * 1e-9
    }

    /// Seconds from `earlier` to this time; negative if `earlier` is later.
    #[must_use]
    pub fn seconds_since(self, earlier: Self) -> f64 {
        (i128::from(self.nanos()) - i128::from(earlier.nanos())) as f64 / NANOS as f64
    }
}

impl Ord for Time {
    fn cmp(&self, other: &Self) -> Ordering {
        // Equal only if both numbers are, consistent with `Eq`, even with nanoseconds beyond 10⁹.
        (self.nanos(), self.sec).cmp(&(other.nanos(), other.sec))
    }
}

impl PartialOrd for Time {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:09}", self.sec, self.nsec)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nanoseconds_round_trip() {
        let time = Time {
            sec: 1_604_515_190,
            nsec: 231_374_463,
        };
        assert_eq!(time.nanos(), 1_604_515_190_231_374_463);
        assert_eq!(Time::from_nanos(time.nanos()), time);
        assert_eq!(time.to_string(), "1604515190.231374463");
        assert_eq!(Time::from_nanos(u64::MAX).sec, u32::MAX);
    }

    #[test]
    fn seconds_round_and_saturate() {
        assert_eq!(
            Time::from_seconds(1.5),
            Time {
                sec: 1,
                nsec: 500_000_000
            }
        );
        assert_eq!(
            Time::from_seconds(2.999_999_999_9),
            Time { sec: 3, nsec: 0 }
        );
        assert_eq!(Time::from_seconds(f64::NAN), Time::ZERO);
        assert_eq!(Time::from_seconds(-1.0), Time::ZERO);
        assert_eq!(
            Time { sec: 3, nsec: 1 }.seconds_since(Time { sec: 4, nsec: 1 }),
            -1.0
        );
    }

    #[test]
    fn nanoseconds_beyond_a_second_are_ordered_by_the_time_they_mean() {
        let (odd, even) = (
            Time {
                sec: 1,
                nsec: 2_000_000_000,
            },
            Time { sec: 3, nsec: 0 },
        );
        assert!(
            odd < even
                && odd
                    > Time {
                        sec: 2,
                        nsec: 999_999_999
                    }
        );
    }
}
