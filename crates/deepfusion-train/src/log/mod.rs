//! A run's records: `log.csv` and TensorBoard events.

mod csv;
mod tensorboard;

pub use csv::CsvLog;
pub use tensorboard::TensorBoardLog;
