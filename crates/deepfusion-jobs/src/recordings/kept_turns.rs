//! Keeps the turns measured in images in the user's cache folder: all images are read for them, which takes minutes for a long drive.
//!
//! Kept turns apply only to the values they were measured from: files of the same size and age, the same camera, mount and speeds, and the
//! same pixels in some images. If anything differs, they are measured again.

use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use deepfusion_data::{Dataset, SeenTurn};
use deepfusion_doctor::SEEN_TURNS_VERSION;
use sha2::{Digest, Sha256};

/// What a file begins with.
const MARK: &[u8] = b"deepfusion turns of images 1\n";
/// Turns measured in less time than this are not kept.
const WORTH_KEEPING: Duration = Duration::from_secs(10);
/// Number of images whose pixels are compared: pixels also change with the lens, whose file may be anywhere.
const COMPARED: usize = 3;

/// A SHA-256 checksum.
type Sum = [u8; 32];

/// The turns that a recording's images show ([`deepfusion_doctor::seen_turns`]), from a file in the cache folder if they were measured
/// before.
pub(super) fn seen_turns(dataset: &Dataset) -> Vec<SeenTurn> {
    match dirs::cache_dir() {
        Some(cache) => found_or_kept(dataset, &cache.join("deepfusion/turns"), WORTH_KEEPING),
        None => deepfusion_doctor::seen_turns(dataset).turns,
    }
}

/// As [`seen_turns`]. Turns that took at least `worth_keeping` are kept in the folder, if it can be written to and all images were read.
fn found_or_kept(dataset: &Dataset, folder: &Path, worth_keeping: Duration) -> Vec<SeenTurn> {
    let file = file_of(dataset, folder);
    // Taken before the images are read.
    let origin = origin_of(dataset);
    if let Some(turns) = origin.and_then(|origin| read(&file, &origin)) {
        return turns;
    }
    let begun = Instant::now();
    let found = deepfusion_doctor::seen_turns(dataset);
    if let Some(origin) = origin
        && found.unread == 0
        && begun.elapsed() >= worth_keeping
        && let Err(error) = keep(&file, &found.turns, &origin)
    {
        tracing::debug!("{}: {error}", file.display());
    }
    found.turns
}

fn keep(file: &Path, turns: &[SeenTurn], origin: &Sum) -> io::Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    deepfusion_fs::write(file, written(turns, origin))
}

/// The file for a recording's turns: one for each camera, before and after the camera is aimed. The intrinsics are part of its name, since
/// they distinguish two topics of a bag, whose turns would otherwise replace each other.
fn file_of(dataset: &Dataset, folder: &Path) -> PathBuf {
    let recording = format!(
        "{:?} {} {:?} {:?} {}",
        deepfusion_fs::absolute(dataset.place()),
        dataset.split_name(),
        dataset.camera(),
        dataset.intrinsics(0),
        dataset.mount_assumed()
    );
    folder.join(format!("{:x}", Sha256::digest(recording)))
}

/// A checksum of everything that the turns depend on; `None` if some of it cannot be read.
fn origin_of(dataset: &Dataset) -> Option<Sum> {
    let ego = dataset.ego().ok()?.level();
    let frames = dataset.frames();
    let mut values = format!(
        "{SEEN_TURNS_VERSION} {} {:?} {:?} {}",
        env!("CARGO_PKG_VERSION"),
        dataset.intrinsics(0),
        ego.cam_from_vehicle,
        ego.yaw_known()
    );
    let mut before = None;
    for frame in frames {
        let path = frame.image.path();
        if before != Some(path) {
            add_state(&mut values, path).ok()?;
            before = Some(path);
        }
        let _ = write!(values, "\n{:?} {:?}", frame.image, frame.time_s);
    }
    for pair in frames.windows(2) {
        let times = pair[0].time_s.zip(pair[1].time_s);
        let moved = times.and_then(|(from_s, to_s)| ego.vehicle_motion(from_s, to_s));
        let _ = write!(values, "\n{moved:?}");
    }
    let mut hash = Sha256::new_with_prefix(values);
    for index in (0..frames.len()).step_by(frames.len().div_ceil(COMPARED).max(1)) {
        hash.update(dataset.load_image(index).ok()?.as_raw());
    }
    Some(hash.finalize().into())
}

/// Adds a file's size and modification time; for a folder that is one recording, those of each file in it except hidden ones.
fn add_state(values: &mut String, path: &Path) -> io::Result<()> {
    let about = std::fs::metadata(path)?;
    if !about.is_dir() {
        let _ = write!(values, "\n{} {:?}", about.len(), about.modified()?);
        return Ok(());
    }
    let entries = std::fs::read_dir(path)?.collect::<io::Result<Vec<_>>>()?;
    let mut files: Vec<PathBuf> = entries.iter().map(std::fs::DirEntry::path).collect();
    files.sort();
    for file in files.iter().filter(|file| file.is_file()) {
        let name = file.file_name().unwrap_or_default();
        if !name.as_encoded_bytes().starts_with(b".") {
            let _ = write!(values, "\n{name:?}");
            add_state(values, file)?;
        }
    }
    Ok(())
}

/// The contents of a file with these turns: the mark, the origin, a checksum of the numbers, the numbers.
fn written(turns: &[SeenTurn], origin: &Sum) -> Vec<u8> {
    let numbers = |turn: &SeenTurn| {
        let [roll_rad, pitch_rad] = turn.tilt_rad;
        [turn.from_s, turn.to_s, turn.yaw_rad, roll_rad, pitch_rad]
    };
    let numbers = turns.iter().flat_map(numbers);
    let numbers: Vec<u8> = numbers.flat_map(f64::to_le_bytes).collect();
    let sum: Sum = Sha256::digest(&numbers).into();
    [MARK, origin.as_slice(), sum.as_slice(), numbers.as_slice()].concat()
}

/// The turns in a file, if it is complete and has this origin.
fn read(file: &Path, origin: &Sum) -> Option<Vec<SeenTurn>> {
    let bytes = std::fs::read(file).ok()?;
    let rest = bytes.strip_prefix(MARK)?.strip_prefix(origin.as_slice())?;
    let (sum, numbers) = rest.split_first_chunk::<32>()?;
    let found: Sum = Sha256::digest(numbers).into();
    if *sum != found {
        return None;
    }
    let (numbers, _) = numbers.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|n| f64::from_le_bytes(*n)).collect();
    let (turns, _) = numbers.as_chunks::<5>();
    let turn = |[from_s, to_s, yaw_rad, roll_rad, pitch_rad]: &[f64; 5]| SeenTurn {
        from_s: *from_s,
        to_s: *to_s,
        yaw_rad: *yaw_rad,
        tilt_rad: [*roll_rad, *pitch_rad],
    };
    Some(turns.iter().map(turn).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_data::{
        DatasetParts, Frame, FrameImage, Heading, OpenOptions, Recording, Result, RgbImage,
    };
    use deepfusion_geometry::Intrinsics;
    use deepfusion_sim::{SimConfig, Simulation, write_kitti};
    use std::fs;
    use std::ops::ControlFlow;
    use std::sync::Arc;

    /// A drive of nine images without measured roll and pitch.
    fn drive(at: &Path) -> PathBuf {
        let config = SimConfig {
            seed: 5,
            frames: 9,
            width: 320,
            height: 192,
            scan_every: 0,
            ..SimConfig::default()
        };
        let simulation = Simulation::new(&config).unwrap();
        let root = write_kitti(&simulation, at, &mut |_, _| ControlFlow::Continue(())).unwrap();
        let folder = opened(&root).folder().to_owned();
        let notes = "tilt_known = false\nmount_known = false\n";
        fs::write(folder.join("dataset.toml"), notes).unwrap();
        root
    }

    fn opened(root: &Path) -> Dataset {
        let options = OpenOptions::default();
        Dataset::open(root, &options).unwrap().remove(0)
    }

    /// Replaces the kept turns by others, which no image shows.
    fn put_others(dataset: &Dataset, cache: &Path) -> Vec<SeenTurn> {
        let other = SeenTurn {
            from_s: 0.1,
            to_s: 0.2,
            yaw_rad: 1.0 / 3.0,
            tilt_rad: [-0.0, 1e-300],
        };
        let origin = origin_of(dataset).unwrap();
        fs::write(file_of(dataset, cache), written(&[other], &origin)).unwrap();
        vec![other]
    }

    #[test]
    fn turns_are_measured_again_only_after_a_change() {
        let at = tempfile::tempdir().unwrap();
        let root = drive(at.path());
        let dataset = opened(&root);
        let cache = at.path().join("cache");
        let found = found_or_kept(&dataset, &cache, Duration::from_hours(1));
        assert!(!found.is_empty());
        let file = file_of(&dataset, &cache);
        assert!(!file.exists(), "turns that took no time are not kept");
        let kept = |dataset: &Dataset| found_or_kept(dataset, &cache, Duration::ZERO);
        assert_eq!(kept(&dataset), found);
        assert_eq!(
            read(&file, &origin_of(&dataset).unwrap()),
            Some(found.clone())
        );
        let others = put_others(&dataset, &cache);
        assert_eq!(kept(&dataset), others, "the images are not read again");
        assert_eq!(
            kept(&opened(&root)),
            others,
            "nor after opening the drive again"
        );

        // An image is written again; another speed, by its scale; another mount; a file that is truncated.
        let image = dataset.frames()[4].image.path();
        let bytes = fs::read(image).unwrap();
        fs::remove_file(image).unwrap();
        fs::write(image, [&bytes[..], b" "].concat()).unwrap();
        assert_eq!(kept(&dataset), found);
        put_others(&dataset, &cache);
        let notes = dataset.folder().join("dataset.toml");
        let text = fs::read_to_string(&notes).unwrap();
        fs::write(&notes, format!("{text}[vehicle]\nspeed_scale = 1.05\n")).unwrap();
        assert_ne!(kept(&opened(&root)), others);
        put_others(&dataset, &cache);
        let mut aimed = dataset.clone();
        aimed.aim(&Heading {
            off: nalgebra::Vector2::new(0.01, 0.0),
            std_error: nalgebra::Vector2::new(0.001, 0.001),
        });
        assert_ne!(kept(&aimed), others);
        assert_eq!(kept(&dataset), others, "each mount has its own");
        let whole = fs::read(&file).unwrap();
        fs::write(&file, &whole[..whole.len() - 1]).unwrap();
        assert_eq!(kept(&dataset), found);
    }

    #[test]
    fn two_topics_of_a_bag_have_a_file_each() {
        #[derive(Debug)]
        struct Bag;

        impl Recording for Bag {
            fn folder(&self) -> &Path {
                Path::new("/drives")
            }

            fn load_image(&self, _: &Frame) -> Result<RgbImage> {
                Ok(RgbImage::new(64, 48))
            }
        }

        let topic = |focal: f64| {
            let frame = Frame {
                drive: "town".into(),
                number: 0,
                time_s: Some(0.0),
                image: FrameImage::Within {
                    file: "/drives/town.bag".into(),
                    index: 0,
                },
                speed_mps: Some(8.0),
            };
            let camera = Intrinsics::from_numbers([focal, focal, 32.0, 24.0], (64, 48));
            let parts = DatasetParts::of_frames("town", vec![frame], camera);
            file_of(&Dataset::new(parts, Arc::new(Bag)), Path::new("cache"))
        };
        assert_eq!(topic(60.0), topic(60.0));
        assert_ne!(topic(60.0), topic(61.0));
    }

    /// An image that could not be read once may be readable the next time.
    #[test]
    fn turns_of_a_part_of_the_images_are_not_kept() {
        let at = tempfile::tempdir().unwrap();
        let dataset = opened(&drive(at.path()));
        fs::write(dataset.frames()[4].image.path(), "no image").unwrap();
        let cache = at.path().join("cache");
        let found = found_or_kept(&dataset, &cache, Duration::ZERO);
        assert!(!found.is_empty() && !cache.exists());
    }
}
