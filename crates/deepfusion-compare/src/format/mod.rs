//! The forms in which tables are printed.

mod csv;
mod html;
mod latex;
mod text;
