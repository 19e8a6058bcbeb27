//! A JPEG's size without reading all of it, and whether it is complete: decoders silently fill the missing part of a
//! truncated file with grey, and a network would train on it.

use std::io::{Read, Result, Seek, SeekFrom};

const EOI: u8 = 0xD9;
const SOS: u8 = 0xDA;

/// Whether `bytes` begin as a JPEG does.
pub(crate) fn is_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xFF, 0xD8])
}

/// Width and height from the frame header (ITU-T T.81, B.2.2), skipping the segments before it. The image
/// decoder would read the whole file; this checks a data set of forty thousand images in seconds.
pub(crate) fn size(input: &mut (impl Read + Seek)) -> Result<Option<(u32, u32)>> {
    let mut two = [0; 2];
    input.seek(SeekFrom::Start(2))?;
    loop {
        input.read_exact(&mut two)?;
        while two == [0xFF, 0xFF] {
            input.read_exact(&mut two[1..])?;
        }
        let [0xFF, code] = two else { return Ok(None) };
        if code == 0x01 || (0xD0..=0xD7).contains(&code) {
            continue;
        }
        input.read_exact(&mut two)?;
        let length = u16::from_be_bytes(two);
        // The frame headers are 0xC0 to 0xCF, except DHT, JPG and DAC.
        if (0xC0..=0xCF).contains(&code) && ![0xC4, 0xC8, 0xCC].contains(&code) {
            let mut frame = [0; 5];
            input.read_exact(&mut frame)?;
            let [_, h1, h0, w1, w0] = frame;
            let (width, height) = ([w1, w0], [h1, h0]);
            let size = (u16::from_be_bytes(width), u16::from_be_bytes(height));
            return Ok(Some((size.0.into(), size.1.into())));
        }
        if code == SOS || code == EOI || length < 2 {
            return Ok(None);
        }
        input.seek(SeekFrom::Current(i64::from(length) - 2))?;
    }
}

/// Whether a JPEG has its end-of-image marker, found by walking its segments (ITU-T T.81, B.1). An embedded
/// thumbnail has such a marker too, so searching for the two bytes is not enough.
pub(crate) fn has_end(bytes: &[u8]) -> bool {
    let mut i = 2;
    loop {
        // The next marker: 0xFF (repeated as padding), then a code.
        while bytes.get(i) == Some(&0xFF) && bytes.get(i + 1) == Some(&0xFF) {
            i += 1;
        }
        let (Some(0xFF), Some(&code)) = (bytes.get(i), bytes.get(i + 1)) else {
            return false;
        };
        i += 2;
        match code {
            EOI => return true,
            // Without a length: TEM and the restart markers.
            0x01 | 0xD0..=0xD7 => continue,
            _ => {}
        }
        let (Some(&high), Some(&low)) = (bytes.get(i), bytes.get(i + 1)) else {
            return false;
        };
        i += usize::from(high) << 8 | usize::from(low);
        if code == SOS {
            // Coded data up to the next marker: in it, 0xFF is followed by 0 or a restart marker.
            loop {
                let Some(at) = memchr::memchr(0xFF, bytes.get(i..).unwrap_or_default()) else {
                    return false;
                };
                i += at;
                match bytes.get(i + 1) {
                    Some(0 | 0xD0..=0xD7) => i += 2,
                    _ => break,
                }
            }
        }
    }
}
