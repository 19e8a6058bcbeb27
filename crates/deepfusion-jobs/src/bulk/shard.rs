//! A shard of the images, for several runs that divide them.

use std::fmt;
use std::str::FromStr;

use deepfusion_hint::Hint;

/// One of several shards of a job, written `2/8`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Number of this shard, counted from 1.
    pub index: usize,
    /// Number of shards.
    pub count: usize,
}

impl Shard {
    /// The only shard, with all images.
    pub const WHOLE: Self = Self { index: 1, count: 1 };

    /// This shard's items of `all`: every `count`-th. So shards differ in size by at most one item, and long images in one folder are
    /// divided, too.
    pub fn select<T>(self, all: &[T]) -> impl Iterator<Item = &T> {
        all.iter().skip(self.index - 1).step_by(self.count)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// Why a text is not a shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoShard {
    /// It is not written as I/N.
    #[error("expected I/N, the I-th of N shards, such as 2/8")]
    Shape,
    /// Its number is 0.
    #[error("shards are counted from 1: the first of {count} is 1/{count}")]
    Zero {
        /// Number of shards.
        count: usize,
    },
    /// Its number is larger than the number of shards.
    #[error("there is no shard {index} of {count}")]
    Beyond {
        /// Number of the shard.
        index: usize,
        /// Number of shards.
        count: usize,
    },
}

impl Hint for NoShard {
    fn hint(&self) -> Option<String> {
        match self {
            // These messages say what is expected.
            Self::Shape | Self::Zero { .. } => None,
            Self::Beyond { count: 0, .. } => Some("set N to at least 1".into()),
            Self::Beyond { count, .. } => Some(format!("the last shard is {count}/{count}")),
        }
    }
}

impl FromStr for Shard {
    type Err = NoShard;

    fn from_str(text: &str) -> Result<Self, NoShard> {
        let numbers = text.split_once('/').and_then(|(index, count)| {
            Some((index.trim().parse().ok()?, count.trim().parse().ok()?))
        });
        match numbers {
            Some((0, count)) if count > 0 => Err(NoShard::Zero { count }),
            Some((index, count)) if index > count => Err(NoShard::Beyond { index, count }),
            Some((index, count)) if index > 0 => Ok(Self { index, count }),
            _ => Err(NoShard::Shape),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn shards_are_parsed() {
        assert_eq!("2/8".parse(), Ok(Shard { index: 2, count: 8 }));
        for bad in [
            "0/8", "9/8", "0/0", "1/0", "1", "a/b", "-1/2", "1/2/3", "1.5/2",
        ] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }

    #[test]
    fn an_invalid_shard_says_why() {
        for (text, why) in [
            ("1", "expected I/N, the I-th of N shards, such as 2/8"),
            ("0/0", "expected I/N, the I-th of N shards, such as 2/8"),
            ("0/8", "shards are counted from 1: the first of 8 is 1/8"),
            ("9/8", "there is no shard 9 of 8"),
            ("1/0", "there is no shard 1 of 0"),
        ] {
            assert_eq!(text.parse::<Shard>().unwrap_err().to_string(), why);
        }
        let beyond = "9/8".parse::<Shard>().unwrap_err();
        assert_eq!(beyond.hint().as_deref(), Some("the last shard is 8/8"));
    }

    proptest! {
        /// Every item is in exactly one shard, and no shard is larger than another by more than one.
        #[test]
        fn shards_partition_the_items(items in 0usize..200, count in 1usize..20) {
            let all: Vec<usize> = (0..items).collect();
            let shards = (1..=count).map(|index| {
                Shard { index, count }.select(&all).copied().collect::<Vec<_>>()
            });
            let shards: Vec<_> = shards.collect();
            let sizes = shards.iter().map(Vec::len);
            prop_assert!(sizes.clone().max().unwrap() - sizes.min().unwrap() <= 1);
            let mut together = shards.concat();
            together.sort_unstable();
            prop_assert_eq!(together, all);
        }
    }
}
