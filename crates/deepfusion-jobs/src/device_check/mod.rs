//! Checks that a device computes what the processor does, in processes that a driver may crash.
//!
//! [`check_device`] computes every operation of [`deepfusion_train::device_check`] and reports each as soon as it is done. A GPU's driver
//! may end the process that uses it, or hang. So other processes do the work and print each operation of [`checks_from`] as its
//! [`answer_line`]. If one ends or hangs, the next process continues after the operation that failed.

mod answer;
mod patient_lines;
mod record;
mod supervisor;

pub use self::answer::{answer_line, checks_from};
pub use self::record::{DeviceCheckRecord, OperationRecord};
pub use self::supervisor::check_device;
