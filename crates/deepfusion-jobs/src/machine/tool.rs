//! External programs and libraries that are used if available.

use std::fmt;
use std::path::PathBuf;

use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use super::{NoProgram, version_of};

/// An external program or library. Its text form is what was found, or why it cannot be used.
#[derive(Debug)]
pub enum Tool {
    /// It can be used.
    Found {
        /// Its version, as it reports it.
        version: String,
        /// Path of a library's file.
        file: Option<PathBuf>,
    },
    /// It cannot be used.
    Unusable(NoTool),
}

/// Why an external program or library cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NoTool {
    /// The error of a program.
    #[error(transparent)]
    Program(#[from] NoProgram),
    /// The error of ONNX Runtime.
    #[error(transparent)]
    OnnxRuntime(#[from] deepfusion_onnx::Error),
}

impl Tool {
    /// Looks for one of ffmpeg's programs.
    pub(super) fn program(name: &str) -> Self {
        match version_of(name) {
            Ok(version) => Self::Found {
                version,
                file: None,
            },
            Err(why) => Self::Unusable(why.into()),
        }
    }

    /// Looks for ONNX Runtime's library in the usual places.
    pub(super) fn onnx_runtime() -> Self {
        match deepfusion_onnx::runtime::find(None) {
            Ok(library) => Self::Found {
                version: library.version,
                file: Some(library.path),
            },
            Err(why) => Self::Unusable(why.into()),
        }
    }

    /// Whether it can be used.
    #[must_use]
    pub fn is_found(&self) -> bool {
        matches!(self, Self::Found { .. })
    }
}

impl fmt::Display for Tool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Found { version, file } => {
                f.write_str(version)?;
                match file {
                    Some(file) => write!(f, " at {}", file.display()),
                    None => Ok(()),
                }
            }
            Self::Unusable(why) => write!(f, "{why}"),
        }
    }
}

/// The fields `found` and `what`, the text form.
impl Serialize for Tool {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_struct("Tool", 2)?;
        fields.serialize_field("found", &self.is_found())?;
        fields.serialize_field("what", &self.to_string())?;
        fields.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_of_a_tool_has_its_file_or_the_reason() {
        let json = |tool: &Tool| serde_json::to_string(tool).unwrap();
        let library = Tool::Found {
            version: "1.31.1".into(),
            file: Some("lib/libonnxruntime.so".into()),
        };
        assert_eq!(
            json(&library),
            r#"{"found":true,"what":"1.31.1 at lib/libonnxruntime.so"}"#
        );
        let program = Tool::Found {
            version: "ffmpeg version 7.1".into(),
            file: None,
        };
        assert_eq!(program.to_string(), "ffmpeg version 7.1");
        let none = Tool::program("no-such-program-anywhere");
        assert_eq!(json(&none), r#"{"found":false,"what":"not on the PATH"}"#);
    }
}
