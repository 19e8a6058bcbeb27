//! Trained depth networks inside the program.
//!
//! A packed network is two files: `NAME.safetensors`, the tensors of a depth network by name ([`pack`]), and `NAME.toml`, its [`Card`] with
//! the configuration and the origin. All such pairs in this crate's folder `weights/` are embedded ([`all`], [`find`]); there may be none.
//! [`Shipped::read`] reads a pair from disk.

mod card;
mod error;
#[cfg_attr(
    not(test),
    allow(
        dead_code,
        reason = "the build script scans, the library only checks names"
    )
)]
mod scan;
mod shipped;
mod summary;
mod tensors;

pub use card::{Card, FORMAT_VERSION, Figure};
pub use error::{CardProblem, Error};
pub use shipped::{DEFAULT, MAX_BYTES, Shipped, all, find, names};
pub use summary::CardSummary;
pub use tensors::{NUMBERS, Tensor, pack};
