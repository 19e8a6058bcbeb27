//! Which files are images, by their names.

use std::path::Path;

/// Endings of the files that are taken for images, in small letters.
pub const IMAGE_ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

/// Whether a file is named like an image.
#[must_use]
pub fn is_image(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str());
    ending.is_some_and(|e| IMAGE_ENDINGS.contains(&e.to_ascii_lowercase().as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endings_of_either_case_are_known() {
        for (name, image) in [
            ("a/0.PNG", true),
            ("0.jpeg", true),
            ("0.png.json", false),
            ("png", false),
        ] {
            assert_eq!(is_image(Path::new(name)), image, "{name}");
        }
    }
}
