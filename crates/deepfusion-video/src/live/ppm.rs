//! Pictures as ffmpeg pipes them: each begins with its size, so that nothing has to be known beforehand.

use crate::LiveFrameProblem;
use image::RgbImage;
use std::io::{BufRead, ErrorKind};

/// Largest side of a frame: no camera has more, so the data cannot be a picture.
const LARGEST: u32 = 1 << 15;

/// Reads the next binary PPM of 8 bits; `None` at the end of the pipe, also within a picture. `spare` is a buffer to
/// fill.
///
/// # Errors
/// If the data is not a picture, or reading fails.
pub(super) fn read(
    input: &mut impl BufRead,
    spare: Vec<u8>,
) -> Result<Option<RgbImage>, LiveFrameProblem> {
    let Some(magic) = word(input)? else {
        return Ok(None);
    };
    if magic != "P6" {
        return Err(LiveFrameProblem::Magic);
    }
    let mut numbers = [0_u32; 3];
    for number in &mut numbers {
        let Some(word) = word(input)? else {
            return Ok(None);
        };
        *number = word
            .parse()
            .ok()
            .filter(|n| (1..=LARGEST).contains(n))
            .ok_or(LiveFrameProblem::Size(word))?;
    }
    let [width, height, _] = numbers;
    let mut pixels = spare;
    pixels.resize(width as usize * height as usize * 3, 0);
    match input.read_exact(&mut pixels) {
        Ok(()) => Ok(RgbImage::from_raw(width, height, pixels)),
        Err(e) if e.kind() == ErrorKind::UnexpectedEof => Ok(None),
        Err(e) => Err(e.into()),
    }
}

/// The next word, with the one blank that ends it; `None` at the end.
fn word(input: &mut impl BufRead) -> Result<Option<String>, LiveFrameProblem> {
    /// Longest word of a header.
    const LONGEST: usize = 8;
    let mut word = String::new();
    let mut byte = [0];
    loop {
        match input.read_exact(&mut byte) {
            Err(e) if e.kind() == ErrorKind::UnexpectedEof => return Ok(None),
            other => other?,
        }
        if byte[0].is_ascii_whitespace() {
            return Ok(Some(word));
        }
        word.push(char::from(byte[0]));
        if word.len() > LONGEST {
            return Err(LiveFrameProblem::Header);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn consecutive_pictures_are_read() {
        let stream = b"P6\n2 1\n255\nabcdefP6\n1 1\n255\n\nxyP6\n1 1\n255\nq";
        let mut input = &stream[..];
        let first = read(&mut input, vec![9; 100]).unwrap().unwrap();
        assert_eq!(
            (first.dimensions(), first.as_raw().as_slice()),
            ((2, 1), &b"abcdef"[..])
        );
        // A pixel may have the value of a blank.
        let second = read(&mut input, Vec::new()).unwrap().unwrap();
        assert_eq!(second.as_raw().as_slice(), b"\nxy");
        assert!(
            read(&mut input, Vec::new()).unwrap().is_none(),
            "cut off within"
        );
        assert!(
            read(&mut input, Vec::new()).unwrap().is_none(),
            "at the end"
        );
    }

    #[test]
    fn invalid_pictures_are_errors() {
        for bad in [
            "JFIF\n1 1\n255\nabc",
            "P6\n0 1\n255\n",
            "P6\n99999 1\n255\n",
            "P6\n123456789123 1\n",
        ] {
            assert!(read(&mut bad.as_bytes(), Vec::new()).is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..64), sizes in (1u32..99, 1u32..99)) {
            let _ = read(&mut &bytes[..], Vec::new());
            let (w, h) = sizes;
            let mut stream = format!("P6\n{w} {h}\n255\n").into_bytes();
            stream.extend(&bytes);
            let whole = bytes.len() >= (w * h * 3) as usize;
            prop_assert_eq!(read(&mut &stream[..], Vec::new()).unwrap().is_some(), whole);
        }
    }
}
