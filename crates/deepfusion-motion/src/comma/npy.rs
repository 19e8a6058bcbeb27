//! Reads NumPy array files of one or two dimensions.

use crate::error::{ArrayProblem, Error, Result};
use deepfusion_fs::FileError;
use deepfusion_geometry::NpyHeader;
use ndarray::ArrayD;
use ndarray_npy::ReadNpyExt;
use std::path::Path;

/// Rows with `columns` numbers each.
#[derive(Debug)]
pub(super) struct Table {
    pub values: Vec<f64>,
    pub columns: usize,
}

impl Table {
    /// Reads an array of `float64` or `float32` with this many columns; a single column may be one-dimensional.
    pub(super) fn read(path: &Path, columns: usize) -> Result<Self> {
        let failed = |source| Error::ArrayFile(FileError::new(path, source));
        let bytes = std::fs::read(path).map_err(failed)?;
        Self::parse(&bytes, columns).map_err(|problem| Error::Array {
            path: path.to_owned(),
            problem,
        })
    }

    fn parse(bytes: &[u8], columns: usize) -> std::result::Result<Self, ArrayProblem> {
        if !NpyHeader::parse(bytes)?.fits(bytes.len() as u64) {
            return Err(ArrayProblem::Cut);
        }
        let array = ArrayD::<f64>::read_npy(bytes)
            .or_else(|_| ArrayD::<f32>::read_npy(bytes).map(|a| a.mapv(f64::from)))
            .map_err(ArrayProblem::NoFloats)?;
        let fits = match array.shape() {
            [_] => columns == 1,
            [_, c] => *c == columns,
            _ => false,
        };
        if !fits {
            let shape = array.shape().to_vec();
            return Err(ArrayProblem::Shape { shape, columns });
        }
        Ok(Self {
            // In logical order, however the file stores it.
            values: array.iter().copied().collect(),
            columns,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_geometry::NpyHeaderProblem;
    use ndarray::{Array1, Array2, ShapeBuilder};
    use ndarray_npy::WriteNpyExt;
    use proptest::prelude::*;

    fn bytes(array: &Array2<f64>) -> Vec<u8> {
        let mut out = Vec::new();
        array.write_npy(&mut out).unwrap();
        out
    }

    #[test]
    fn rows_are_read_in_either_storage_order() {
        let rows = Array2::from_shape_fn((4, 3), |(r, c)| (10 * r + c) as f64);
        let mut columns = Array2::zeros((4, 3).f());
        columns.assign(&rows);
        for array in [rows, columns] {
            let table = Table::parse(&bytes(&array), 3).unwrap();
            assert_eq!(table.values[..4], [0.0, 1.0, 2.0, 10.0]);
        }
    }

    #[test]
    fn float32_and_flat_arrays_are_read() {
        let mut out = Vec::new();
        let flat: Array1<f32> = Array1::from(vec![0.5, 1.5]);
        flat.write_npy(&mut out).unwrap();
        assert_eq!(Table::parse(&out, 1).unwrap().values, [0.5, 1.5]);
        let error = Table::parse(&out, 3).unwrap_err().to_string();
        assert!(error.contains("is 2, expected N×3"), "{error}");
    }

    #[test]
    fn a_header_with_wrong_lengths_allocates_nothing() {
        let mut file = b"\x93NUMPY\x02\x00".to_vec();
        file.extend([0xff, 0xff, 0xff, 0x7f]);
        let error = Table::parse(&file, 1).unwrap_err();
        assert!(
            matches!(error, ArrayProblem::Header(NpyHeaderProblem::Cut)),
            "{error}"
        );
        assert_eq!(error.to_string(), "ends within its header");
        // A shape of 2^40 rows, but only 16 bytes of data.
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (1099511627776, ), }\n";
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.as_bytes());
        file.extend([0; 16]);
        let error = Table::parse(&file, 1).unwrap_err();
        assert!(matches!(error, ArrayProblem::Cut), "{error}");
    }

    proptest! {
        #[test]
        fn garbage_never_panics(mut tail in proptest::collection::vec(any::<u8>(), 0..200), real in any::<bool>()) {
            let mut file = if real { b"\x93NUMPY\x01\x00".to_vec() } else { Vec::new() };
            file.append(&mut tail);
            let _ = Table::parse(&file, 1);
        }

        #[test]
        fn a_cut_file_is_an_error(cut in 0usize..224) {
            let whole = bytes(&Array2::zeros((4, 3)));
            prop_assert!(Table::parse(&whole[..cut.min(whole.len() - 1)], 3).is_err());
        }
    }
}
