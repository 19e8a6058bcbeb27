//! Finds the images that the arguments stand for, each with a name for its outputs.

use std::collections::{HashMap, HashSet};
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use deepfusion_data::{Dataset, DatasetKind, OpenOptions, has_settings};
use deepfusion_fs::{absolute, natural_order};
use deepfusion_images::is_image;
use deepfusion_video::is_video;

use crate::files::UniqueNames;
use crate::{Error, Result};

/// An image, and the name of its outputs.
#[derive(Debug, Clone)]
pub struct Input {
    /// Path of the image, or of the file that contains it.
    pub path: PathBuf,
    /// What the names of its outputs begin with.
    pub name: String,
    /// Its recording and the frame's index in it, if it is a frame.
    pub frame: Option<(Arc<Dataset>, usize)>,
}

impl PartialEq for Input {
    fn eq(&self, other: &Self) -> bool {
        (&self.path, &self.name) == (&other.path, &other.name)
    }
}

/// Extensions of ROS bags.
const BAGS: [&str; 3] = ["bag", "mcap", "db3"];

/// The images that files, folders, patterns and recordings stand for: first images in the natural order of their paths, each once, then the
/// frames of recordings in order. Order and names do not depend on the order of the arguments, so that separately started shards agree on
/// both.
///
/// A folder with images is a folder of images, except in three cases: a `dataset.toml` in it or above it applies to it, it has depth beside
/// colour, or it is a comma2k19 segment, which has a preview image beside the video. Any other folder that [`Dataset::open`] accepts is a
/// recording; `options` select its cameras. `opened` is called with the recordings.
///
/// # Errors
/// [`Error::NoImages`], an invalid pattern, and files that cannot be opened.
pub fn find_inputs(
    arguments: &[String],
    options: &OpenOptions,
    opened: impl FnOnce(&[Dataset]),
) -> Result<Vec<Input>> {
    let mut found = Vec::new();
    let mut recordings = Vec::new();
    for argument in arguments {
        let path = PathBuf::from(argument);
        if path.is_dir() {
            let entries =
                std::fs::read_dir(&path).map_err(|e| deepfusion_data::Error::file(&path, e))?;
            let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
            let images: Vec<_> = paths.filter(|p| is_image(p)).collect();
            if images.is_empty() || has_settings(&path) || has_other_pictures(&path) {
                recordings.extend(open(&path, argument, options)?);
            } else {
                found.extend(images);
            }
        } else if path.exists() && (is_bag(&path) || is_video(&path)) {
            recordings.extend(open(&path, argument, options)?);
        } else if path.exists() || !argument.contains(['*', '?', '[']) {
            // If one of several files is missing, opening it fails later.
            found.push(path);
        } else {
            let paths = glob::glob(argument)?.filter_map(Result::ok);
            found.extend(images_among(paths, argument)?);
        }
    }
    if let Some(path) = found.first()
        && recordings.is_empty()
        && !found.iter().any(|path| path.exists())
    {
        return Err(deepfusion_data::Error::file(path, ErrorKind::NotFound.into()).into());
    }
    let recordings = each_once(recordings);
    opened(&recordings);
    let mut inputs = named(found);
    let images: Vec<String> = inputs.iter().map(|i| i.name.to_lowercase()).collect();
    inputs.extend(frames_of(recordings, &images));
    Ok(inputs)
}

/// The first `most` inputs of each recording, and of the images that belong to none.
#[must_use]
pub fn first_of_each(mut inputs: Vec<Input>, most: usize) -> Vec<Input> {
    let mut seen: HashMap<Option<*const Dataset>, usize> = HashMap::new();
    inputs.retain(|input| {
        let recording = input.frame.as_ref().map(|(of, _)| Arc::as_ptr(of));
        let count = seen.entry(recording).or_default();
        *count += 1;
        *count <= most
    });
    inputs
}

/// Whether a folder has images other than its frames: colour beside depth, or the preview image of a comma2k19 segment.
fn has_other_pictures(folder: &Path) -> bool {
    let such = [DatasetKind::RgbD, DatasetKind::Comma2k19];
    // An error about the folder as a recording does not concern its images.
    Dataset::kind_at(folder).is_ok_and(|kind| such.contains(&kind))
}

/// Opens a recording; if the folder is not a recording, the error names the argument.
fn open(path: &Path, argument: &str, options: &OpenOptions) -> Result<Vec<Dataset>> {
    match Dataset::open(path, options) {
        Ok(datasets) => Ok(datasets),
        // A folder of ROS 2 bags has its own hint.
        Err(deepfusion_data::Error::UnknownLayout { found, .. })
            if path.is_dir() && !found.has_ros2_bags() =>
        {
            let input = argument.to_owned();
            Err(Error::NoImages { input })
        }
        Err(error) => Err(error.into()),
    }
}

/// Sorts recordings, and removes duplicates.
fn each_once(mut recordings: Vec<Dataset>) -> Vec<Dataset> {
    let first = |dataset: &Dataset| -> PathBuf {
        let frame = dataset.frames().first();
        frame.map_or_else(PathBuf::new, |frame| frame.image.path().to_owned())
    };
    recordings.sort_by(|a, b| {
        let names = (a.folder(), a.name()).cmp(&(b.folder(), b.name()));
        // Names of files side by side may differ only in their extensions.
        names.then_with(|| first(a).cmp(&first(b)))
    });
    let mut seen = HashSet::new();
    recordings.retain(|dataset| {
        let real = |path: &Path| std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let (folder, image) = (real(dataset.folder()), real(&first(dataset)));
        let number = dataset.frames().first().map(|frame| frame.number);
        let (name, camera) = (dataset.name().to_owned(), dataset.camera());
        seen.insert((folder, image, name, camera, number))
    });
    recordings
}

/// The selected frames of recordings. They are named by their numbers; if there are other inputs, the recording's name comes first. That
/// name gets a number if another recording has the same, or if its frames could be named like one of `images` (in lower case).
fn frames_of(recordings: Vec<Dataset>, images: &[String]) -> Vec<Input> {
    let alone = recordings.len() == 1 && images.is_empty();
    let mut names = UniqueNames::default();
    let mut inputs = Vec::new();
    for dataset in recordings {
        let dataset = Arc::new(dataset);
        let prefix = names.take_if(dataset.name(), |name| {
            let named_alike = |image: &String| {
                let rest = image
                    .strip_prefix(name)
                    .and_then(|rest| rest.strip_prefix('-'));
                rest.is_some_and(|rest| rest.bytes().take_while(u8::is_ascii_digit).count() >= 10)
            };
            !images.iter().any(named_alike)
        });
        for index in dataset.selected() {
            let frame = &dataset.frames()[*index];
            let name = if alone {
                format!("{:010}", frame.number)
            } else {
                format!("{prefix}-{:010}", frame.number)
            };
            inputs.push(Input {
                path: frame.image.path().to_owned(),
                name,
                frame: Some((dataset.clone(), *index)),
            });
        }
    }
    inputs
}

/// The images among the paths; if there are none, the error names the argument.
fn images_among(paths: impl Iterator<Item = PathBuf>, argument: &str) -> Result<Vec<PathBuf>> {
    let images: Vec<_> = paths.filter(|p| is_image(p)).collect();
    if images.is_empty() {
        let input = argument.to_owned();
        return Err(Error::NoImages { input });
    }
    Ok(images)
}

fn is_bag(path: &Path) -> bool {
    path.extension()
        .and_then(|e| e.to_str())
        .is_some_and(|e| BAGS.contains(&e.to_ascii_lowercase().as_str()))
}

/// Sorts the paths, removes duplicates, and names each after its file, with a number if two files have the same name.
fn named(paths: Vec<PathBuf>) -> Vec<Input> {
    let mut paths: Vec<PathBuf> = paths.iter().map(|p| without_dots(p)).collect();
    paths.sort_by(|a, b| natural_order(a, b));
    let mut seen = HashSet::new();
    paths.retain(|p| seen.insert(absolute(p)));
    let mut used = UniqueNames::default();
    let name = |path: &PathBuf| {
        let stem = path.file_stem();
        used.take(&stem.map_or("image".into(), |s| s.to_string_lossy()))
    };
    let names: Vec<String> = paths.iter().map(name).collect();
    let both = paths.into_iter().zip(names);
    both.map(|(path, name)| Input {
        path,
        name,
        frame: None,
    })
    .collect()
}

/// Removes `.` components: `./a/./b` becomes `a/b`.
fn without_dots(path: &Path) -> PathBuf {
    path.components()
        .filter(|c| *c != Component::CurDir)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn names(paths: &[&str]) -> Vec<String> {
        let inputs = named(paths.iter().map(PathBuf::from).collect());
        inputs.into_iter().map(|i| i.name).collect()
    }

    #[test]
    fn inputs_of_the_same_name_do_not_overwrite_each_other() {
        assert_eq!(names(&["a/0.png", "b/0.png", "b/1.jpg"]), ["0", "0-2", "1"]);
        // Also if the number produces another file's name.
        assert_eq!(
            names(&["a/0.png", "b/0.png", "c/0-2.png", "d/A.png", "e/a.png"]),
            ["0", "0-2", "0-2-2", "A", "a-2"]
        );
    }

    #[test]
    fn numbers_in_names_are_ordered_by_value() {
        let given = ["a/frame_10.png", "a/frame_1.png", "a/frame_2.png"];
        assert_eq!(names(&given), ["frame_1", "frame_2", "frame_10"]);
    }

    #[test]
    fn an_image_given_twice_counts_once() {
        let absolute = std::path::absolute("a/0.png").unwrap();
        let twice = ["./a/0.png", "a/0.png", absolute.to_str().unwrap()];
        assert_eq!(names(&twice), ["0"]);
    }

    /// A folder with one frame and its tables.
    fn write_drive(folder: &Path) {
        let images = folder.join("images");
        std::fs::create_dir_all(&images).unwrap();
        let image = image::RgbImage::from_pixel(64, 32, image::Rgb([90, 120, 60]));
        image.save(images.join("0.png")).unwrap();
        std::fs::write(folder.join("frames.csv"), "time_s,file\n0.5,0.png\n").unwrap();
        std::fs::write(folder.join("intrinsics.txt"), "40 40 32 16\n").unwrap();
    }

    #[test]
    fn recordings_of_the_same_name_do_not_overwrite_each_other() {
        let root = tempfile::tempdir().unwrap();
        let drive = |name: &str| {
            let folder = root.path().join(name);
            write_drive(&folder);
            folder.display().to_string()
        };
        let (monday, tuesday) = (drive("monday/drive"), drive("tuesday/Drive"));
        let names = |of: &[&String]| -> Vec<String> {
            let arguments: Vec<String> = of.iter().map(|of| (*of).clone()).collect();
            let inputs = find_inputs(&arguments, &OpenOptions::default(), |_| ()).unwrap();
            inputs.into_iter().map(|input| input.name).collect()
        };
        let both = ["drive-0000000000", "Drive-2-0000000000"];
        assert_eq!(names(&[&monday, &tuesday]), both);
        assert_eq!(names(&[&tuesday, &monday]), both);
        // A recording given twice counts once.
        assert_eq!(names(&[&monday, &monday]), ["0000000000"]);
        // An image may have the name of a frame, or only begin like one.
        let beside = root.path().join("drive-front.png");
        std::fs::copy(root.path().join("monday/drive/images/0.png"), &beside).unwrap();
        assert_eq!(
            names(&[&beside.display().to_string(), &monday]),
            ["drive-front", "drive-0000000000"]
        );
        let image = root.path().join("drive-0000000000.png");
        std::fs::copy(root.path().join("monday/drive/images/0.png"), &image).unwrap();
        assert_eq!(
            names(&[&image.display().to_string(), &monday]),
            ["drive-0000000000", "drive-2-0000000000"]
        );
    }

    /// A `dataset.toml` for several folders applies here as in training: otherwise the same drive would have other metres.
    #[test]
    fn a_folder_with_settings_above_it_is_a_recording() {
        let root = tempfile::tempdir().unwrap();
        let drive = root.path().join("drive");
        std::fs::create_dir(&drive).unwrap();
        let image = image::RgbImage::from_pixel(64, 32, image::Rgb([90, 120, 60]));
        image.save(drive.join("frame_1.png")).unwrap();
        let is_recording = || {
            let arguments = [drive.display().to_string()];
            let inputs = find_inputs(&arguments, &OpenOptions::default(), |_| ()).unwrap();
            assert_eq!(inputs.len(), 1);
            inputs[0].frame.is_some()
        };
        assert!(!is_recording());
        let settings = "for_folders = true\nfps = 10\nintrinsics = [40.0, 40.0, 32.0, 16.0]\n";
        std::fs::write(root.path().join("dataset.toml"), settings).unwrap();
        assert!(is_recording());
    }

    /// A comma2k19 segment has a preview image beside its video.
    #[test]
    fn a_picture_beside_a_recording_is_not_an_input() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        std::fs::write(at.join("preview.png"), []).unwrap();
        let found = || find_inputs(&[at.display().to_string()], &OpenOptions::default(), |_| ());
        // Calibration and times as in an odometry sequence do not turn the folder into another recording.
        for name in ["calib.txt", "times.txt"] {
            std::fs::write(at.join(name), []).unwrap();
        }
        assert_eq!(found().unwrap().len(), 1, "a folder of images");
        for name in ["calib.txt", "times.txt"] {
            std::fs::remove_file(at.join(name)).unwrap();
        }
        std::fs::create_dir(at.join("global_pose")).unwrap();
        std::fs::write(at.join("global_pose/frame_times"), []).unwrap();
        let error = found().unwrap_err().to_string();
        assert!(error.contains("video.hevc"), "{error}");
    }

    #[test]
    fn a_pattern_without_images_is_an_error() {
        let error =
            find_inputs(&["/nowhere/*.png".into()], &OpenOptions::default(), |_| ()).unwrap_err();
        assert!(error.to_string().contains("/nowhere/*.png"), "{error}");
    }

    proptest! {
        #[test]
        fn names_are_unique_and_independent_of_the_order(
            mut paths in proptest::collection::vec("[ab]/[aA0](-[23])?\\.(png|jpg)", 1..30),
            turn in 0usize..30,
        ) {
            let inputs = |p: &[String]| named(p.iter().map(PathBuf::from).collect());
            let first = inputs(&paths);
            let unique: HashSet<_> = first.iter().map(|i| i.name.to_lowercase()).collect();
            prop_assert_eq!(unique.len(), first.len());
            let places = paths.len();
            paths.rotate_left(turn % places);
            paths.reverse();
            prop_assert_eq!(inputs(&paths), first);
        }
    }
}
