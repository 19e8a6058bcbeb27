//! What to do about an error, in one line.
//!
//! An error's message says what is wrong and where. [`Hint`] adds what the reader can do about it. Every error type that a public function
//! of this project returns implements it. If an error wraps a reason of its own type, the error's hint covers the reason too. So a program
//! that shows errors needs one rule for all of them:
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
//!
//! [`system_hint`] is the hint for an error of the operating system: a missing file, a full disk. [`count_of`] writes the counts in a
//! message: `1 frame`, `2 frames`.

mod system;

pub use self::system::system_hint;

/// A count with its noun, in the plural unless the count is one. For nouns with a regular plural.
///
/// ```
/// use deepfusion_hint::count_of;
///
/// assert_eq!(count_of(1, "frame"), "1 frame");
/// assert_eq!(count_of(0_u64, "yaw rate"), "0 yaw rates");
/// assert_eq!(count_of(2_usize, "fix"), "2 fixes");
/// assert_eq!(count_of(2_usize, "epoch"), "2 epochs");
/// ```
#[must_use]
pub fn count_of<N>(count: N, noun: &str) -> String
where
    N: Copy + PartialEq + From<u8> + std::fmt::Display,
{
    let ending = if count == N::from(1) {
        ""
    } else if noun.ends_with(['s', 'x']) || (noun.ends_with("ch") && !noun.ends_with("epoch")) {
        "es"
    } else {
        "s"
    };
    format!("{count} {noun}{ending}")
}

/// An error that may say what to do about it.
///
/// The hint is in the library's terms: fields, files and values, never a program's options. The command line adds which option to use.
pub trait Hint: std::error::Error {
    /// What to do about it, in one line; `None` if the message already says it.
    #[must_use]
    fn hint(&self) -> Option<String>;
}
