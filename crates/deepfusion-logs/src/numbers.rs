//! Numbers as apps write them: with a point or a comma, and words for "not measured".

/// The value of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Cell {
    /// Nothing was measured.
    Absent,
    Number(f64),
    /// Something else.
    Other,
}

/// Reads a cell. `decimal_comma` means that values are not separated by commas, so that the comma in "12,5" is a decimal point.
pub(crate) fn cell(word: &str, decimal_comma: bool) -> Cell {
    let word = word.trim().trim_matches('"').trim();
    let lower = word.to_ascii_lowercase();
    if matches!(
        lower.as_str(),
        "" | "-" | "--" | "—" | "null" | "none" | "nan" | "n/a" | "na" | "no data" | "nodata" | "∞"
    ) {
        return Cell::Absent;
    }
    let text = if decimal_comma && word.contains(',') {
        // 1.234,5: points separate the thousands.
        word.replace('.', "").replacen(',', ".", 1)
    } else {
        word.to_owned()
    };
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Cell::Number(value),
        _ => Cell::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimal_points_commas_and_missing_values() {
        assert_eq!(cell(" 12.5 ", false), Cell::Number(12.5));
        assert_eq!(cell("\"12,5\"", true), Cell::Number(12.5));
        assert_eq!(cell("1.234,5", true), Cell::Number(1234.5));
        assert_eq!(cell("1.234", true), Cell::Number(1.234));
        assert_eq!(cell("-0,5", true), Cell::Number(-0.5));
        for absent in ["", "-", "NaN", "null", "NO DATA"] {
            assert_eq!(cell(absent, true), Cell::Absent, "{absent}");
        }
        for other in ["12,5", "fast", "1,2,3", "inf", "0x10"] {
            assert_eq!(cell(other, false), Cell::Other, "{other}");
        }
        assert_eq!(cell("1,2,3", true), Cell::Other);
    }
}
