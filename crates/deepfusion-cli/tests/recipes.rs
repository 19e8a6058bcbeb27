//! The recipes for KITTI's tables start: two steps each, on a simulated drive, with smaller settings. The recipe of the embedded networks runs
//! to its end, with one step per stage.

use std::path::Path;

use crate::support::ok;

#[test]
fn each_row_of_kittis_tables_starts() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --frames 8 --seed 3 --scan-every 0 --size 192x64 --stereo 0.5",
    );
    let recipes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recipes/kitti");
    let mut started = 0;
    for entry in std::fs::read_dir(recipes).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        // Larger images would test nothing more.
        if name.ends_with("-1024x320") {
            continue;
        }
        // Nothing is held out, since writing `best` beside `last` would double the output. ResNets are narrower: gigabytes of checkpoints
        // would test nothing more.
        let is_resnet = name == "deepfusion" || name.starts_with("monodepth2");
        let narrower = if is_resnet {
            "--set depth_net.encoder.base_width=16 --set pose_net.encoder.base_width=8"
        } else {
            ""
        };
        ok(
            at,
            &format!(
                "train --config {} --data sim --size 96x64 --batch 1 --steps 2 --init none --set validation_share=0 {narrower} --out {name}",
                path.display()
            ),
        );
        let config = std::fs::read_to_string(at.join(&name).join("config.toml")).unwrap();
        assert!(config.contains("steps = 2"), "{config}");
        started += 1;
    }
    assert_eq!(started, 11);
}

/// A `deepfusion` for `recipes/street.sh`: few frames and views, narrow networks, one step. It appends its arguments to `log`. If there is
/// a file `stop`, it ends as after Ctrl-C once the second stage has made its step.
#[cfg(unix)]
const SMALLER: &str = r#"#!/usr/bin/env bash
set -euo pipefail
asked="$*"
printf '%s\n' "$asked" >>log
views='views = 4000, validation_views = 64, views_per_world = 24'
arguments=()
while [ $# -gt 0 ]; do
    case $1 in
        --config)
            name=$(basename "$2")
            sed "s/$views/views = 4, validation_views = 0, views_per_world = 4/" "$2" >"$name"
            grep -q 'views = 4,' "$name"
            arguments+=(--config "$name" --steps 1 --size 96x64 --batch 1)
            arguments+=(--set 'augmentation.sizes=[]' --set validation_share=0)
            arguments+=(--set depth_net.encoder.base_width=16 --set 'depth_net.decoder.widths=[16, 16, 16, 16, 16]')
            arguments+=(--set pose_net.encoder.base_width=8)
            shift
            ;;
        --frames)
            arguments+=(--frames 5 --size 192x64)
            shift
            ;;
        --images)
            arguments+=(--images 2)
            shift
            ;;
        *) arguments+=("$1") ;;
    esac
    shift
done
"$PROGRAM" "${arguments[@]}"
if [ -e stop ] && [[ $asked == *street-more.toml* ]]; then
    exit 130
fi
"#;

/// Drives in place of those of `KITTI` on which the cards' metrics are measured: the first with frames 0 and 20.
#[cfg(unix)]
fn write_kitti(at: &Path) {
    ok(
        at,
        "simulate --out kitti --frames 21 --seed 5 --scan-every 20 --size 192x64",
    );
    ok(
        at,
        "simulate --out other --frames 3 --seed 9 --scan-every 4 --size 192x64",
    );
    let simulated = |number: u32| format!("2026_01_01/2026_01_01_drive_000{number}_sync");
    let named = |number: u32| format!("kitti/2026_01_01/2011_09_26_drive_000{number}_sync");
    for (from, number) in [("kitti", 5), ("other", 9)] {
        let from = at.join(from).join(simulated(number));
        std::fs::rename(from, at.join(named(number))).unwrap();
    }
    std::fs::rename(at.join("kitti/2026_01_01"), at.join("kitti/2011_09_26")).unwrap();
}

/// The recipe of the embedded networks: stopped and continued, it writes both cards with all their entries; run again, it packs the same bytes.
#[test]
#[cfg(unix)]
fn the_embedded_networks_are_made_and_packed_reproducibly() {
    use std::fs;
    use std::os::unix::fs::PermissionsExt;
    use std::process::Command;

    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let program = at.join("smaller");
    fs::write(&program, SMALLER).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    write_kitti(at);
    crate::rgbd::write_folder(&at.join("rooms"));
    let has_int8 = deepfusion_infer::Engine::has_int8();
    let recipe = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recipes/street.sh");
    let run = || {
        let mut command = Command::new("bash");
        command.arg(&recipe).arg("out").current_dir(at);
        command.env("DEEPFUSION", &program);
        command.env("PROGRAM", env!("CARGO_BIN_EXE_deepfusion"));
        command.env("PRECISION", "f32");
        command.env("INT8", if has_int8 { "" } else { "none" });
        command.env("KITTI", "kitti").env("ROOMS", "rooms");
        let output = command.output().unwrap();
        let printed = String::from_utf8(output.stderr).unwrap();
        (output.status.code().unwrap(), printed)
    };
    let asked = |what: &str| {
        let log = fs::read_to_string(at.join("log")).unwrap();
        log.lines().filter(|line| line.starts_with(what)).count()
    };

    fs::write(at.join("stop"), "").unwrap();
    let (code, printed) = run();
    assert_eq!(code, 130, "{printed}");
    assert_eq!(asked("train --config"), 2);
    fs::remove_file(at.join("stop")).unwrap();
    let (code, printed) = run();
    assert_eq!(code, 0, "{printed}");
    // The unfinished stage is continued, and finished ones are not repeated.
    assert_eq!(asked("train --out out/street-more --resume"), 1);
    assert_eq!(asked("train --config"), 7);

    let names = ["street", "tiny"];
    let files = names.map(|name| ["safetensors", "toml"].map(|ending| format!("{name}.{ending}")));
    let packed = || {
        let read = |file: &String| fs::read(at.join("out/packed").join(file)).unwrap();
        files.as_flattened().iter().map(read).collect::<Vec<_>>()
    };
    let first = packed();
    for name in names {
        let card = fs::read_to_string(at.join(format!("out/packed/{name}.toml"))).unwrap();
        let card: toml::Table = card.parse().unwrap();
        let figures = card["figures"].as_array().unwrap().iter();
        let mut of: Vec<&str> = figures.map(|f| f["data"].as_str().unwrap()).collect();
        of.sort_unstable();
        let mut expected = vec![
            "2011_09_26_drive_0005_sync",
            "2011_09_26_drive_0009_sync",
            "301, 302, 303, 304, 305, 306",
            "41, 42, 43",
            "rooms",
        ];
        // The small one predicts no uncertainty, so there is nothing to calibrate.
        if name == "tiny" {
            expected.remove(2);
        }
        assert_eq!(of, expected, "{name}");
        assert_eq!(card.contains_key("uncertainty"), name == "street", "{name}");
        let images = card.get("int8").map(|ranges| &ranges["images"]);
        let looked_at = images.and_then(toml::Value::as_integer);
        assert_eq!(looked_at, has_int8.then_some(2), "{name}");
        assert_eq!(card["simulated_only"].as_bool(), Some(true), "{name}");
        assert!(card.contains_key("note"), "{name}");
    }

    fs::remove_file(at.join("log")).unwrap();
    let (code, printed) = run();
    assert_eq!(code, 0, "{printed}");
    assert_eq!(asked("train") + asked("simulate") + asked("eval"), 0);
    assert!(packed() == first, "the same runs give the same bytes");
}
