//! The doctor finds nothing in clean drives, and finds every fault that is planted into one.

use crate::doctor_faults::{Drive, oxts};
use deepfusion_data::OpenOptions;
use deepfusion_doctor::{
    Diagnosis, Finding, Outcome, Severity, camera_finding, doctor, turn_finding,
};
use deepfusion_sim::{BagSettings, Scene, Sensors, SimConfig, Simulation, write_bag, write_kitti};
use nalgebra::{Rotation3, Vector3};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Errors and warnings, without notes.
fn complaints(diagnosis: &Diagnosis) -> Vec<&Finding> {
    let found = diagnosis.findings().into_iter().map(|(_, finding)| finding);
    found.filter(|f| f.severity > Severity::Note).collect()
}

fn outcome<'a>(diagnosis: &'a Diagnosis, check: &str) -> &'a Outcome {
    let outcomes = &diagnosis.drives[0].outcomes;
    outcomes.iter().find(|o| o.check == check).unwrap()
}

/// The finding of a check with a figure for `quantity`.
fn found<'a>(diagnosis: &'a Diagnosis, check: &str, quantity: &str) -> &'a Finding {
    let fits = |f: &&Finding| {
        let figure = f.figure.as_ref();
        f.check == check && figure.is_some_and(|figure| figure.quantity.contains(quantity))
    };
    let all = complaints(diagnosis);
    all.iter().copied().find(fits).unwrap_or_else(|| {
        let other = outcome(diagnosis, check);
        panic!("no {check} ({quantity}) in {all:#?}, but {other:#?}")
    })
}

fn value(finding: &Finding) -> f64 {
    finding.figure.as_ref().unwrap().value
}

fn config(scene: Scene, frames: usize) -> SimConfig {
    SimConfig {
        frames,
        width: 320,
        height: 96,
        moving_cars: 3,
        scan_every: 20,
        scene,
        ..SimConfig::default()
    }
}

fn bag(folder: &Path, scene: Scene, frames: usize, settings: BagSettings) -> PathBuf {
    let config = SimConfig {
        frames,
        width: 240,
        height: 180,
        moving_cars: 3,
        scene,
        ..SimConfig::default()
    };
    bag_of(folder, &config, settings)
}

fn bag_of(folder: &Path, config: &SimConfig, settings: BagSettings) -> PathBuf {
    let config = SimConfig {
        fps: 25.0,
        sensors: Sensors::Umad,
        scan_every: 0,
        ..config.clone()
    };
    let simulation = Simulation::new(&config).unwrap();
    // A quarter of the sensor's columns: casting rays takes most of the time of writing a bag.
    let settings = BagSettings {
        true_depth: false,
        lidar_step_deg: 0.4,
        ..settings
    };
    write_bag(&simulation, &folder.join("bag"), &settings, &mut |_, _| {
        ControlFlow::Continue(())
    })
    .unwrap()
}

#[test]
fn every_scene_is_clean() {
    for scene in Scene::ALL {
        let folder = tempfile::tempdir().unwrap();
        let simulation = Simulation::new(&config(scene, 100)).unwrap();
        write_kitti(&simulation, &folder.path().join("kitti"), &mut |_, _| {
            ControlFlow::Continue(())
        })
        .unwrap();
        let diagnosis = doctor(&folder.path().join("kitti"), None);
        assert!(
            complaints(&diagnosis).is_empty(),
            "{scene:?}: {:#?}",
            complaints(&diagnosis)
        );
        // These checks were run, and not skipped.
        for check in [
            "timing",
            "duplicates",
            "intrinsics",
            "standing",
            "parallax",
            "exposure",
            "blur",
            "bonnet",
        ] {
            assert!(
                outcome(&diagnosis, check).skipped.is_none(),
                "{scene:?} {check}"
            );
        }
    }
}

#[test]
fn every_scene_is_clean_as_a_bag() {
    for scene in Scene::ALL {
        let folder = tempfile::tempdir().unwrap();
        let diagnosis = doctor(
            &bag(folder.path(), scene, 140, BagSettings::default()),
            None,
        );
        assert!(
            complaints(&diagnosis).is_empty(),
            "{scene:?}: {:#?}",
            complaints(&diagnosis)
        );
        // For this LiDAR the road begins 14 m ahead, too far to distinguish it from a slope, so the check "ground" may be skipped.
        for check in ["lidar-speed", "speed", "parallax"] {
            let outcome = outcome(&diagnosis, check);
            assert!(outcome.skipped.is_none(), "{scene:?} {outcome:?}");
        }
    }
}

/// In drives of four seconds, a LiDAR that looks ahead may see roofs and kerbs rather than the road, and the sky over houses may stand
/// still. Both once gave false warnings.
#[test]
fn short_drives_are_clean_as_bags() {
    for (scene, seed) in [
        (Scene::Commercial, 75),
        (Scene::Commercial, 77),
        (Scene::Garage, 71),
        (Scene::Urban, 74),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let config = SimConfig {
            frames: 100,
            width: 320,
            height: 240,
            moving_cars: 2,
            scene,
            seed,
            ..SimConfig::default()
        };
        let diagnosis = doctor(
            &bag_of(folder.path(), &config, BagSettings::default()),
            None,
        );
        let found = complaints(&diagnosis);
        assert!(found.is_empty(), "{scene:?} {seed}: {found:#?}");
    }
}

#[test]
fn kitti_is_clean() {
    let root = std::env::var_os("DEEPFUSION_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    for drive in ["0005", "0009"] {
        let path = root.join(format!(
            "kitti_raw/2011_09_26/2011_09_26_drive_{drive}_sync"
        ));
        if !path.is_dir() {
            eprintln!("skipped: no {}", path.display());
            continue;
        }
        let diagnosis = doctor(&path, None);
        assert!(
            complaints(&diagnosis).is_empty(),
            "{:#?}",
            complaints(&diagnosis)
        );
    }
}

#[test]
fn a_scaled_focal_length_is_measured_by_the_turns() {
    let drive = Drive::clean();
    drive.camera(|k| {
        k[0] *= 1.4;
        k[4] *= 1.4;
    });
    let diagnosis = drive.diagnose();
    let finding = found(
        &diagnosis,
        "turn",
        "turns in the picture over the vehicle's",
    );
    assert_eq!(finding.severity, Severity::Error);
    assert!((value(finding) - 1.0 / 1.4).abs() < 0.08, "{finding:?}");
    assert!(finding.hint.contains("fx and fy times 0."), "{finding:?}");
}

#[test]
fn intrinsics_of_another_image_size_are_named() {
    let drive = Drive::clean();
    // The images have 320x96 pixels. These intrinsics are for 640x192, but still lie in the image.
    drive.camera(|k| {
        for i in [0, 2, 4, 5] {
            k[i] *= 1.9;
        }
    });
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "intrinsics", "cx");
    assert_eq!(finding.severity, Severity::Error);
    assert!((value(finding) - 43.5).abs() < 2.0, "{finding:?}");
    assert!(
        finding.what.to_string().contains("images of about"),
        "{finding:?}"
    );
    assert!(finding.hint.contains("the images' own size"), "{finding:?}");
}

#[test]
fn the_road_reveals_speeds_in_kilometres_per_hour() {
    let drive = Drive::clean();
    drive.oxts(|_, values| {
        for i in [oxts::VF, oxts::VL, oxts::VN, oxts::VE] {
            values[i] *= 3.6;
        }
    });
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "speed", "camera height");
    assert_eq!(finding.severity, Severity::Error);
    assert!(
        (value(finding) / 1.65 / 3.6 - 1.0).abs() < 0.2,
        "{finding:?}"
    );
    assert!(finding.hint.contains("km/h"), "{finding:?}");
}

/// Without roll and pitch rates, eight seconds of bends do not determine the clock offset. The check is then skipped rather than guessing.
#[test]
fn an_uncertain_clock_offset_is_skipped() {
    let drive = Drive::clean();
    drive.camera_clock_ahead(0.3);
    let diagnosis = drive.diagnose();
    let skipped = outcome(&diagnosis, "clock").skipped.as_ref().unwrap();
    assert!(skipped.to_string().contains("standard error"), "{skipped}");
}

#[test]
fn mirrored_images_are_reported() {
    let drive = Drive::clean();
    drive.images(|_, image| image::imageops::flip_horizontal_in_place(image));
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "turn", "correlation");
    assert_eq!(finding.severity, Severity::Error);
    assert!(value(finding) < -0.8, "{finding:?}");
    assert!(finding.hint.contains("mirror"), "{finding:?}");
}

/// The checks that training runs by itself.
#[test]
fn a_wrong_camera_and_wrong_turns_are_found_before_training() {
    let drive = Drive::clean();
    let clean = drive.open();
    assert_eq!((camera_finding(&clean), turn_finding(&clean)), (None, None));
    drive.images(|_, image| image::imageops::flip_horizontal_in_place(image));
    let finding = turn_finding(&drive.open()).unwrap();
    assert_eq!(finding.severity, Severity::Error);
    assert!(finding.hint.contains("negate the yaw rate"), "{finding:?}");
    drive.camera(|k| {
        for i in [0, 2, 4, 5] {
            k[i] *= 0.5;
        }
    });
    let finding = camera_finding(&drive.open()).unwrap();
    assert_eq!(finding.severity, Severity::Error);
    assert!(finding.hint.contains("the images' own size"), "{finding:?}");
}

#[test]
fn a_pitched_camera_is_reported() {
    let drive = Drive::clean();
    drive.pitch_vehicle(3.0);
    let diagnosis = drive.diagnose();
    let heading = found(&diagnosis, "heading", "pitch");
    assert!((value(heading).abs() - 3.0).abs() < 0.7, "{heading:?}");
    assert!(
        heading.hint.contains("correct the camera's pitch"),
        "{heading:?}"
    );
    let ground = found(&diagnosis, "ground", "pitch");
    assert!((value(ground).abs() - 3.0).abs() < 0.7, "{ground:?}");
    assert!(ground.hint.contains("cam_from_vehicle"), "{ground:?}");
}

#[test]
fn blurred_frames_are_counted() {
    let drive = Drive::clean();
    drive.images(|i, image| {
        if i % 8 == 3 {
            *image = image::imageops::blur(image, 1.5);
        }
    });
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "blur", "blurred frames");
    assert!((value(finding) - 12.5).abs() < 3.0, "{finding:?}");
    assert!(finding.what.to_string().contains("frame 3"), "{finding:?}");
    assert!(finding.hint.contains("shorter exposure"), "{finding:?}");
}

#[test]
fn a_drive_out_of_focus_is_reported() {
    let drive = Drive::clean();
    drive.images(|_, image| *image = image::imageops::blur(image, 2.5));
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "blur", "sharpness");
    assert!(value(finding) < 0.06, "{finding:?}");
    assert!(finding.hint.contains("focus"), "{finding:?}");
}

#[test]
fn a_jumping_exposure_is_counted() {
    let drive = Drive::clean();
    drive.images(|i, image| {
        if i % 10 == 5 {
            image
                .iter_mut()
                .for_each(|v| *v = (f32::from(*v) * 1.5).min(255.0) as u8);
        }
    });
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "exposure", "jump");
    // Brighter and darker again: two jumps among ten pairs of frames.
    assert!((value(finding) - 20.0).abs() < 4.0, "{finding:?}");
    assert!(finding.what.to_string().contains("frame 5"), "{finding:?}");
    assert!(finding.hint.contains("exposure"), "{finding:?}");
}

#[test]
fn a_hood_is_measured_and_a_crop_proposed() {
    let drive = Drive::clean();
    drive.images(|_, image| {
        let (width, height) = image.dimensions();
        for x in 0..width {
            // An arc, 14 rows high in the middle.
            let aside = (f64::from(x) / f64::from(width) - 0.5).abs();
            let rows = (14.0 * (1.0 - 4.0 * aside * aside)) as u32;
            for y in height - rows..height {
                image.put_pixel(x, y, image::Rgb([20, 24, 60]));
            }
        }
    });
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "bonnet", "bottom");
    assert!(value(finding) > 50.0, "{finding:?}");
    assert!(finding.hint.contains("keep rows 0 to 8"), "{finding:?}");
    let what = finding.what.to_string();
    assert!(
        what.starts_with("14 ") || what.starts_with("15 "),
        "{finding:?}"
    );
}

#[test]
fn a_black_border_is_measured_and_a_crop_proposed() {
    let drive = Drive::clean();
    drive.images(|_, image| {
        let width = image.width();
        for (x, _, pixel) in image.enumerate_pixels_mut() {
            if x < 12 || x >= width - 12 {
                *pixel = image::Rgb([0; 3]);
            }
        }
    });
    let diagnosis = drive.diagnose();
    for (side, kept) in [
        ("left", "keep columns from 1"),
        ("right", "keep columns 0 to 30"),
    ] {
        let finding = found(&diagnosis, "bonnet", side);
        assert!(value(finding) > 50.0, "{finding:?}");
        assert!(finding.hint.contains(kept), "{finding:?}");
        // The edge itself may belong to either.
        let what = finding.what.to_string();
        let named = what.starts_with("12 ") || what.starts_with("13 ");
        assert!(named, "{finding:?}");
    }
}

#[test]
fn cameras_that_are_swapped_are_reported() {
    let drive = Drive::clean();
    drive.second_camera(-6);
    let right = drive.diagnose();
    let stereo = &right.recording[0];
    assert_eq!(stereo.check, "stereo");
    assert!(
        stereo.skipped.is_none() && stereo.findings.is_empty(),
        "{stereo:?}"
    );

    let drive = Drive::clean();
    drive.second_camera(6);
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "stereo", "disparity");
    assert_eq!(finding.severity, Severity::Error);
    assert!((value(finding) + 6.0).abs() < 0.5, "{finding:?}");
    assert!(finding.hint.contains("image_03"), "{finding:?}");
}

#[test]
fn frames_with_little_parallax_are_reported() {
    let drive = Drive::clean();
    // All objects are far away: from frame to frame the image grows by a fifth of a thousandth.
    let far = std::sync::Mutex::new(None);
    drive.images(|i, image| {
        let mut far = far.lock().unwrap();
        let far = far.get_or_insert_with(|| image.clone());
        let (cx, cy) = (0.5 * image.width() as f32, 0.5 * image.height() as f32);
        let scale = (-2e-4 * i as f32).exp();
        for (x, y, pixel) in image.enumerate_pixels_mut() {
            let [u, v] = [(x, cx), (y, cy)].map(|(at, c)| c + scale * (at as f32 - c));
            *pixel = image::imageops::interpolate_bilinear(far, u, v).unwrap_or(*pixel);
        }
    });
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "parallax", "parallax");
    assert!(value(finding) < 0.1, "{finding:?}");
    assert!(finding.hint.contains("frame_distance_m"), "{finding:?}");
}

#[test]
fn stretches_at_standstill_are_counted() {
    let drive = Drive::clean();
    drive.oxts(|i, values| {
        if i < 40 {
            values[oxts::VF] = 0.0;
            values[oxts::VL] = 0.0;
        }
    });
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "standing", "0.5 m/s");
    assert!((value(finding) - 39.0).abs() < 2.0, "{finding:?}");
    assert!(
        finding
            .hint
            .contains("cut out the parts where the vehicle stands"),
        "{finding:?}"
    );
}

#[test]
fn lost_and_repeated_frames_are_counted() {
    let drive = Drive::clean();
    drive.remove_images(&[20, 21, 50, 70]);
    drive.repeat_images(&[31, 62]);
    let diagnosis = drive.diagnose();
    let lost = found(&diagnosis, "timing", "lost");
    assert!((value(lost) - 4.0).abs() < 0.1, "{lost:?}");
    assert!(
        lost.what.to_string().contains("4 frames")
            && lost.what.to_string().contains("before frame 22"),
        "{lost:?}"
    );
    assert!(lost.hint.contains("recorder"), "{lost:?}");
    let repeated = found(&diagnosis, "duplicates", "repeated");
    assert_eq!(repeated.severity, Severity::Error);
    assert!(
        (value(repeated) - 100.0 * 2.0 / 92.0).abs() < 0.3,
        "{repeated:?}"
    );
    assert!(
        repeated.what.to_string().contains("frame 32")
            || repeated.what.to_string().contains("frame 31"),
        "{repeated:?}"
    );
    assert!(repeated.hint.contains("remove"), "{repeated:?}");
}

#[test]
fn a_damaged_image_is_named() {
    let drive = Drive::clean();
    drive.cut_image(17);
    let diagnosis = drive.diagnose();
    let all = complaints(&diagnosis);
    let finding = all.iter().find(|f| f.check == "opening").unwrap();
    assert_eq!(
        (finding.severity, finding.frame),
        (Severity::Error, Some(17))
    );
}

#[test]
fn files_beside_the_drives_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = Simulation::new(&config(Scene::Urban, 12)).unwrap();
    let root = folder.path().join("kitti");
    write_kitti(&simulation, &root, &mut |_, _| ControlFlow::Continue(())).unwrap();
    std::fs::write(root.join("drive.mp4"), "").unwrap();
    let diagnosis = doctor(&root, None);
    let all = diagnosis.findings();
    let (_, finding) = all
        .iter()
        .find(|(_, f)| f.what.to_string().contains("drive.mp4"))
        .unwrap();
    assert_eq!(
        (finding.check, finding.severity),
        ("opening", Severity::Note)
    );
    assert!(finding.hint.contains("their own paths"), "{finding:?}");
}

#[test]
fn a_recording_that_cannot_be_opened_is_a_finding() {
    let folder = tempfile::tempdir().unwrap();
    let diagnosis = doctor(folder.path(), None);
    assert_eq!(diagnosis.worst(), Some(Severity::Error));
    assert!(!diagnosis.findings()[0].1.hint.is_empty());
}

#[test]
fn a_bag_whose_camera_clock_is_off_is_reported() {
    for ahead_s in [0.3, -0.3] {
        let folder = tempfile::tempdir().unwrap();
        let settings = BagSettings {
            clock_offset_s: ahead_s,
            ..BagSettings::default()
        };
        let path = bag(folder.path(), Scene::Urban, 200, settings);
        let diagnosis = doctor(&path, None);
        let finding = found(&diagnosis, "clock", "offset");
        // `data inspect` shows the same estimate as a figure.
        let seen = deepfusion_doctor::inspect(&path, &OpenOptions::default()).unwrap();
        let offset = seen.drives[0].time_offset.unwrap();
        assert_eq!(offset.vehicle_minus_camera_s, value(finding));
        assert!(offset.std_error_s < 0.05, "{offset:?}");
        assert!(seen.to_string().contains("vehicle minus camera"), "{seen}");
        assert!((value(finding) + ahead_s).abs() < 0.010, "{finding:?}");
    }
}

#[test]
fn a_gap_in_the_speed_is_reported_with_its_frame() {
    let drive = Drive::clean();
    drive.remove_oxts(40..56);
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "timing", "time without a known motion");
    // From the last packet before the gap to the first after it, without the time at both ends for which a track is extrapolated.
    assert!((14.0..18.0).contains(&value(finding)), "{finding:?}");
    assert!(
        finding.what.to_string().contains("in 1 stretch,"),
        "{finding:?}"
    );
    assert!(
        finding.frame.is_some_and(|f| (39..=41).contains(&f)),
        "{finding:?}"
    );
}

/// A recorder without drops: its log ends before the images do.
#[test]
fn a_log_that_ends_early_is_distinguished_from_one_with_gaps() {
    let drive = Drive::clean();
    let images = drive.open().frames().len();
    drive.remove_oxts(images - 8..images);
    let diagnosis = drive.diagnose();
    let finding = found(&diagnosis, "timing", "time without a known motion");
    let message = finding.what.to_string();
    assert!(message.contains("before the last image"), "{message}");
    assert!(!message.contains("after the first"), "{message}");
    assert!(finding.hint.contains("start_s"), "{finding:?}");
}

#[test]
fn a_wrong_wheelbase_is_found_by_the_gyro() {
    let folder = tempfile::tempdir().unwrap();
    let config = SimConfig {
        frames: 300,
        // No image matters for this check.
        width: 96,
        height: 72,
        scene: Scene::Garage,
        ..SimConfig::default()
    };
    let path = bag_of(folder.path(), &config, BagSettings::default());
    let clean = doctor(&path, None);
    let measured = &outcome(&clean, "steering").measured;
    assert!((measured[0].value - 1.0).abs() < 0.02, "{measured:?}");
    let sidecar = path.with_extension("toml");
    let text = std::fs::read_to_string(&sidecar).unwrap();
    let wrong = text.replace("wheelbase_m = 2.7", "wheelbase_m = 4.1");
    assert_ne!(text, wrong);
    std::fs::write(&sidecar, wrong).unwrap();
    let diagnosis = doctor(&path, None);
    let finding = found(&diagnosis, "steering", "turns by the gyro");
    assert!((value(finding) - 4.1 / 2.7).abs() < 0.03, "{finding:?}");
    assert!(finding.hint.contains("wheelbase_m by 0.66"), "{finding:?}");
}

#[test]
fn radial_velocities_reveal_a_lidar_that_is_turned_or_pitched() {
    let folder = tempfile::tempdir().unwrap();
    let path = bag(folder.path(), Scene::Urban, 200, BagSettings::default());
    let sidecar = path.with_extension("toml");
    let text = std::fs::read_to_string(&sidecar).unwrap();
    // The rotation of cam_from_lidar, turned by 4 degrees about the camera's x (pitch) or y (yaw).
    let place = text.find("[cam_from_lidar]").unwrap();
    let begin = place + text[place..].find("rotation = [").unwrap() + "rotation = [".len();
    let end = begin + text[begin..].find(']').unwrap();
    let numbers: Vec<f64> = text[begin..end]
        .split(',')
        .map(|w| w.trim().parse().unwrap())
        .collect();
    let mount = Rotation3::from_scaled_axis(Vector3::from_row_slice(&numbers));
    for (axis, quantity) in [
        (Vector3::x(), "climbs by"),
        (Vector3::y(), "drifts to the left by"),
    ] {
        let turned = Rotation3::from_scaled_axis(axis * 4.0_f64.to_radians()) * mount;
        let [x, y, z]: [f64; 3] = turned.scaled_axis().into();
        let wrong = format!("{}{x}, {y}, {z}{}", &text[..begin], &text[end..]);
        std::fs::write(&sidecar, wrong).unwrap();
        let diagnosis = doctor(&path, None);
        let finding = found(&diagnosis, "lidar-speed", quantity);
        assert!((value(finding).abs() - 4.0).abs() < 0.5, "{finding:?}");
    }
}
