//! The order of names with numbers in them.

use std::cmp::Ordering;
use std::path::{Component, Path};

/// Orders paths as a person would: folder by folder, with the numbers in names compared by value, so that `frame_2.png` comes before
/// `frame_10.png`. Digits after a decimal point are a fraction: `0.15` comes before `0.2`. Names with equally long numbers are ordered by
/// their bytes, as are those that differ only in leading zeros.
#[must_use]
pub fn natural_order(a: &Path, b: &Path) -> Ordering {
    let (mut rest_a, mut rest_b) = (a.components(), b.components());
    loop {
        let order = match (rest_a.next(), rest_b.next()) {
            // `a//b` and `a/b` are one path; any others that reach this point differ only in leading zeros.
            (None, None) => return a.cmp(b),
            (None, Some(_)) => Ordering::Less,
            (Some(_), None) => Ordering::Greater,
            (Some(Component::Normal(a)), Some(Component::Normal(b))) => {
                of_names(a.as_encoded_bytes(), b.as_encoded_bytes())
            }
            (Some(a), Some(b)) => a.cmp(&b),
        };
        if order.is_ne() {
            return order;
        }
    }
}

/// Compares two names byte by byte, but numbers by value; equal if they differ only in leading zeros.
fn of_names(mut a: &[u8], mut b: &[u8]) -> Ordering {
    // What precedes the current position in both: a number, or a point after a number.
    let (mut number, mut point) = (false, false);
    loop {
        let (digits_a, digits_b) = (digits(a), digits(b));
        let (order, used) = if digits_a.is_empty() || digits_b.is_empty() {
            let order = if point && digits_a.is_empty() != digits_b.is_empty() {
                // `130.png` before `130.5.png`.
                digits_a.len().cmp(&digits_b.len())
            } else {
                a.first().cmp(&b.first())
            };
            (point, number) = (number && a.first() == Some(&b'.'), false);
            (order, (1, 1))
        } else {
            let order = if point {
                digits_a.cmp(digits_b)
            } else {
                of_numbers(digits_a, digits_b)
            };
            // A fraction is not followed by a decimal point.
            (number, point) = (!point, false);
            (order, (digits_a.len(), digits_b.len()))
        };
        if order.is_ne() {
            return order;
        }
        let (Some(after_a), Some(after_b)) = (a.get(used.0..), b.get(used.1..)) else {
            // Both have ended.
            return Ordering::Equal;
        };
        (a, b) = (after_a, after_b);
    }
}

/// The digits at the start of a name.
fn digits(name: &[u8]) -> &[u8] {
    let count = name.iter().take_while(|b| b.is_ascii_digit()).count();
    &name[..count]
}

/// Compares two whole numbers of any length, written in digits.
fn of_numbers(a: &[u8], b: &[u8]) -> Ordering {
    let (a, b) = (without_zeros(a), without_zeros(b));
    a.len().cmp(&b.len()).then_with(|| a.cmp(b))
}

fn without_zeros(digits: &[u8]) -> &[u8] {
    let zeros = digits.iter().take_while(|b| **b == b'0').count();
    &digits[zeros..]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn sorted(paths: &[&str]) -> Vec<PathBuf> {
        let mut paths: Vec<PathBuf> = paths.iter().map(PathBuf::from).collect();
        paths.sort_by(|a, b| natural_order(a, b));
        paths
    }

    #[test]
    fn numbers_are_compared_by_value() {
        for right in [
            &[
                "frame_1.png",
                "frame_2.png",
                "frame_10.png",
                "frame_100.png",
            ][..],
            &["frame_9999.png", "frame_10000.png"],
            &["cam0_9.png", "cam0_10.png", "cam1_1.png"],
            &["drive2/9.png", "drive2/10.png", "drive10/1.png"],
            // Longer than any integer.
            &[
                "99999999999999999999999.png",
                "100000000000000000000000.png",
            ],
            // Equal value: by bytes.
            &["02.png", "2.png", "3.png"],
            &["a.png", "a1.png", "a1b.png", "aa.png"],
        ] {
            let mut wrong = right.to_vec();
            wrong.reverse();
            let right: Vec<PathBuf> = right.iter().map(PathBuf::from).collect();
            assert_eq!(sorted(&wrong), right);
        }
    }

    #[test]
    fn digits_after_a_point_are_a_fraction() {
        let names = [
            "1305031102.png",
            "1305031102.1753.png",
            "1305031102.2.png",
            "1305031102.25.png",
            "1305031103.png",
        ];
        let mut wrong = names;
        wrong.reverse();
        assert_eq!(sorted(&wrong), names.map(PathBuf::from));
        // A point after letters is not a decimal point.
        let names = ["frame.9.png", "frame.10.png"];
        assert_eq!(
            sorted(&["frame.10.png", "frame.9.png"]),
            names.map(PathBuf::from)
        );
    }

    #[test]
    fn numbers_of_one_length_keep_the_order_of_paths() {
        let names = [
            "image_02/data/0000000010.png",
            "image_02/data/0000000002.jpg",
            "image_02/0000000002.png",
            "b-01_x.png",
            "b_01-x.png",
            "b/01.png",
            "b01/01.png",
            "B_02.png",
            "/b/07.png",
            "../b/07.png",
            "1403636579763555584.png",
            "1403636579813555456.png",
            "1305031102.175304.png",
            "",
        ];
        let mut right: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
        right.sort();
        assert_eq!(sorted(&names), right);
    }

    /// The order has no cycles, whatever the names.
    #[test]
    fn the_order_is_total() {
        let parts = ["", "0", "1", "01", "10", ".", "a", "-", "/"];
        let mut paths = Vec::new();
        for a in parts {
            for b in parts {
                for c in parts {
                    paths.push(PathBuf::from(format!("{a}{b}{c}")));
                }
            }
        }
        let mut sorted = paths.clone();
        sorted.sort_by(|a, b| natural_order(a, b));
        for (i, a) in sorted.iter().enumerate() {
            for b in &sorted[i..] {
                assert!(natural_order(a, b).is_le(), "{a:?} {b:?}");
                assert_eq!(natural_order(b, a), natural_order(a, b).reverse());
                assert_eq!(natural_order(a, b).is_eq(), a == b, "{a:?} {b:?}");
            }
        }
    }
}
