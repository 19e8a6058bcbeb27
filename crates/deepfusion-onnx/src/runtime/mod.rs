//! Runs ONNX files in ONNX Runtime, on the CPU. The library is found and opened at run time; a process uses
//! one library for all its models.

mod foreign;
mod library;
mod places;

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use ort::environment::Environment;
use ort::session::{OutputSelector, RunOptions, Session};
use ort::value::TensorRef;

pub use foreign::{ForeignModel, Tensor, TensorInfo};
pub use library::{Library, find};

use crate::{DepthMaps, Error, LibraryProblem, ModelProblem};

/// A model in ONNX Runtime.
#[derive(Debug)]
pub struct OrtEngine {
    session: Session,
    library: Library,
    width: usize,
    height: usize,
}

/// The library that this process uses.
static ENVIRONMENT: Mutex<Option<(Library, Environment)>> = Mutex::new(None);

impl OrtEngine {
    /// Loads a model as [`crate::write()`] makes it.
    ///
    /// `library` is the ONNX Runtime library; without it, the one in use is taken, or one is [searched for](find).
    /// `threads` is the number of CPU threads per run; 0 leaves it to ONNX Runtime.
    ///
    /// # Errors
    /// As [`find`]; [`Error::Library`] if this process already uses another library, [`Error::Runtime`]
    /// for a model that the library does not accept, [`Error::Model`] for one that is not a depth model.
    pub fn load(library: Option<&Path>, model: &[u8], threads: usize) -> Result<Self, Error> {
        let (session, library) = session(library, model, threads)?;
        let (width, height) = size_of(&session)?;
        Ok(Self {
            session,
            library,
            width,
            height,
        })
    }

    /// Path of the library it runs in.
    #[must_use]
    pub fn library(&self) -> &Library {
        &self.library
    }

    /// Width and height of the pictures it takes, in pixels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Metric disparity of a picture, in 1/m.
    ///
    /// # Shapes
    /// - `rgb`: H×W×3 bytes
    /// - `disparity`: H×W, row by row
    ///
    /// # Errors
    /// [`Error::Length`] for another size than the model's, [`Error::Runtime`].
    pub fn run(&mut self, rgb: &[u8], disparity: &mut [f32]) -> Result<(), Error> {
        self.outputs(rgb, [("disparity", disparity)])
    }

    /// Depth and disparity of a picture.
    ///
    /// # Shapes
    /// - `rgb`: H×W×3 bytes
    /// - output: H×W, row by row
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn maps(&mut self, rgb: &[u8]) -> Result<DepthMaps, Error> {
        let blank = vec![0.0; self.width * self.height];
        let mut maps = DepthMaps {
            depth: blank.clone(),
            disparity: blank,
        };
        let wanted = [
            ("depth", &mut maps.depth[..]),
            ("disparity", &mut maps.disparity[..]),
        ];
        self.outputs(rgb, wanted)?;
        Ok(maps)
    }

    /// Runs the model; only the requested outputs are computed.
    fn outputs<const N: usize>(
        &mut self,
        rgb: &[u8],
        wanted: [(&'static str, &mut [f32]); N],
    ) -> Result<(), Error> {
        const RUN: &str = "run the model";
        let pixels = self.width * self.height;
        check_length("a picture", 3 * pixels, rgb.len())?;
        let select = |all: OutputSelector, (name, _): &(&str, _)| all.with(*name);
        let selector = wanted.iter().fold(OutputSelector::no_default(), select);
        let options = RunOptions::new().map_err(|e| refused(RUN, e))?;
        let options = options.with_outputs(selector);
        let shape = [1, self.height, self.width, 3];
        let image = TensorRef::from_array_view((shape, rgb)).map_err(|e| refused(RUN, e))?;
        let outputs = self
            .session
            .run_with_options(ort::inputs!["image" => image], &options)
            .map_err(|e| refused(RUN, e))?;
        for (name, buffer) in wanted {
            let missing = || Error::Model {
                part: "outputs",
                reason: ModelProblem::NoOutput { name },
            };
            let values = outputs.get(name).ok_or_else(missing)?;
            let values = values.try_extract_tensor::<f32>();
            let (_, values) = values.map_err(|e| refused("return its output", e))?;
            check_length("an output", pixels, values.len())?;
            check_length("a buffer", pixels, buffer.len())?;
            buffer.copy_from_slice(values);
        }
        Ok(())
    }
}

fn refused(action: &'static str, error: impl Into<ort::Error>) -> Error {
    Error::Runtime {
        action,
        source: Box::new(error.into()),
    }
}

fn check_length(what: &'static str, expected: usize, found: usize) -> Result<(), Error> {
    if found == expected {
        return Ok(());
    }
    Err(Error::Length {
        what,
        expected,
        found,
    })
}

/// Width and height of the only input, a picture of bytes.
fn size_of(session: &Session) -> Result<(usize, usize), Error> {
    let size = match session.inputs() {
        [input] if input.name() == "image" => match input.dtype().tensor_shape().map(|s| &s[..]) {
            Some(&[1, height, width, 3]) => usize::try_from(width)
                .ok()
                .zip(usize::try_from(height).ok()),
            _ => None,
        },
        _ => None,
    };
    size.ok_or_else(|| Error::Model {
        part: "input",
        reason: ModelProblem::NoPicture,
    })
}

/// A session for a model, and the library it runs in; `threads` as for [`OrtEngine::load`].
fn session(
    library: Option<&Path>,
    model: &[u8],
    threads: usize,
) -> Result<(Session, Library), Error> {
    let (library, environment) = environment(library)?;
    let builder = Session::builder(&environment);
    let mut builder = builder.map_err(|e| refused("create a session", e))?;
    if threads > 0 {
        builder = builder
            .with_intra_threads(threads)
            .map_err(|e| refused("set the number of threads", e))?;
    }
    let session = builder.commit_from_memory(model);
    let session = session.map_err(|e| refused("load the model", e))?;
    Ok((session, library))
}

/// Opens the library, or returns the one that is open.
fn environment(asked: Option<&Path>) -> Result<(Library, Environment), Error> {
    let mut open = ENVIRONMENT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((library, environment)) = &*open {
        let same = |path: &Path| real(path) == real(&library.path);
        return match asked {
            Some(path) if !same(path) => Err(Error::Library {
                path: path.to_owned(),
                reason: LibraryProblem::AnotherInUse {
                    path: library.path.clone(),
                },
            }),
            _ => Ok((library.clone(), environment.clone())),
        };
    }
    let library = find(asked)?;
    let unusable = |error| Error::Library {
        path: library.path.clone(),
        reason: LibraryProblem::Refused(error),
    };
    let environment = ort::init_from(&library.path).map_err(|e| unusable(e.into()))?;
    let environment = environment
        .with_name("deepfusion")
        .with_telemetry(false)
        .build();
    let environment = environment.map_err(|e| unusable(e.into()))?;
    *open = Some((library.clone(), environment.clone()));
    Ok((library, environment))
}

fn real(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}
