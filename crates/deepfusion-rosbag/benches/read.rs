//! Opening a bag and decoding all its messages: `cargo bench -p deepfusion-rosbag`. The same compared with PyPI's `rosbags`,
//! with the ratios: `python benches/peers/rosbags_read.py`.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a benchmark that cannot run may panic"
)]

mod recordings;

use criterion::{Criterion, Throughput, criterion_main};
use recordings::{RECORDINGS, read, write};

fn bags(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder for the bags");
    let mut group = criterion.benchmark_group("open and decode");
    for (name, compression, small, messages) in RECORDINGS {
        let path = folder.path().join(name);
        write(&path, compression, small, messages).expect("the bag is written");
        let (count, bytes) = read(&path).expect("the bag is read");
        assert_eq!(count, u64::from(messages));
        group.throughput(Throughput::Bytes(bytes));
        group.bench_function(name, |b| b.iter(|| read(&path)));
    }
    group.finish();
}

// The macro makes a public function that cannot be documented.
#[allow(missing_docs)]
mod group {
    use super::{Criterion, bags};
    use criterion::criterion_group;
    use std::time::Duration;

    criterion_group! {
        name = reading;
        config = Criterion::default().sample_size(10).warm_up_time(Duration::from_millis(300))
            .measurement_time(Duration::from_secs(3));
        targets = bags
    }
}

criterion_main!(group::reading);
