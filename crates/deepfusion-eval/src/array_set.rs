use std::collections::HashSet;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use deepfusion_fs::FileError;
use deepfusion_geometry::{NpyHeader, NpyHeaderProblem};
use ndarray::{ArrayD, Axis};
use ndarray_npy::{ReadNpyError, ReadNpyExt};
use zip::ZipArchive;
use zip::result::ZipError;

use crate::error::first_names;
use crate::{ArrayName, ArrayProblem, Error, ExpectedShape, Grid, Result};

/// Prefix of the names of the velocities that `data export-gt` writes beside the depths.
const VELOCITY: &str = "velocity_mps/";

/// A file of H×W arrays of `float32` or `float64`, read one at a time: a NumPy `.npz` (named arrays), or an N×H×W (or H×W) `.npy`, whose
/// arrays have an order but no names. Velocities stored beside the depths (`velocity_mps/…`) are left out.
#[derive(Debug)]
pub struct ArraySet {
    path: PathBuf,
    source: Source,
}

enum Source {
    Npz {
        reader: Box<ZipArchive<BufReader<File>>>,
        names: Vec<String>,
        /// For each name, the array's index in the archive.
        places: Vec<usize>,
    },
    /// The arrays of an `.npy` file, N×H×W.
    Stack(ArrayD<f64>),
}

impl std::fmt::Debug for Source {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Npz { names, .. } => f.debug_tuple("Npz").field(names).finish(),
            Self::Stack(array) => f.debug_tuple("Stack").field(&array.shape()).finish(),
        }
    }
}

impl ArraySet {
    /// Opens a file. Its type is recognised by its content, not its name.
    ///
    /// # Errors
    /// [`Error::File`] if it cannot be read, [`Error::ArrayFile`] if it is neither kind of file.
    pub fn open(path: &Path) -> Result<Self> {
        let io = |source| FileError::new(path, source);
        let mut file = BufReader::new(File::open(path).map_err(io)?);
        let mut magic = Vec::new();
        file.by_ref().take(6).read_to_end(&mut magic).map_err(io)?;
        file.seek(SeekFrom::Start(0)).map_err(io)?;
        let source = if magic.starts_with(b"PK") {
            let reader = ZipArchive::new(file).map_err(|e| unreadable_archive(path, e))?;
            let names = (0..reader.len()).map(|i| {
                let name = reader.name_for_index(i).unwrap_or_default();
                name.strip_suffix(".npy").unwrap_or(name).to_owned()
            });
            let depths: Vec<_> = names.enumerate().collect();
            let depths = depths.into_iter();
            let depths = depths.filter(|(_, name)| !name.starts_with(VELOCITY));
            let (places, names) = depths.unzip();
            Source::Npz {
                reader: Box::new(reader),
                names,
                places,
            }
        } else if magic == b"\x93NUMPY" {
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).map_err(io)?;
            Source::Stack(stack(path, array(path, ArrayName::Only, &bytes)?)?)
        } else {
            return Err(Error::ArrayFile {
                path: path.to_owned(),
                reason: ArrayProblem::NotArrays,
            });
        };
        let set = Self {
            path: path.to_owned(),
            source,
        };
        if set.is_empty() {
            return Err(Error::ArrayFile {
                path: path.to_owned(),
                reason: ArrayProblem::Empty,
            });
        }
        Ok(set)
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The arrays' names in the file's order; `None` for an N×H×W stack.
    #[must_use]
    pub fn names(&self) -> Option<&[String]> {
        match &self.source {
            Source::Npz { names, .. } => Some(names),
            Source::Stack(_) => None,
        }
    }

    /// Number of arrays.
    #[must_use]
    pub fn len(&self) -> usize {
        match &self.source {
            Source::Npz { names, .. } => names.len(),
            Source::Stack(array) => array.len_of(Axis(0)),
        }
    }

    /// Whether the file has no arrays.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Reads the array at `index`, in the file's order. Axes of length 1 beside H×W are dropped.
    ///
    /// # Errors
    /// [`Error::ArrayFile`], naming the array, if the index is out of range, or the array is not two-dimensional, neither `float32` nor
    /// `float64`, or damaged.
    pub fn read(&mut self, index: usize) -> Result<Grid> {
        let len = self.len();
        if index >= len {
            return Err(Error::ArrayFile {
                path: self.path.clone(),
                reason: ArrayProblem::NoSuchArray { count: len, index },
            });
        }
        match &mut self.source {
            Source::Stack(array) => grid(
                &self.path,
                ArrayName::Number(index),
                array.index_axis(Axis(0), index).to_owned(),
            ),
            Source::Npz {
                reader,
                names,
                places,
            } => {
                let (name, index) = (names[index].clone(), places[index]);
                // By index, not by name: an archive may contain the same name twice.
                let entry = reader.by_index(index);
                let mut entry = entry.map_err(|e| unreadable_archive(&self.path, e))?;
                let mut bytes = Vec::new();
                let name = ArrayName::Named(name);
                if let Err(error) = entry.read_to_end(&mut bytes) {
                    return Err(unreadable(&self.path, name, ReadNpyError::Io(error)));
                }
                let array = array(&self.path, name.clone(), &bytes)?;
                grid(&self.path, name, array)
            }
        }
    }
}

/// Pairs the arrays of `predictions` with those of `ground_truth`: by name if both have names, else by order. Returns triples of (name,
/// index in `predictions`, index in `ground_truth`) in the ground truth's order.
///
/// # Errors
/// [`Error::UnmatchedNames`] if one file has an array that the other lacks; [`Error::Count`] if files in split order have different numbers
/// of arrays.
pub fn match_names(
    predictions: &ArraySet,
    ground_truth: &ArraySet,
) -> Result<Vec<(String, usize, usize)>> {
    let (Some(predicted), Some(known)) = (predictions.names(), ground_truth.names()) else {
        let n = ground_truth.len();
        if predictions.len() != n {
            return Err(Error::Count {
                path: predictions.path.clone(),
                count: predictions.len(),
                other: ground_truth.path.clone(),
                expected: n,
            });
        }
        let names = ground_truth.names().or(predictions.names());
        let name = |i: usize| names.map_or_else(|| format!("array {i}"), |names| names[i].clone());
        return Ok((0..n).map(|i| (name(i), i, i)).collect());
    };
    require(known, &ground_truth.path, predicted, &predictions.path)?;
    require(predicted, &predictions.path, known, &ground_truth.path)?;
    let place = |name: &String| predicted.iter().position(|p| p == name);
    Ok(known
        .iter()
        .enumerate()
        .filter_map(|(i, name)| Some((name.clone(), place(name)?, i)))
        .collect())
}

/// Fails if one of the names `wanted` (which come from the file `from`) is not among the names `present` in the file `path`.
fn require(wanted: &[String], from: &Path, present: &[String], path: &Path) -> Result<()> {
    let set: HashSet<_> = present.iter().collect();
    let missing: Vec<_> = wanted.iter().filter(|name| !set.contains(name)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    Err(Error::UnmatchedNames {
        path: path.to_owned(),
        count: missing.len(),
        of: format!("the {} in {}", wanted.len(), from.display()),
        names: first_names(missing),
        instead: present.first().cloned(),
    })
}

/// Reads one array from the bytes of an `.npy` file.
fn array(path: &Path, name: ArrayName, bytes: &[u8]) -> Result<ArrayD<f64>> {
    let wrong = |reason| Error::ArrayFile {
        path: path.to_owned(),
        reason,
    };
    // The reader allocates what the file's header claims, however much that is.
    match NpyHeader::parse(bytes) {
        Ok(header) if header.item_bytes().is_none() || header.fits(bytes.len() as u64) => {}
        Err(NpyHeaderProblem::NotNpy) => return Err(wrong(ArrayProblem::NotArrays)),
        _ => return Err(wrong(ArrayProblem::Cut { array: name })),
    }
    let doubles = match ArrayD::<f64>::read_npy(bytes) {
        Err(ReadNpyError::WrongDescriptor(_)) => {
            ArrayD::<f32>::read_npy(bytes).map(|array| array.mapv(f64::from))
        }
        other => other,
    };
    doubles.map_err(|error| unreadable(path, name, error))
}

/// The array as N×H×W; a single H×W array becomes 1×H×W.
fn stack(path: &Path, array: ArrayD<f64>) -> Result<ArrayD<f64>> {
    match array.ndim() {
        2 => Ok(array.insert_axis(Axis(0))),
        3 | 4 => Ok(array),
        _ => Err(wrong_shape(
            path,
            ArrayName::Only,
            array.shape(),
            ExpectedShape::Stack,
        )),
    }
}

fn grid(path: &Path, name: ArrayName, mut array: ArrayD<f64>) -> Result<Grid> {
    let shape = array.shape().to_owned();
    while array.ndim() > 2 {
        match array.shape().iter().position(|n| *n == 1) {
            Some(axis) => array = array.index_axis_move(Axis(axis), 0),
            None => return Err(wrong_shape(path, name, &shape, ExpectedShape::Image)),
        }
    }
    let &[height, width] = array.shape() else {
        return Err(wrong_shape(path, name, &shape, ExpectedShape::Image));
    };
    // Iterates in logical order, whatever the memory order was (NumPy may write Fortran order).
    Grid::new(width, height, array.iter().copied().collect())
        .map_err(|_| wrong_shape(path, name, &shape, ExpectedShape::ImageWithPixels))
}

fn wrong_shape(path: &Path, array: ArrayName, shape: &[usize], expected: ExpectedShape) -> Error {
    Error::ArrayFile {
        path: path.to_owned(),
        reason: ArrayProblem::Shape {
            array,
            found: shape.to_owned(),
            expected,
        },
    }
}

fn unreadable(path: &Path, array: ArrayName, error: ReadNpyError) -> Error {
    Error::ArrayFile {
        path: path.to_owned(),
        reason: match error {
            ReadNpyError::WrongDescriptor(found) => ArrayProblem::Numbers {
                array,
                found: found.to_string(),
            },
            other => ArrayProblem::Unreadable {
                array,
                source: Box::new(other),
            },
        },
    }
}

fn unreadable_archive(path: &Path, error: ZipError) -> Error {
    Error::ArrayFile {
        path: path.to_owned(),
        reason: ArrayProblem::Archive(Box::new(error)),
    }
}
