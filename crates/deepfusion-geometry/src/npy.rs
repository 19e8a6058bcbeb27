//! Reads the header of a NumPy array file, so that it can be checked before memory is allocated for the numbers.

/// The header of an `.npy` file ([NEP 1](https://numpy.org/neps/nep-0001-npy-format.html), formats 1 to 3).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NpyHeader {
    /// NumPy's name for the type of the numbers, such as `<f4`; `None` if missing, or for a structure.
    pub descr: Option<String>,
    /// Whether the array is stored column by column; `None` if missing.
    pub fortran_order: Option<bool>,
    /// The length of each axis.
    pub shape: Vec<u64>,
    /// Offset of the numbers, in bytes from the start of the file.
    pub begin: usize,
}

/// Why a file does not begin like an array file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NpyHeaderProblem {
    /// The file is of another kind.
    #[error("not a NumPy array")]
    NotNpy,
    /// The file ends before its header does.
    #[error("ends within its header")]
    Cut,
}

impl NpyHeader {
    /// The first bytes of every `.npy` file.
    pub const MAGIC: &[u8] = b"\x93NUMPY";

    /// Reads the header from the first bytes of a file; `bytes` may be longer than the header.
    ///
    /// # Errors
    /// [`NpyHeaderProblem`], with the reason.
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

    /// Size of a number in bytes; `None` for text, objects and structures.
    #[must_use]
    pub fn item_bytes(&self) -> Option<u64> {
        let kind = self
            .descr
            .as_ref()?
            .trim_start_matches(['<', '>', '|', '=']);
        let number = kind.starts_with(['b', 'i', 'u', 'f', 'c']);
        number.then(|| kind.get(1..)?.parse().ok())?
    }

    /// Smallest length of the whole file, in bytes; `None` if the numbers' size is not known, or no file is that long.
    #[must_use]
    pub fn file_bytes(&self) -> Option<u64> {
        let mut sides = self.shape.iter();
        let items = sides.try_fold(1_u64, |product, side| product.checked_mul(*side))?;
        items
            .checked_mul(self.item_bytes()?)?
            .checked_add(self.begin as u64)
    }

    /// Whether a file of `length` bytes can contain all its numbers. Readers that allocate memory before they read, as most do, must check
    /// this first.
    #[must_use]
    pub fn fits(&self, length: u64) -> bool {
        self.file_bytes().is_some_and(|bytes| bytes <= length)
    }
}

/// The value of a key, if it is neither a tuple nor a structure.
fn field<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let after = header.split_once(&format!("'{key}':"))?.1;
    after.split([',', '}']).next().map(str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of format 1 with this header, followed by `numbers` bytes.
    fn file(header: &str, numbers: usize) -> Vec<u8> {
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.as_bytes());
        file.extend(vec![0; numbers]);
        file
    }

    #[test]
    fn a_header_gives_type_order_and_shape() {
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

    /// Shapes whose product exceeds memory or an integer; and text, whose width is not a number's.
    #[test]
    fn impossible_sizes_do_not_fit() {
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
