//! The parts of H.264 that show a missing packet or reordered pictures: the counter of its frames and the type of its slices
//! (ITU-T H.264, 7.3.2.1 and 7.3.3). ffmpeg conceals the first and allows the second.

use super::nal::units;
use crate::PacketProblem;

/// Checks a stream's packets in their order.
#[derive(Debug, Default)]
pub(super) struct PacketWatch {
    set: Option<ParameterSet>,
    /// The counter of the last picture that others refer to.
    last: Option<u32>,
}

/// Values of a sequence parameter set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ParameterSet {
    /// Number of bits of the counter.
    bits: u32,
    /// Whether gaps are intended: the encoder leaves pictures out.
    gaps: bool,
    /// Whether there are three colour planes, each coded separately.
    planes: bool,
}

impl PacketWatch {
    /// Checks the next packet; returns what is wrong with it, if anything is.
    pub(super) fn next(&mut self, packet: &[u8]) -> Result<(), PacketProblem> {
        for unit in units(packet) {
            let (kind, referred) = (unit[0] & 31, unit[0] & 0b0110_0000 != 0);
            match kind {
                7 => self.set = parameters(unit),
                1 | 5 => {
                    let Some(set) = self.set else { return Ok(()) };
                    let Some((slice, count)) = slice(unit, set) else {
                        return Err(PacketProblem::Cut);
                    };
                    // B, in which a picture refers to later ones.
                    if slice % 5 == 1 {
                        return Err(PacketProblem::Reordered);
                    }
                    let follows = self
                        .last
                        .is_none_or(|last| count == last || count == (last + 1) % (1 << set.bits));
                    let in_order = kind == 5 || set.gaps || follows;
                    if referred || kind == 5 {
                        self.last = Some(count);
                    }
                    return if in_order {
                        Ok(())
                    } else {
                        Err(PacketProblem::Gap)
                    };
                }
                _ => {}
            }
        }
        Err(PacketProblem::Empty)
    }
}

/// Type and `frame_num` of a slice.
fn slice(unit: &[u8], set: ParameterSet) -> Option<(u32, u32)> {
    // A dozen bytes are enough.
    let mut bits = Bits::of(unit.get(1..)?, 32);
    let _first_macroblock = bits.exp_golomb()?;
    let kind = bits.exp_golomb()?;
    let _picture_set = bits.exp_golomb()?;
    if set.planes {
        bits.take(2)?;
    }
    Some((kind, bits.take(set.bits)?))
}

/// Reads a sequence parameter set, up to the last value that matters.
fn parameters(unit: &[u8]) -> Option<ParameterSet> {
    let mut bits = Bits::of(unit.get(1..)?, usize::MAX);
    let profile = bits.take(8)?;
    bits.take(16)?;
    let _id = bits.exp_golomb()?;
    let mut planes = false;
    // Profiles with chroma formats.
    if [100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135].contains(&profile) {
        let colours = bits.exp_golomb()?;
        if colours == 3 {
            planes = bits.take(1)? == 1;
        }
        let _luma = bits.exp_golomb()?;
        let _chroma = bits.exp_golomb()?;
        bits.take(1)?;
        if bits.take(1)? == 1 {
            for list in 0..if colours == 3 { 12 } else { 8 } {
                if bits.take(1)? == 1 {
                    skip_scaling(&mut bits, if list < 6 { 16 } else { 64 })?;
                }
            }
        }
    }
    let counter = bits.exp_golomb()?.checked_add(4).filter(|n| *n <= 16)?;
    match bits.exp_golomb()? {
        0 => {
            bits.exp_golomb()?;
        }
        1 => {
            bits.take(1)?;
            bits.exp_golomb()?;
            bits.exp_golomb()?;
            for _ in 0..bits.exp_golomb()?.min(255) {
                bits.exp_golomb()?;
            }
        }
        _ => {}
    }
    let _references = bits.exp_golomb()?;
    Some(ParameterSet {
        bits: counter,
        gaps: bits.take(1)? == 1,
        planes,
    })
}

/// Skips a scaling list (7.3.2.1.1.1).
fn skip_scaling(bits: &mut Bits, size: u32) -> Option<()> {
    let (mut last, mut next) = (8_i64, 8_i64);
    for _ in 0..size {
        if next != 0 {
            let code = i64::from(bits.exp_golomb()?);
            let delta = if code % 2 == 1 {
                (code + 1) / 2
            } else {
                -code / 2
            };
            next = (last + delta).rem_euclid(256);
        }
        if next != 0 {
            last = next;
        }
    }
    Some(())
}

/// The bits of a unit, without those that keep start codes out of it.
struct Bits {
    bytes: Vec<u8>,
    at: usize,
}

impl Bits {
    fn of(unit: &[u8], most: usize) -> Self {
        let mut bytes = Vec::new();
        let mut zeros = 0;
        for &byte in unit.iter().take(most) {
            if zeros >= 2 && byte == 3 {
                zeros = 0;
                continue;
            }
            zeros = if byte == 0 { zeros + 1 } else { 0 };
            bytes.push(byte);
        }
        Self { bytes, at: 0 }
    }

    /// Up to 32 bits as a number.
    fn take(&mut self, count: u32) -> Option<u32> {
        let mut value = 0;
        for _ in 0..count {
            let byte = self.bytes.get(self.at / 8)?;
            value = (value << 1) | u32::from(byte >> (7 - self.at % 8) & 1);
            self.at += 1;
        }
        Some(value)
    }

    /// An unsigned Exp-Golomb number, 9.1.
    fn exp_golomb(&mut self) -> Option<u32> {
        let mut zeros = 0;
        while self.take(1)? == 0 {
            zeros += 1;
            if zeros > 31 {
                return None;
            }
        }
        Some((1_u32 << zeros) - 1 + self.take(zeros)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_without_a_picture_are_empty() {
        let mut watch = PacketWatch::default();
        for packet in [
            &[][..],
            &[1; 9],
            &[0, 0, 1, 0x67],
            &[0, 0, 1, 0x67, 100, 0, 0, 0],
        ] {
            let error = watch.next(packet).unwrap_err();
            assert_eq!(error, PacketProblem::Empty, "{packet:?}");
            assert_eq!(error.to_string(), "it contains no picture");
        }
        assert!(watch.set.is_none());
        // A slice without parameters cannot be checked.
        assert_eq!(watch.next(&[0, 0, 1, 0x41, 0]), Ok(()));
    }

    #[test]
    fn exp_golomb_numbers_have_variable_length() {
        // 1, 010, 011, 00100, 00101: 0 to 4; then 3 bits.
        let mut bits = Bits::of(&[0b1010_0110, 0b0100_0010, 0b1101_0000], 9);
        let found: Vec<u32> = (0..5).map(|_| bits.exp_golomb().unwrap()).collect();
        assert_eq!(found, [0, 1, 2, 3, 4]);
        assert_eq!(bits.take(3), Some(0b101));
        // 0 0 3 is 0 0.
        assert_eq!(Bits::of(&[0, 0, 3, 7], 9).take(24), Some(7));
        assert_eq!(Bits::of(&[0; 9], 9).exp_golomb(), None);
    }

    /// A set written by hand from 7.3.2.1.1: Baseline, id 0, a counter of 4 bits, order type 2, one reference, no gaps.
    fn baseline(gaps: u8) -> Vec<u8> {
        // ue(0) ue(0) ue(2) ue(1) gaps, and the end mark: 1 1 011 010 g 1.
        vec![0, 0, 1, 0x67, 66, 0, 30, 0b1101_1010, gaps << 7 | 0x40]
    }

    /// A slice: first macroblock 0, a type, set 0, a counter of 4 bits; the types P (0) and B (1) have the codes 1 and 010.
    fn picture(kind: u8, header: u8, count: u8) -> Vec<u8> {
        let (bits, length) = if kind == 0 { (0b111, 3) } else { (0b1_0101, 5) };
        let word: u16 = (bits << 4 | u16::from(count)) << (16 - length - 4);
        [&[0, 0, 1, header][..], &word.to_be_bytes(), &[0x80]].concat()
    }

    #[test]
    fn a_jump_of_the_counter_is_a_gap() {
        let first = |gaps| {
            let mut watch = PacketWatch::default();
            let packet = [baseline(gaps), picture(0, 0x65, 0)].concat();
            assert_eq!(watch.next(&packet), Ok(()));
            watch
        };
        let mut watch = first(0);
        assert_eq!(
            watch.set,
            Some(ParameterSet {
                bits: 4,
                gaps: false,
                planes: false
            })
        );
        for count in (1..=15).chain(0..4) {
            assert_eq!(watch.next(&picture(0, 0x41, count)), Ok(()), "{count}");
        }
        // One that no picture refers to, then the next with the same counter.
        assert_eq!(watch.next(&picture(0, 0x01, 4)), Ok(()));
        assert_eq!(watch.next(&picture(0, 0x41, 4)), Ok(()));
        let error = watch.next(&picture(0, 0x41, 6)).unwrap_err();
        assert_eq!(error, PacketProblem::Gap);
        assert!(error.to_string().contains("missing"), "{error}");
        // If the encoder leaves some out intentionally, none is missing.
        assert_eq!(first(1).next(&picture(0, 0x41, 6)), Ok(()));
        let error = first(0).next(&picture(1, 0x01, 1)).unwrap_err();
        assert_eq!(error, PacketProblem::Reordered);
        assert!(error.to_string().contains("B-frame"), "{error}");
    }
}
