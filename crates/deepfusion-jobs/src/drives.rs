//! Finds out which recordings belong to one drive.

use std::collections::HashMap;

use deepfusion_data::Dataset;

/// For each recording, the index of the first recording of its drive: images of two cameras of a drive are not independent. The drives of a
/// folder of bags share the folder, and names of two videos may differ only in their extensions.
pub(crate) fn first_of_drive(datasets: &[Dataset]) -> Vec<usize> {
    let mut first = HashMap::new();
    let numbered = datasets.iter().enumerate();
    numbered
        .map(|(number, dataset)| {
            let drive = (dataset.place(), dataset.split_name());
            *first.entry(drive).or_insert(number)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_data::{DatasetParts, Frame, FrameImage, Recording, Result, RgbImage};
    use deepfusion_geometry::Intrinsics;
    use std::path::Path;
    use std::sync::Arc;

    /// A folder of videos.
    #[derive(Debug)]
    struct Videos;

    impl Recording for Videos {
        fn folder(&self) -> &Path {
            Path::new("/drives")
        }

        fn load_image(&self, _: &Frame) -> Result<RgbImage> {
            Ok(RgbImage::new(64, 48))
        }
    }

    fn video(file: &str) -> Dataset {
        let stem = file.split('.').next().unwrap();
        let frame = Frame {
            drive: stem.to_owned(),
            number: 0,
            time_s: Some(0.0),
            image: FrameImage::Within {
                file: Path::new("/drives").join(file),
                index: 0,
            },
            speed_mps: Some(8.0),
        };
        let camera = Intrinsics::from_numbers([60.0, 60.0, 32.0, 24.0], (64, 48));
        let parts = DatasetParts::of_frames(stem, vec![frame], camera);
        Dataset::new(parts, Arc::new(Videos))
    }

    #[test]
    fn videos_whose_names_differ_in_their_extensions_are_two_drives() {
        let videos = ["cam.mp4", "cam.mov", "cam.mp4"].map(video);
        assert_eq!(first_of_drive(&videos), [0, 1, 0]);
    }
}
