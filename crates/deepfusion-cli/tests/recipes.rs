//! The recipes for KITTI's tables start: two steps each, on a simulated drive, smaller than they say.

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
        // Larger images change nothing here.
        if name.ends_with("-1024x320") {
            continue;
        }
        // Nothing is held out: `best` beside `last` would double the gigabyte that the largest write.
        ok(
            at,
            &format!(
                "train --config {} --data sim --size 96x64 --batch 1 --steps 2 --init none --set validation_share=0 --out {name}",
                path.display()
            ),
        );
        let config = std::fs::read_to_string(at.join(&name).join("config.toml")).unwrap();
        assert!(config.contains("steps = 2"), "{config}");
        started += 1;
    }
    assert_eq!(started, 11);
}
