//! What to do about an error, in one line.
//!
//! An error's message says what is wrong and where. [`Hint`] adds what its reader can do about it. Every public error of this
//! project implements it, so a program that shows errors needs one rule for all of them:
//!
//! ```
//! use deepfusion_hint::Hint;
//!
//! fn show(error: &impl Hint) -> String {
//!     match error.hint() {
//!         Some(hint) => format!("error: {error}\nhint: {hint}"),
//!         None => format!("error: {error}"),
//!     }
//! }
//! ```

/// An error that may know its remedy.
///
/// The remedy is said in the library's words: fields, files and values, never the options of a program. The command line says
/// which option is meant.
pub trait Hint: std::error::Error {
    /// What to do about it, in one line; none where only the system's reason or the message itself says it.
    #[must_use]
    fn hint(&self) -> Option<String>;
}
