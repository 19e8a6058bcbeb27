//! The program that `benches/peers/rosbags_read.py` compares with PyPI's `rosbags`.
//!
//! `throughput write FOLDER` writes the bags of the bench; `throughput read BAG` opens one, decodes every message and
//! prints the seconds that took, the number of messages and their bytes.

#[path = "../benches/recordings/mod.rs"]
mod recordings;

use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["write", folder] => {
            for (name, compression, small, messages) in recordings::RECORDINGS {
                recordings::write(&Path::new(folder).join(name), compression, small, messages)?;
            }
        }
        ["read", bag] => {
            let start = Instant::now();
            let (count, bytes) = recordings::read(Path::new(bag))?;
            println!("{} {count} {bytes}", start.elapsed().as_secs_f64());
        }
        _ => return Err("throughput write FOLDER | throughput read BAG".into()),
    }
    Ok(())
}
