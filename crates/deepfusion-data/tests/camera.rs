//! The camera of a recording without a calibration: from a field of view, or from the photographs' EXIF.

use crate::common::{TinyDrive, folder, text_of};
use deepfusion_data::{Dataset, Error, OpenOptions, load_photo};
use deepfusion_hint::Hint;
use exif::experimental::Writer;
use exif::{Field, In, Rational, Tag, Value};
use image::{ImageFormat, Rgb, RgbImage};
use std::fs;
use std::io::Cursor;
use std::path::Path;

/// Size of the photographs: 4:3, with a diagonal of 80 pixels.
const SIZE: (u32, u32) = (64, 48);
/// Diagonal of 36 mm by 24 mm film.
const FILM_MM: f64 = 43.266_615_305_567_87;

fn short(tag: Tag, value: u16) -> Field {
    field(tag, Value::Short(vec![value]))
}

fn field(tag: Tag, value: Value) -> Field {
    Field {
        tag,
        ifd_num: In::PRIMARY,
        value,
    }
}

/// A phone's EXIF fields about its lens, without the 35 mm equivalent focal length.
fn phone(make: &str, model: &str, lens_um: u32) -> Vec<Field> {
    let text = |text: &str| Value::Ascii(vec![text.as_bytes().to_vec()]);
    let lens = Rational {
        num: lens_um,
        denom: 1000,
    };
    vec![
        field(Tag::Make, text(make)),
        field(Tag::Model, text(model)),
        field(Tag::FocalLength, Value::Rational(vec![lens])),
    ]
}

/// Writes a JPEG with an EXIF block of these fields.
fn write_photo(path: &Path, fields: &[Field]) {
    let mut block = Cursor::new(Vec::new());
    if !fields.is_empty() {
        let mut writer = Writer::new();
        fields.iter().for_each(|field| writer.push_field(field));
        writer.write(&mut block, true).unwrap();
    }
    write_photo_with(path, &block.into_inner());
}

/// Writes a JPEG with an EXIF block; an empty one is left out.
fn write_photo_with(path: &Path, block: &[u8]) {
    let mut plain = Vec::new();
    let image = RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| Rgb([x as u8, y as u8, 9]));
    image
        .write_to(&mut Cursor::new(&mut plain), ImageFormat::Jpeg)
        .unwrap();
    let mut bytes = plain[..2].to_vec();
    if !block.is_empty() {
        // APP1, its length including these two bytes, its name, the block.
        let length = u16::try_from(block.len() + 8).unwrap().to_be_bytes();
        bytes.extend([&[0xFF, 0xE1], &length[..], b"Exif\0\0", block].concat());
    }
    bytes.extend(&plain[2..]);
    fs::write(path, bytes).unwrap();
}

/// A folder of photographs with these EXIF blocks, ten per second, without a calibration.
fn photographs(folder: &Path, blocks: &[Vec<Field>]) {
    fs::create_dir_all(folder.join("images")).unwrap();
    for (n, fields) in blocks.iter().enumerate() {
        write_photo(&folder.join(format!("images/{n:03}.jpg")), fields);
    }
    fs::write(folder.join("dataset.toml"), "fps = 10\n").unwrap();
}

fn open(folder: &Path, options: &OpenOptions) -> Result<Dataset, Error> {
    Dataset::open(folder, options).map(|mut all| all.remove(0))
}

#[test]
fn a_field_of_view_gives_a_camera() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path();
    photographs(folder, &[vec![], vec![]]);
    let given = OpenOptions {
        hfov_deg: Some(60.0),
        ..OpenOptions::default()
    };
    // 32 / tan(30°).
    let focal = 32.0 * 3_f64.sqrt();
    let by_caller = open(folder, &given).unwrap().intrinsics(0);
    assert!((by_caller.fx - focal).abs() < 1e-9 && by_caller.fx == by_caller.fy);
    assert_eq!((by_caller.cx, by_caller.cy), (31.5, 23.5));
    fs::write(folder.join("dataset.toml"), "fps = 10\nhfov_deg = 60\n").unwrap();
    let by_file = open(folder, &OpenOptions::default()).unwrap();
    assert_eq!(by_file.intrinsics(0), by_caller);
    // The caller's options take precedence, and four numbers over an angle.
    let both = OpenOptions {
        intrinsics: Some([70.0, 70.0, 30.0, 20.0]),
        ..given
    };
    assert_eq!(open(folder, &both).unwrap().intrinsics(0).fx, 70.0);
}

/// A folder whose settings apply to its subfolders gives all their recordings, each with its own settings.
#[test]
fn all_recordings_of_a_folder_are_opened_with_for_folders() {
    let fleet = tempfile::tempdir().unwrap();
    for (drive, photos) in [("monday", 2), ("tuesday", 3)] {
        let blocks: Vec<Vec<Field>> = (0..photos).map(|_| vec![]).collect();
        photographs(&fleet.path().join(drive), &blocks);
    }
    fs::create_dir(fleet.path().join("notes")).unwrap();
    let opened = || Dataset::open(fleet.path(), &OpenOptions::default());
    let above = fleet.path().join("dataset.toml");
    let error = opened().unwrap_err();
    assert!(matches!(error, Error::FolderOfRecordings { .. }), "{error}");
    fs::write(
        &above,
        "for_folders = true\nintrinsics = [70, 70, 30, 20]\n",
    )
    .unwrap();
    let own = fleet.path().join("tuesday/dataset.toml");
    fs::write(&own, "intrinsics = [80, 80, 30, 20]\n").unwrap();
    let found: Vec<(usize, f64)> = opened()
        .unwrap()
        .iter()
        .map(|dataset| (dataset.frames().len(), dataset.intrinsics(0).fx))
        .collect();
    assert_eq!(found, [(2, 70.0), (3, 80.0)]);
    let seen = deepfusion_data::inspect(fleet.path()).unwrap();
    assert_eq!((seen.drives.len(), seen.frames), (2, 5));
    assert!(!Dataset::all_simulated_at(fleet.path()));
    // An invalid recording is not left out.
    fs::write(&own, "no TOML").unwrap();
    assert!(matches!(opened().unwrap_err(), Error::Config { .. }));
}

/// Settings for all folders of a fleet; a drive's own calibration takes precedence.
#[test]
fn one_camera_may_be_set_for_many_recordings() {
    let fleet = tempfile::tempdir().unwrap();
    let drive = fleet.path().join("drive");
    photographs(&drive, &[vec![], vec![]]);
    let above = "for_folders = true\nintrinsics = [70, 70, 30, 20]\n";
    fs::write(fleet.path().join("dataset.toml"), above).unwrap();
    let focal = || {
        let dataset = open(&drive, &OpenOptions::default()).unwrap();
        dataset.intrinsics(0).fx
    };
    assert_eq!(focal(), 70.0);
    fs::write(drive.join("intrinsics.txt"), "40 40 32 24\n").unwrap();
    assert_eq!(focal(), 40.0);
}

#[test]
fn invalid_fields_of_view_are_refused() {
    let root = tempfile::tempdir().unwrap();
    photographs(root.path(), &[vec![]]);
    for (toml, why) in [
        (
            "hfov_deg = 170",
            "hfov_deg is 170, expected more than 1 and less than 170 degrees",
        ),
        ("hfov_deg = 0", "hfov_deg is 0"),
        ("hfov_deg = nan", "hfov_deg is NaN"),
        ("hfov_deg = 60\nintrinsics = [60, 60, 32, 24]", "keep one"),
    ] {
        fs::write(root.path().join("dataset.toml"), toml).unwrap();
        let error = open(root.path(), &OpenOptions::default()).unwrap_err();
        assert!(error.to_string().contains(why), "{error}");
        assert!(error.hint().is_some());
    }
    fs::write(root.path().join("dataset.toml"), "").unwrap();
    let options = OpenOptions {
        hfov_deg: Some(200.0),
        ..OpenOptions::default()
    };
    let error = open(root.path(), &options).unwrap_err();
    assert!(matches!(error, Error::CameraFile { .. }), "{error}");
}

/// As written by piexif 1.1.3 for {FocalLengthIn35mmFilm: 21}: its last directory has no end.
#[test]
fn complete_fields_of_a_truncated_exif_block_are_read() {
    let block = b"MM\0*\0\0\0\x08\0\x01\x87\x69\0\x04\0\0\0\x01\0\0\0\x1a\0\0\0\0\0\x01\xa4\x05\0\x03\0\0\0\x01\0\x15\0\0";
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join("photo.jpg");
    write_photo_with(&path, block);
    let focal = load_photo(&path).unwrap().intrinsics.unwrap().fx;
    assert!((focal - 21.0 / FILM_MM * 80.0).abs() < 1e-6, "{focal}");
    // A block that is cut within a field is ignored.
    write_photo_with(&path, &block[..30]);
    assert_eq!(load_photo(&path).unwrap().intrinsics, None);
}

#[test]
fn photographs_give_their_camera() {
    let root = tempfile::tempdir().unwrap();
    let film = vec![short(Tag::FocalLengthIn35mmFilm, 26)];
    let turned = vec![
        short(Tag::FocalLengthIn35mmFilm, 26),
        short(Tag::Orientation, 6),
    ];
    for (name, block, film_mm, part) in [
        ("film", film, 26.0, "000.jpg: 26 mm in 35 mm film"),
        ("turned", turned, 26.0, "without the rotation in EXIF"),
        (
            "action camera",
            [
                phone("GoPro", "HERO8 Black", 3000),
                vec![short(Tag::FocalLengthIn35mmFilm, 15)],
            ]
            .concat(),
            15.0,
            "calibrate it as a fisheye lens",
        ),
        (
            "apple",
            phone("Apple", "iPhone 14 Pro", 6860),
            24.0,
            "the main camera of Apple iPhone 14 Pro, 24.0 mm",
        ),
        (
            "google",
            phone("Google", "Pixel 7", 6810),
            // 82° from corner to corner.
            FILM_MM / 2.0 / 41_f64.to_radians().tan(),
            "the main camera of Google Pixel 7, 24.9 mm",
        ),
    ] {
        let folder = root.path().join(name);
        photographs(&folder, &[block.clone(), block.clone(), block]);
        let dataset = open(&folder, &OpenOptions::default()).unwrap();
        let k = dataset.intrinsics(0);
        assert!(
            (k.fx - film_mm / FILM_MM * 80.0).abs() < 1e-6,
            "{name} {k:?}"
        );
        assert_eq!((k.fx, k.cx, k.cy), (k.fy, 31.5, 23.5));
        let warnings = text_of(dataset.warnings());
        let warning = warnings.lines().find(|r| r.contains("EXIF")).unwrap();
        assert!(warning.contains(part), "{warning}");
        assert_eq!(
            warning.contains("fisheye"),
            name == "action camera",
            "{warning}"
        );
        // A single image gives the same camera.
        let photo = load_photo(&folder.join("images/000.jpg")).unwrap();
        assert_eq!(photo.intrinsics.unwrap().fx, k.fx);
    }
}

#[test]
fn a_calibration_takes_precedence_over_exif() {
    let root = tempfile::tempdir().unwrap();
    photographs(root.path(), &[vec![short(Tag::FocalLengthIn35mmFilm, 26)]]);
    fs::write(root.path().join("intrinsics.txt"), "50 50 31 23").unwrap();
    let dataset = open(root.path(), &OpenOptions::default()).unwrap();
    assert_eq!(dataset.intrinsics(0).fx, 50.0);
}

#[test]
fn photographs_without_a_usable_focal_length_give_no_camera() {
    let root = tempfile::tempdir().unwrap();
    for (name, block) in [
        ("nothing", vec![]),
        // Its ultra-wide camera, whose field of view is not in the table.
        ("other-lens", phone("Apple", "iPhone 14 Pro", 2220)),
        ("unknown", phone("Nobody", "Telephone 1", 4200)),
        ("zoomed", {
            let mut block = phone("Apple", "iPhone 14 Pro", 6860);
            let twice = Rational { num: 2, denom: 1 };
            block.push(field(Tag::DigitalZoomRatio, Value::Rational(vec![twice])));
            block
        }),
    ] {
        let folder = root.path().join(name);
        photographs(&folder, &[block]);
        let error = open(&folder, &OpenOptions::default()).unwrap_err();
        assert!(
            matches!(error, Error::NoCameraFile { .. }),
            "{name}: {error}"
        );
        let hint = error.hint().unwrap();
        assert!(hint.contains("hfov_deg = ") && hint.len() < 250, "{hint}");
        let expected = format!("{name}: no calibration of its camera");
        assert!(error.to_string().ends_with(&expected), "{error}");
    }
    // Different zooms, or two phones, in one folder.
    let folder = root.path().join("mixed");
    let film = |mm| vec![short(Tag::FocalLengthIn35mmFilm, mm)];
    photographs(&folder, &[film(26), film(26), film(52)]);
    let error = open(&folder, &OpenOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("002.jpg: EXIF says 52 mm in 35 mm film, but 26 mm"),
        "{error}"
    );
}

#[test]
fn a_fisheye_calibration_is_undone() {
    let root = tempfile::tempdir().unwrap();
    photographs(root.path(), &[vec![]]);
    let camchain = "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.05, -0.02, 0.01, -0.003]\n  \
        distortion_model: equidistant\n  intrinsics: [40.0, 40.0, 32.0, 24.0]\n  resolution: [64, 48]\n";
    fs::write(root.path().join("camchain.yaml"), camchain).unwrap();
    let dataset = open(root.path(), &OpenOptions::default()).unwrap();
    // The left edge's middle is 32 pixels of 40 from the axis: 0.8 = θ(1 + 0.05θ² - 0.02θ⁴ + 0.01θ⁶ - 0.003θ⁸) at θ = 0.7806,
    // and the right one's 31 of 40, 0.775, at θ = 0.7571; a pinhole image from -tan to tan of them has 63 steps.
    let span = 0.7806_f64.tan() + 0.7571_f64.tan();
    let k = dataset.intrinsics(0);
    assert!((k.fx - 63.0 / span).abs() < 0.02, "{k:?}");
    assert_eq!(dataset.load_image(0).unwrap().dimensions(), SIZE);
}

#[test]
fn a_given_calibration_takes_precedence_over_those_found() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("drive");
    folder::write_drive(&folder, 3, 5.0, 0.0);
    fs::write(folder.join("dataset.toml"), "hfov_deg = 60\n").unwrap();
    let file = root.path().join("other.txt");
    fs::write(&file, "40 41 30 9\n").unwrap();
    let options = OpenOptions {
        calibration: Some(file),
        ..OpenOptions::default()
    };
    let k = Dataset::open(&folder, &options).unwrap()[0].intrinsics(0);
    assert_eq!([k.fx, k.fy, k.cx, k.cy], [40.0, 41.0, 30.0, 9.0]);
    // KITTI raw has its own calibration, and refuses another.
    let drive = TinyDrive::default().write(root.path());
    let refused = Dataset::open(&drive, &options).unwrap_err();
    assert!(matches!(refused, Error::OwnCalibration { .. }), "{refused}");
}
