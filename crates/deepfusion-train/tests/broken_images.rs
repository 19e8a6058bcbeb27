//! A few images that cannot be read are left out; many are an error.

use crate::support::{drive, small_without_data};
use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_train::{Error, Learn, SampleSet, Skipped};
use std::fs;
use std::path::Path;

fn cut(drive: &Path, frame: usize) {
    let path = drive.join(format!("image_02/data/{frame:010}.png"));
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
}

#[test]
fn samples_of_broken_images_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive(&folder.path().join("street"), 12);
    let split = |learn: Learn| {
        let mut config = small_without_data(1);
        config.data.learn = learn;
        let datasets = Dataset::open(&drive, &OpenOptions::default()).unwrap();
        SampleSet::split(&config, datasets, None)
    };
    let shown = |set: &SampleSet| -> Vec<usize> {
        let samples = set.samples.iter();
        let frames = samples.flat_map(|s| {
            s.sources()
                .map(|(_, frame)| frame)
                .chain([s.snippet.target])
        });
        frames
            .chain(set.depth.frames.iter().map(|f| f.frame))
            .collect()
    };
    let (whole, _, skipped) = split(Learn::OwnMotion).unwrap();
    assert!(skipped.is_empty() && shown(&whole).contains(&4));

    cut(&drive, 4);
    for learn in [Learn::OwnMotion, Learn::Depth] {
        let (train, validation, skipped) = split(learn).unwrap();
        assert!(!train.is_empty() && !validation.is_empty());
        assert!(!shown(&train).contains(&4) && !shown(&validation).contains(&4));
        let [reason @ Skipped::BrokenImages { broken: 1, .. }] = skipped.as_slice() else {
            panic!("{skipped:?}");
        };
        let message = reason.to_string();
        assert!(
            message.contains("0000000004.png") && message.contains("truncated"),
            "{message}"
        );
    }

    (5..8).for_each(|frame| cut(&drive, frame));
    // To find what a run may have seen, images are not read.
    let datasets = Dataset::open(&drive, &OpenOptions::default()).unwrap();
    let recordings = datasets.into_iter().map(|dataset| (0, dataset)).collect();
    let mut config = small_without_data(1);
    config.data.learn = Learn::OwnMotion;
    let (unread, ..) = SampleSet::split_unread(&config, recordings, None).unwrap();
    assert_eq!(shown(&unread), shown(&whole));
    let error = split(Learn::OwnMotion).unwrap_err();
    assert!(
        matches!(error, Error::BrokenImages { broken: 4, .. }),
        "{error}"
    );
    assert!(error.to_string().contains("0000000004.png"), "{error}");
}
