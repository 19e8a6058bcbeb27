//! The units of a packet of H.264 or H.265 in Annex B.

/// A packet's units without their start codes; none is empty.
pub(super) fn units(packet: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = after_start_code(packet);
    std::iter::from_fn(move || {
        let unit = rest?;
        rest = after_start_code(unit);
        let length = rest.map_or(unit.len(), |next| unit.len() - next.len() - 3);
        Some(&unit[..length])
    })
    .filter(|unit| !unit.is_empty())
}

/// The bytes after the first start code, 0 0 1.
fn after_start_code(bytes: &[u8]) -> Option<&[u8]> {
    let at = bytes.windows(3).position(|w| w == [0, 0, 1])?;
    Some(&bytes[at + 3..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_lie_between_start_codes() {
        let packet = [0, 0, 0, 1, 7, 8, 0, 0, 1, 0, 0, 1, 5, 0, 1];
        let found: Vec<&[u8]> = units(&packet).collect();
        assert_eq!(found, [&[7_u8, 8][..], &[5, 0, 1]]);
        assert_eq!(units(&[1, 2, 3]).count(), 0);
        assert_eq!(units(&[0, 0, 1]).count(), 0);
    }
}
