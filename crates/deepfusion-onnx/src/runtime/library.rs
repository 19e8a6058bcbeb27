//! Finds a usable ONNX Runtime library.

use std::ffi::CStr;
use std::path::{Path, PathBuf};

use libloading::Symbol;
use ort::sys::OrtApiBase;

use super::places;
use crate::{Error, LibraryProblem};

/// A usable ONNX Runtime library.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Library {
    /// Path of the file.
    pub path: PathBuf,
    /// Its version, such as `1.31.1`.
    pub version: String,
}

/// Finds the ONNX Runtime library: the given file, else the one that `ORT_DYLIB_PATH` names, else the
/// first usable one next to the program, in the system's folders, or in a Python installation on `PATH`
/// (`pip install onnxruntime`). Python is not started.
///
/// # Errors
/// [`Error::Library`] if the named file is not usable, or none of those found is; [`Error::NoLibrary`]
/// if there is none.
pub fn find(asked: Option<&Path>) -> Result<Library, Error> {
    let named = asked.map(Path::to_owned).or_else(|| {
        let variable = std::env::var_os("ORT_DYLIB_PATH")?;
        (!variable.is_empty()).then(|| variable.into())
    });
    if let Some(path) = named {
        return open(&path);
    }
    let searched = places::folders();
    let mut first_failure = None;
    for file in searched
        .iter()
        .flat_map(|folder| places::libraries_in(folder))
    {
        match open(&file) {
            Ok(library) => return Ok(library),
            Err(error) => first_failure = first_failure.or(Some(error)),
        }
    }
    Err(first_failure.unwrap_or(Error::NoLibrary { searched }))
}

/// Opens a library and reads its version.
fn open(path: &Path) -> Result<Library, Error> {
    let fail = |reason| Error::Library {
        path: path.to_owned(),
        reason,
    };
    // The system would search for a name without a folder, but never for a path.
    let file = std::path::absolute(path).map_err(|e| fail(LibraryProblem::Refused(e.into())))?;
    if !file.is_file() {
        return Err(fail(LibraryProblem::Missing));
    }
    // SAFETY: opening a library runs its initialisers; the file is one that the user named or that has
    // ONNX Runtime's name in a folder of installed programs.
    let library = unsafe { libloading::Library::new(&file) };
    let library = library.map_err(|e| fail(LibraryProblem::Refused(e.into())))?;
    // SAFETY: the symbol is ONNX Runtime's one entry point, whose type has never changed.
    let entry: Result<Symbol<unsafe extern "C" fn() -> *const OrtApiBase>, _> =
        unsafe { library.get(b"OrtGetApiBase") };
    let entry = entry.map_err(|_| fail(LibraryProblem::NoEntryPoint))?;
    // SAFETY: it takes no arguments and returns a pointer to a constant, or null.
    let base = unsafe { entry().as_ref() };
    let base = base.ok_or_else(|| fail(LibraryProblem::EmptyEntryPoint))?;
    // SAFETY: as ONNX Runtime documents it, a text that lives as long as the library.
    let version = unsafe { CStr::from_ptr((base.GetVersionString)()) };
    let version = version.to_string_lossy().into_owned();
    // SAFETY: any version may be requested; the answer for an unknown one is null.
    let known = !unsafe { (base.GetApi)(ort::MINOR_VERSION) }.is_null();
    if !known || !is_new_enough(&version) {
        let oldest = ort::MINOR_VERSION;
        return Err(fail(LibraryProblem::Version {
            found: version,
            oldest,
        }));
    }
    // The library stays open: it is needed next, and its threads must not outlive its code.
    std::mem::forget(library);
    Ok(Library {
        path: file,
        version,
    })
}

/// The second number of `1.x.y`, by which the binding compares versions.
fn is_new_enough(version: &str) -> bool {
    let minor = version.split('.').nth(1).and_then(|n| n.parse().ok());
    minor.is_some_and(|minor: u32| minor >= ort::MINOR_VERSION)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_compared_by_their_second_number() {
        for (version, expected) in [
            ("1.31.1", true),
            ("1.17.0", true),
            ("1.16.3", false),
            ("1", false),
            ("one.two", false),
            ("", false),
        ] {
            assert_eq!(is_new_enough(version), expected, "{version}");
        }
    }
}
