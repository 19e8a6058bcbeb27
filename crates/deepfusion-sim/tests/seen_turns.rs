//! The turns of the vehicle estimated from its images, compared with the true ones.

use std::ops::ControlFlow;
use std::path::Path;

use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_doctor::{Severity, doctor, seen_turns};
use deepfusion_sim::{Scene, SimConfig, Simulation, write_kitti};

/// A drive of 60 frames with traffic, whose OXTS records every turn.
fn drive(folder: &Path, scene: Scene) -> Dataset {
    let simulation = Simulation::new(&SimConfig {
        seed: 7,
        frames: 60,
        width: 320,
        height: 96,
        moving_cars: 3,
        scan_every: 0,
        scene,
        ..SimConfig::default()
    })
    .unwrap();
    let drive = write_kitti(&simulation, folder, &mut |_, _| ControlFlow::Continue(())).unwrap();
    Dataset::open(&drive, &OpenOptions::default())
        .unwrap()
        .remove(0)
}

/// Root mean square, in degrees.
fn rms(values: &[f64]) -> f64 {
    let squares: f64 = values.iter().map(|v| v.powi(2)).sum();
    (squares / values.len() as f64).sqrt().to_degrees()
}

/// The same drive as a folder of images with a table of speeds.
fn with_speed_alone(drive: &Dataset, folder: &Path) -> Dataset {
    let images = folder.join("images");
    std::fs::rename(drive.folder().join("image_02/data"), &images).unwrap();
    let times: Vec<f64> = drive.frames().iter().map(|f| f.time_s.unwrap()).collect();
    let mut frames = String::from("time_s,file\n");
    let mut speeds = String::from("time_s,speed_mps\n");
    let track = drive.track().unwrap();
    for (frame, time_s) in drive.frames().iter().zip(&times) {
        let file = frame.image.path().file_name().unwrap().to_string_lossy();
        frames += &format!("{time_s:.6},{file}\n");
        speeds += &format!("{time_s:.6},{}\n", track.speed_at(*time_s).unwrap());
    }
    let k = drive.intrinsics(0);
    let numbers = format!("{} {} {} {}", k.fx, k.fy, k.cx, k.cy);
    for (file, text) in [
        ("frames.csv", frames),
        ("speed.csv", speeds),
        ("intrinsics.txt", numbers),
    ] {
        std::fs::write(folder.join(file), text).unwrap();
    }
    Dataset::open(folder, &OpenOptions::default())
        .unwrap()
        .remove(0)
}

/// In every scene, images determine roll and pitch to a fraction of their size, and without a yaw rate also the yaw.
#[test]
fn images_show_how_the_vehicle_turned() {
    for scene in Scene::ALL {
        let at = tempfile::tempdir().unwrap();
        let truth = drive(&at.path().join("kitti"), scene);
        let folder = at.path().join("folder");
        std::fs::create_dir(&folder).unwrap();
        let with_yaw = seen_turns(&truth).turns;
        let mut alone = with_speed_alone(&truth, &folder);
        assert!(alone.tilt_unknown() && !alone.yaw_known() && !truth.tilt_unknown());
        let without_yaw = seen_turns(&alone).turns;
        for (turns, yaw_known) in [(&with_yaw, true), (&without_yaw, false)] {
            assert_eq!(turns.len(), 59, "{scene:?}");
            let ego = truth.ego().unwrap();
            let (mut real, mut off) = (Vec::new(), Vec::new());
            let mut yaw_off = Vec::new();
            for turn in turns {
                let known = ego.vehicle_motion(turn.from_s, turn.to_s).unwrap();
                real.extend(known.tilt_rad);
                off.extend([0, 1].map(|axis| turn.tilt_rad[axis] - known.tilt_rad[axis]));
                yaw_off.push(turn.yaw_rad - known.yaw_rad);
            }
            let (real, off, yaw_off) = (rms(&real), rms(&off), rms(&yaw_off));
            println!(
                "{scene:?}, yaw known {yaw_known}: tilt {real:.3}, off {off:.3}; yaw off {yaw_off:.3} degrees"
            );
            assert!(off < 0.6 * real, "{scene:?} {yaw_known}: {off} of {real}");
            assert!(yaw_off < 0.06, "{scene:?} {yaw_known}: {yaw_off}");
        }
        // With these turns, the camera's motion between images is the true one.
        alone.take_turns(&without_yaw);
        assert!(alone.yaw_known() && !alone.tilt_unknown());
        let messages: Vec<String> = alone.warnings().iter().map(ToString::to_string).collect();
        let messages = messages.join("\n");
        assert!(
            messages.contains("estimating them from the images")
                && !messages.contains("no yaw rate"),
            "{messages}"
        );
        let turned_off: Vec<f64> = (1..60)
            .map(|i| {
                let [seen, known] = [&alone, &truth].map(|drive| {
                    let motion = drive.ego().unwrap().between(drive.frames(), i, i - 1);
                    motion.unwrap().source_from_target.unwrap()
                });
                (seen * known.inverse()).angle()
            })
            .collect();
        assert!(rms(&turned_off) < 0.07, "{scene:?}: {}", rms(&turned_off));
    }
}

/// If a third of the images show nothing, too few turns are found, and the drive does not change.
#[test]
fn too_few_turns_leave_the_drive_unchanged() {
    let at = tempfile::tempdir().unwrap();
    let truth = drive(&at.path().join("kitti"), Scene::Urban);
    let folder = at.path().join("folder");
    std::fs::create_dir(&folder).unwrap();
    let mut alone = with_speed_alone(&truth, &folder);
    let grey = image::RgbImage::from_pixel(320, 96, image::Rgb([90; 3]));
    // A third of the images are grey, and one cannot be read.
    for (i, frame) in alone.frames().iter().enumerate() {
        match i {
            7 => std::fs::write(frame.image.path(), "no image").unwrap(),
            _ if i % 3 == 0 => grey.save(frame.image.path()).unwrap(),
            _ => {}
        }
    }
    let found = seen_turns(&alone);
    assert_eq!(found.unread, 1);
    let turns = found.turns;
    assert!(!turns.is_empty() && turns.len() < 25, "{}", turns.len());
    alone.take_turns(&turns);
    assert!(!alone.yaw_known() && alone.tilt_unknown());
}

/// A speed without a yaw rate, as from GPS and OBD: the images show the turns, and then the road reveals a wrong unit.
#[test]
fn a_wrong_unit_is_found_without_a_yaw_rate() {
    let at = tempfile::tempdir().unwrap();
    let truth = drive(&at.path().join("kitti"), Scene::Urban);
    let folder = at.path().join("folder");
    std::fs::create_dir(&folder).unwrap();
    let alone = with_speed_alone(&truth, &folder);
    assert!(!alone.yaw_known());
    let found = |severity| {
        let diagnosis = doctor(&folder, None);
        let found = diagnosis.findings().into_iter();
        let of_speed = found.filter(|(_, f)| f.check == "speed" && f.severity >= severity);
        of_speed.map(|(_, f)| f.hint.clone()).collect::<Vec<_>>()
    };
    assert_eq!(found(Severity::Note), Vec::<String>::new());
    let file = folder.join("speed.csv");
    let speeds = std::fs::read_to_string(&file).unwrap();
    let in_kmh = speeds.lines().map(|line| {
        let (time, speed) = line.split_once(',').unwrap();
        let speed = speed.parse::<f64>();
        speed.map_or(format!("{line}\n"), |mps| format!("{time},{}\n", 3.6 * mps))
    });
    std::fs::write(&file, in_kmh.collect::<String>()).unwrap();
    let hints = found(Severity::Error);
    assert!(
        matches!(&hints[..], [hint] if hint.contains("km/h")),
        "{hints:?}"
    );
    // If the images show nothing, a note says that the unit was not checked.
    let grey = image::RgbImage::from_pixel(320, 96, image::Rgb([90; 3]));
    for frame in alone.frames() {
        grey.save(frame.image.path()).unwrap();
    }
    let diagnosis = doctor(&folder, None);
    let found = diagnosis.findings();
    let note = found.iter().find(|(_, f)| f.check == "speed").unwrap().1;
    assert_eq!(note.severity, Severity::Note);
    assert!(note.what.to_string().contains("km/h"), "{note:?}");
}

/// A part of a drive has the images and the motion of its own frames only.
#[test]
fn a_part_of_a_drive_has_the_data_of_its_frames() {
    let at = tempfile::tempdir().unwrap();
    let whole = drive(at.path(), Scene::Urban);
    let part = whole.with_frames(10..20);
    assert_eq!(part.frames(), &whole.frames()[10..20]);
    assert_eq!(part.selected(), (0..10).collect::<Vec<_>>());
    assert_eq!(part.load_image(3).unwrap(), whole.load_image(13).unwrap());
    assert_eq!(part.camera_motion(2, 3), whole.camera_motion(12, 13));
}
