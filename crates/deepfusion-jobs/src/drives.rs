//! Which recordings are of one drive.

use std::collections::HashMap;

use deepfusion_data::Dataset;

/// For each recording the number of the first one of its drive: what two cameras of a drive see is not independent. The drives of a folder of bags
/// share the folder.
pub(crate) fn first_of_drive(datasets: &[Dataset]) -> Vec<usize> {
    let mut first = HashMap::new();
    let numbered = datasets.iter().enumerate();
    numbered
        .map(|(number, dataset)| {
            let drive = (dataset.folder(), dataset.split_name());
            *first.entry(drive).or_insert(number)
        })
        .collect()
}
