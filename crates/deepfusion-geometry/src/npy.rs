//! The first bytes of a NumPy array file: what it says of its numbers, before anything is allocated for them.

/// What the header of an `.npy` file says ([NEP 1](https://numpy.org/neps/nep-0001-npy-format.html), formats 1 to 3).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NpyHeader {
    /// NumPy's name for the type of the numbers, such as `<f4`; `None` where there is none, or a structure.
    pub descr: Option<String>,
    /// Whether the array is stored column by column; `None` where that is not said.
    pub fortran_order: Option<bool>,
    /// The length of each axis.
    pub shape: Vec<u64>,
    /// Where the numbers begin, in bytes from the file's beginning.
    pub begin: usize,
}

/// Why the beginning of a file is not an array's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NpyHeaderProblem {
    /// It begins as another kind of file.
    #[error("not a NumPy array")]
    NotNpy,
    /// It ends before its header does.
    #[error("ends within its header")]
    Cut,
}

impl NpyHeader {
    /// The mark at the beginning of each file.
    pub const MAGIC: &[u8] = b"\x93NUMPY";

    /// Reads the header from a file's first bytes, all of them or more than the header takes.
    ///
    /// # Errors
    /// [`NpyHeaderProblem`].
    pub fn parse(bytes: &[u8]) -> Result<Self, NpyHeaderProblem> {
        let cut = || NpyHeaderProblem::Cut;
        if !bytes.starts_with(Self::MAGIC) {
            return Err(if Self::MAGIC.starts_with(bytes) {
                cut()
            } else {
                NpyHeaderProblem::NotNpy
            });
        }
        let two = |at: usize| {
            let bytes = bytes.get(at..at + 2).ok_or_else(cut)?;
            Ok(usize::from(bytes[0]) | usize::from(bytes[1]) << 8)
        };
        let (at, length) = match bytes.get(6).ok_or_else(cut)? {
            1 => (10, two(8)?),
            _ => (12, two(8)? | two(10)? << 16),
        };
        let text = bytes.get(at..at + length).ok_or_else(cut)?;
        let text = String::from_utf8_lossy(text);
        let descr = field(&text, "descr").filter(|d| d.starts_with(['\'', '"']));
        let fortran_order = match field(&text, "fortran_order") {
            Some("True") => Some(true),
            Some("False") => Some(false),
            _ => None,
        };
        let after = text.split_once("'shape':").map(|(_, rest)| rest);
        let inside = after.and_then(|rest| rest.split_once('(')?.1.split_once(')'));
        let sides = inside.map_or("", |(sides, _)| sides).split(',');
        Ok(Self {
            descr: descr.map(|d| d.trim_matches(['\'', '"']).to_owned()),
            fortran_order,
            shape: sides.filter_map(|side| side.trim().parse().ok()).collect(),
            begin: at + length,
        })
    }

    /// Bytes of a number; `None` for text, objects and structures.
    #[must_use]
    pub fn item_bytes(&self) -> Option<u64> {
        let kind = self
            .descr
            .as_ref()?
            .trim_start_matches(['<', '>', '|', '=']);
        let number = kind.starts_with(['b', 'i', 'u', 'f', 'c']);
        number.then(|| kind.get(1..)?.parse().ok())?
    }

    /// How long the whole file must be at least; `None` where the numbers' size is not known, or no file is as long.
    #[must_use]
    pub fn file_bytes(&self) -> Option<u64> {
        let mut sides = self.shape.iter();
        let items = sides.try_fold(1_u64, |product, side| product.checked_mul(*side))?;
        items
            .checked_mul(self.item_bytes()?)?
            .checked_add(self.begin as u64)
    }

    /// Whether a file of `length` bytes holds all numbers that it says it has. A reader that allocates for them before it reads
    /// them, as most do, must ask this first.
    #[must_use]
    pub fn fits(&self, length: u64) -> bool {
        self.file_bytes().is_some_and(|bytes| bytes <= length)
    }
}

/// The value of a key that is neither a tuple nor a structure.
fn field<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let after = header.split_once(&format!("'{key}':"))?.1;
    after.split([',', '}']).next().map(str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of format 1 with this header and `numbers` bytes behind it.
    fn file(header: &str, numbers: usize) -> Vec<u8> {
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.as_bytes());
        file.extend(vec![0; numbers]);
        file
    }

    #[test]
    fn a_header_says_type_order_and_shape() {
        let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 5), }\n";
        let file = file(text, 60);
        let header = NpyHeader::parse(&file).unwrap();
        let expected = NpyHeader {
            descr: Some("<f4".into()),
            fortran_order: Some(false),
            shape: vec![3, 5],
            begin: 10 + text.len(),
        };
        assert_eq!(header, expected);
        assert_eq!(header.item_bytes(), Some(4));
        assert!(header.fits(file.len() as u64) && !header.fits(file.len() as u64 - 1));
        for cut in 0..header.begin {
            assert_eq!(NpyHeader::parse(&file[..cut]), Err(NpyHeaderProblem::Cut));
        }
        assert_eq!(
            NpyHeader::parse(b"PK\x03\x04"),
            Err(NpyHeaderProblem::NotNpy)
        );
    }

    /// Lengths whose product is more than memory, or than a number holds; text, whose width is not a number's.
    #[test]
    fn what_no_file_holds_does_not_fit() {
        for (descr, shape) in [
            ("'<f8'", "1099511627776,"),
            ("'<f8'", "4294967296, 4294967296"),
            ("'<U8'", "2,"),
            ("[('a', '<f8')]", "2,"),
        ] {
            let text =
                format!("{{'descr': {descr}, 'fortran_order': False, 'shape': ({shape}), }}\n");
            let header = NpyHeader::parse(&file(&text, 64)).unwrap();
            assert!(!header.fits(1 << 40), "{text}");
        }
        let scalar = "{'descr': '<f8', 'fortran_order': True, 'shape': (), }\n";
        let header = NpyHeader::parse(&file(scalar, 8)).unwrap();
        assert_eq!((header.fortran_order, header.shape.len()), (Some(true), 0));
        assert!(header.fits((header.begin + 8) as u64));
    }
}
