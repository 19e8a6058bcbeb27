//! Lists the topics of a ROS bag, and the time of each one's first message.
//!
//! ```text
//! cargo run --release --example bag_streams -- DRIVE.bag
//! ```

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use deepfusion::bags::{Bag, Selection};

fn main() -> Result<()> {
    let path = std::env::args().nth(1).context("usage: bag_streams BAG")?;
    let bag = Bag::open(&path)?;
    if let Some(damage) = bag.damage() {
        eprintln!("{path}: {damage}");
    }
    for topic in bag.topics()? {
        let rate = topic.rate_hz().map_or("?".into(), |hz| format!("{hz:.1}"));
        let (count, name, kind) = (topic.count, &topic.name, &topic.type_name);
        println!("{count:8} messages at {rate} Hz  {name}  {kind}");
    }
    let mut first = BTreeMap::new();
    for message in bag.messages(Selection::all())? {
        let message = message?;
        first
            .entry(message.topic().to_owned())
            .or_insert(message.time());
    }
    for (topic, time) in first {
        println!("{topic} begins at {time}");
    }
    Ok(())
}
