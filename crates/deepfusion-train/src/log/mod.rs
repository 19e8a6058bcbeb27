//! A run's records: `log.csv` and TensorBoard events.

mod csv;
mod tensorboard;

pub use csv::{CsvLog, CsvRecord};
pub use tensorboard::TensorBoardLog;
