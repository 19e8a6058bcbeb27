//! Durations as text for people.

/// Seconds as minutes and seconds, or hours and minutes: `1:15 min`, `2 h 02 min`.
#[must_use]
pub fn duration_text(seconds: f64) -> String {
    if !seconds.is_finite() {
        return "?".into();
    }
    let s = seconds.max(0.0).round() as u64;
    if s >= 3600 {
        format!("{} h {:02} min", s / 3600, s / 60 % 60)
    } else {
        format!("{}:{:02} min", s / 60, s % 60)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_readable_units() {
        assert_eq!(duration_text(75.4), "1:15 min");
        assert_eq!(duration_text(7_320.0), "2 h 02 min");
        assert_eq!(duration_text(f64::NAN), "?");
    }
}
