//! A part of the images, for several runs that share them.

use std::fmt;
use std::str::FromStr;

/// One part of a work shared among several runs, written `2/8`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Which part, counted from 1.
    pub index: usize,
    /// Of how many.
    pub count: usize,
}

impl Shard {
    /// All of it.
    pub const WHOLE: Self = Self { index: 1, count: 1 };

    /// This part of `all`: every `count`-th, so that parts are as large as each other to one item, and long
    /// images in one folder are shared too.
    pub fn part_of<T>(self, all: &[T]) -> impl Iterator<Item = &T> {
        all.iter().skip(self.index - 1).step_by(self.count)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(index, count)| {
            Some((index.trim().parse().ok()?, count.trim().parse().ok()?))
        });
        match numbers {
            Some((0, count)) if count > 0 => Err(format!(
                "shards are counted from 1: the first of {count} is 1/{count}"
            )),
            Some((index, count)) if index > count => {
                Err(format!("there is no part {index} of {count}"))
            }
            Some((index, count)) if index > 0 => Ok(Self { index, count }),
            _ => Err("expected I/N, the I-th of N parts, such as 2/8".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn shards() {
        assert_eq!("2/8".parse(), Ok(Shard { index: 2, count: 8 }));
        for bad in [
            "0/8", "9/8", "0/0", "1/0", "1", "a/b", "-1/2", "1/2/3", "1.5/2",
        ] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }

    proptest! {
        /// Every item is in exactly one part, and no part is larger than another by more than one.
        #[test]
        fn shards_partition(items in 0usize..200, count in 1usize..20) {
            let all: Vec<usize> = (0..items).collect();
            let parts = (1..=count).map(|index| {
                Shard { index, count }.part_of(&all).copied().collect::<Vec<_>>()
            });
            let parts: Vec<_> = parts.collect();
            let sizes = parts.iter().map(Vec::len);
            prop_assert!(sizes.clone().max().unwrap() - sizes.min().unwrap() <= 1);
            let mut together = parts.concat();
            together.sort_unstable();
            prop_assert_eq!(together, all);
        }
    }
}
