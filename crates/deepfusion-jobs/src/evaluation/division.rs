//! Divides images into those to learn from and those to test on, so that none of the latter resembles one of the former.

/// Smallest share of the images on either side when dividing by drives.
const LEAST_SHARE: f64 = 0.2;
/// Share of the images between the two parts of a drive that belong to neither: the end of one part must not show what the beginning of the
/// other shows.
const GAP: f64 = 0.1;

/// Indices of images, in two parts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Division {
    /// Images to learn from.
    pub(super) learned: Vec<usize>,
    /// Images to test on.
    pub(super) held_out: Vec<usize>,
    /// Whether the parts are different drives rather than two parts of one.
    pub(super) by_drive: bool,
}

/// Divides images, each given with its drive and its frame's number. If there are several drives and neither side becomes too small, the
/// images are divided by drives; otherwise into the first and the last part of all, with a gap between them. Neighbouring frames are nearly
/// copies of each other: if every second frame were held out, the test images would have been learned. A single image is learned from.
pub(super) fn divide<D: PartialEq>(images: &[(D, u64)]) -> Division {
    by_drives(images).unwrap_or_else(|| by_parts(images))
}

fn by_drives<D: PartialEq>(images: &[(D, u64)]) -> Option<Division> {
    let mut drives: Vec<(&D, Vec<usize>)> = Vec::new();
    for (index, (drive, _)) in images.iter().enumerate() {
        match drives.iter_mut().find(|(known, _)| *known == drive) {
            Some((_, of_drive)) => of_drive.push(index),
            None => drives.push((drive, vec![index])),
        }
    }
    // Largest drive first, each to the smaller side: as even as possible, and always the same.
    drives.sort_by_key(|(_, of_drive)| std::cmp::Reverse(of_drive.len()));
    let (mut learned, mut held_out) = (Vec::new(), Vec::new());
    for (_, of_drive) in drives {
        if learned.len() <= held_out.len() {
            learned.extend(of_drive)
        } else {
            held_out.extend(of_drive)
        }
    }
    let least = LEAST_SHARE * images.len() as f64;
    let even = learned.len().min(held_out.len()) as f64 >= least && !held_out.is_empty();
    learned.sort_unstable();
    held_out.sort_unstable();
    even.then_some(Division {
        learned,
        held_out,
        by_drive: true,
    })
}

/// Divides by the order along the recording: images of both cameras at one moment are on the same side.
fn by_parts<D: PartialEq>(images: &[(D, u64)]) -> Division {
    let mut drives: Vec<&D> = Vec::new();
    let mut at = Vec::with_capacity(images.len());
    for (drive, number) in images {
        let known = drives.iter().position(|d| *d == drive);
        let place = known.unwrap_or(drives.len());
        if known.is_none() {
            drives.push(drive);
        }
        at.push((place, *number));
    }
    let mut moments = at.clone();
    moments.sort_unstable();
    moments.dedup();
    let gap = match moments.len() {
        0..3 => 0,
        n => ((GAP * n as f64).round() as usize).max(1),
    };
    let first = (moments.len() - gap).div_ceil(2);
    let of = |range: &[(usize, u64)]| {
        let inside = |i: &usize| range.binary_search(&at[*i]).is_ok();
        (0..images.len()).filter(inside).collect()
    };
    Division {
        learned: of(&moments[..first]),
        held_out: of(&moments[first + gap..]),
        by_drive: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn images(drives: &[(&'static str, std::ops::Range<u64>)]) -> Vec<(&'static str, u64)> {
        let of = |(drive, numbers): &(&'static str, std::ops::Range<u64>)| {
            let drive = *drive;
            numbers.clone().map(move |n| (drive, n))
        };
        drives.iter().flat_map(of).collect()
    }

    #[test]
    fn several_drives_are_divided_by_drive() {
        let images = images(&[("a", 0..30), ("b", 0..50), ("c", 0..15)]);
        let division = divide(&images);
        assert!(division.by_drive);
        let drives = |part: &[usize]| -> std::collections::BTreeSet<&str> {
            part.iter().map(|i| images[*i].0).collect()
        };
        let (learned, held_out) = (drives(&division.learned), drives(&division.held_out));
        assert!(learned.is_disjoint(&held_out), "{learned:?} {held_out:?}");
        assert_eq!(division.learned.len() + division.held_out.len(), 95);
        assert_eq!((learned.len(), held_out.len()), (1, 2));
    }

    #[test]
    fn one_drive_is_divided_with_a_gap() {
        // Both cameras: camera 3 after camera 2.
        let images = images(&[("a", 0..40), ("a", 0..40)]);
        let Division {
            learned,
            held_out,
            by_drive,
        } = divide(&images);
        assert!(!by_drive);
        let numbers = |part: &[usize]| -> Vec<u64> { part.iter().map(|i| images[*i].1).collect() };
        let last = numbers(&learned).into_iter().max().unwrap();
        let first = numbers(&held_out).into_iter().min().unwrap();
        assert_eq!((last, first), (17, 22), "four of forty between them");
        assert_eq!((learned.len(), held_out.len()), (36, 36));
    }

    #[test]
    fn a_drive_too_small_to_test_on_is_not_held_out_alone() {
        let division = divide(&images(&[("a", 0..98), ("b", 0..2)]));
        assert!(!division.by_drive);
        assert!(division.held_out.len() > 40);
    }

    #[test]
    fn few_images_are_divided_as_far_as_possible() {
        for (n, sizes) in [
            (0, (0, 0)),
            (1, (1, 0)),
            (2, (1, 1)),
            (3, (1, 1)),
            (4, (2, 1)),
        ] {
            let division = divide(&images(&[("a", 0..n)]));
            let found = (division.learned.len(), division.held_out.len());
            assert_eq!(found, sizes, "{n} images");
        }
    }
}
