//! The recipes in the repository are valid configurations.

use deepfusion_train::{Compute, TrainConfig};
use std::path::Path;

#[test]
fn every_recipe_is_a_configuration() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recipes");
    let mut count = 0;
    let entries = [folder.clone(), folder.join("kitti")].map(|f| std::fs::read_dir(f).unwrap());
    for entry in entries.into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            let [processor, gpu] = [Compute::Processor, Compute::Gpu]
                .map(|on| TrainConfig::read_over_preset(&path, on).unwrap());
            // A recipe gives the same configuration on every device.
            assert_eq!(processor, gpu, "{}", path.display());
            // The usual split files for KITTI list frames of both cameras.
            if path.parent().is_some_and(|at| at.ends_with("kitti")) {
                assert_eq!(processor.data.camera, "both", "{}", path.display());
            }
            count += 1;
        }
    }
    assert!(count > 14, "{count}");
}
