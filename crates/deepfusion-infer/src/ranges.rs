//! What convolutions read, as ranges: int8 divides them into 255 steps.

use std::collections::BTreeMap;

use crate::element::Element;
use crate::view::{Shared, View};

/// For each convolution, by its name, the least and the greatest value that it reads in an image, on average over the images that
/// [`Engine::observe`](crate::Engine::observe) saw. What lies beyond is held at the end.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct InputRanges {
    /// Sums over the images.
    sums: BTreeMap<String, [f64; 2]>,
    /// How many images were seen.
    pub(crate) images: usize,
}

impl InputRanges {
    /// Ranges that were found before, over that many images.
    #[must_use]
    pub fn new(ranges: BTreeMap<String, [f32; 2]>, images: usize) -> Self {
        let n = images.max(1) as f64;
        let sums = ranges.into_iter();
        Self {
            sums: sums
                .map(|(name, range)| (name, range.map(|end| f64::from(end) * n)))
                .collect(),
            images: images.max(1),
        }
    }

    /// How many images were seen.
    #[must_use]
    pub fn images(&self) -> usize {
        self.images
    }

    /// The ranges by name.
    #[must_use]
    pub fn ranges(&self) -> BTreeMap<String, [f32; 2]> {
        let names = self.sums.keys();
        names
            .filter_map(|name| Some((name.clone(), self.get(name)?)))
            .collect()
    }

    /// That of a convolution.
    pub(crate) fn get(&self, name: &str) -> Option<[f32; 2]> {
        let sums = self.sums.get(name)?;
        Some(sums.map(|sum| (sum / self.images.max(1) as f64) as f32))
    }

    pub(crate) fn add(&mut self, name: &str, seen: [f32; 2]) {
        let sums = match self.sums.get_mut(name) {
            Some(sums) => sums,
            None => self.sums.entry(name.to_owned()).or_default(),
        };
        for (sum, end) in sums.iter_mut().zip(seen) {
            *sum += f64::from(end);
        }
    }
}

/// The least and the greatest value of a view.
///
/// # Safety
/// The view must lie in the arena, and nobody may write it meanwhile.
pub(crate) unsafe fn extent<E: Element>(arena: Shared<E>, view: &View) -> [f32; 2] {
    let mut ends = [f32::INFINITY, f32::NEG_INFINITY];
    for y in 0..view.height {
        for x in 0..view.width {
            // SAFETY: the caller's promise.
            for value in unsafe { arena.read(view.at(x, y), view.channels) } {
                let value = value.value();
                ends = [ends[0].min(value), ends[1].max(value)];
            }
        }
    }
    ends
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_means_over_images() {
        let mut ranges = InputRanges::default();
        for seen in [[-1.0, 2.0], [-3.0, 6.0]] {
            ranges.add("conv", seen);
            ranges.images += 1;
        }
        assert_eq!(ranges.get("conv"), Some([-2.0, 4.0]));
        assert_eq!(ranges.get("other"), None);
        let again = InputRanges::new(ranges.ranges(), ranges.images());
        assert_eq!(again, ranges);
    }
}
