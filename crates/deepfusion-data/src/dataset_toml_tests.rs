use super::*;

fn read(text: &str) -> Result<FolderConfig> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(FolderConfig::NAME), text).unwrap();
    FolderConfig::read(folder.path())
}

#[test]
fn a_mount_sets_the_cameras_position() {
    let config = read("[mount]\nforward_m = 1.5\nup_m = 1.2\n").unwrap();
    // A stone 10 m ahead of the axle and 1 m to its left is 8.5 m ahead of the camera, to the left, 1.2 m below.
    let seen = config
        .cam_from_vehicle()
        .transform(&Vector3::new(10.0, 1.0, 0.0));
    assert!(
        (seen - Vector3::new(-1.0, 1.2, 8.5)).norm() < 1e-12,
        "{seen}"
    );
}

#[test]
fn mount_angles_have_the_documented_signs() {
    let ahead = |text: &str| {
        let config = read(&format!("[mount]\n{text} = 10\n")).unwrap();
        config
            .cam_from_vehicle()
            .transform(&Vector3::new(10.0, 0.0, 0.0))
    };
    // A point ahead of the vehicle appears further right if the camera looks left, higher if it looks
    // down, and in the same place if it rolls.
    assert!(ahead("yaw_deg").x > 1.0);
    assert!(ahead("pitch_deg").y < -1.0);
    assert!((ahead("roll_deg") - Vector3::new(0.0, 0.0, 10.0)).norm() < 1e-12);
    // If the camera rolls to the right, a point on the right moves up in the image.
    let config = read("[mount]\nroll_deg = 10\n").unwrap();
    assert!(
        config
            .cam_from_vehicle()
            .transform(&Vector3::new(10.0, -5.0, 0.0))
            .y
            < 0.0
    );
}

#[test]
fn errors_name_the_key() {
    for (text, problem) in [
        ("fsp = 10", "unknown field `fsp`"),
        ("fps = 0", "fps is 0, expected a number above 0"),
        ("fps = 'fast'", "fps"),
        ("intrinsics = [1, 2, 3]", "intrinsics"),
        ("start_s = nan", "start_s is NaN"),
        ("[mount]\nyaw_deg = nan", "mount.yaw_deg is NaN"),
        ("[mount]\nup_m = inf", "mount.up_m is inf"),
    ] {
        let error = read(text).unwrap_err().to_string();
        assert!(
            error.contains("dataset.toml") && error.contains(problem),
            "{error}"
        );
    }
    let config = read("speed = 'gone.csv'").unwrap();
    let error = config.find(Path::new("."), "speed", config.speed.as_ref(), &[]);
    assert!(
        error
            .unwrap_err()
            .to_string()
            .contains("gone.csv: no such file or folder")
    );
}

/// Reads the file of a drive, with another file in the folder above.
fn read_below(above: &str, own: &str) -> Result<FolderConfig> {
    let fleet = tempfile::tempdir().unwrap();
    let drive = fleet.path().join("drive");
    std::fs::create_dir(&drive).unwrap();
    std::fs::write(fleet.path().join(FolderConfig::NAME), above).unwrap();
    std::fs::write(drive.join(FolderConfig::NAME), own).unwrap();
    FolderConfig::read(&drive)
}

#[test]
fn missing_keys_come_from_the_folder_above() {
    let above = "for_folders = true\nfps = 20\nspeed_unit = 'km/h'\nstart_s = 5\nspeed = 'all.csv'\nhfov_deg = 69\n\
                 [mount]\nup_m = 1.2\n[vehicle]\nspeed_scale = 0.98\n";
    let config = read_below(above, "fps = 25\n").unwrap();
    assert_eq!(config.fps, Some(25.0), "its own value takes precedence");
    assert_eq!(config.speed_unit.as_deref(), Some("km/h"));
    assert_eq!(config.mount.map(|mount| mount.up_m), Some(1.2));
    assert_eq!(config.speed_scale(), 0.98);
    let of_one = (config.start_s, config.speed, config.hfov_deg);
    assert_eq!(
        of_one,
        (None, None, None),
        "keys of a single recording are not inherited"
    );
    assert_eq!(config.above.unwrap().hfov_deg, Some(69.0));
    // Tables are not merged.
    let config = read_below(above, "[mount]\nleft_m = 0.5\n").unwrap();
    assert_eq!(config.mount.map(|mount| mount.up_m), Some(0.0));
}

#[test]
fn a_file_above_without_for_folders_is_ignored() {
    for above in [
        "fps = 20\n",
        "yaw_known = false\n",
        "= no TOML\n",
        "format_folder = 'png'\n",
    ] {
        let config = read_below(above, "").unwrap();
        assert_eq!(
            (config.fps, config.above.is_some()),
            (None, false),
            "{above}"
        );
    }
    // A misspelled key is an error.
    for above in ["for_folder = true\n", "fps = 20\nFor-Folders = true\n"] {
        let error = read_below(above, "").unwrap_err().to_string();
        assert!(error.contains("unknown field"), "{error}");
    }
    // An error names the file for subfolders if it is there.
    let error = read_below("for_folders = true\nfps = 0\n", "").unwrap_err();
    let error = error.to_string();
    assert!(!error.contains("drive/dataset.toml"), "{error}");
    assert!(error.contains("dataset.toml: fps is 0"), "{error}");
}
