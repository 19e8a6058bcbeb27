//! The field's two protocols on the KITTI Eigen images.

use crate::{Crop, GroundTruth, Report};
use deepfusion_hint::count_of;

/// How the rows of published tables were measured, depths from 0.001 to 80 m.
struct Published {
    /// What the tables are called.
    tables: &'static str,
    images: usize,
    crop: Crop,
    gt: GroundTruth,
    /// Words added to the sentence about rows that were measured in the same way.
    and: &'static str,
}

const RECORDED: Published = Published {
    tables: "the published KITTI Eigen tables",
    images: 697,
    crop: Crop::Garg,
    gt: GroundTruth::Velodyne,
    and: " with ground truth as recorded",
};

/// Monodepth2's script crops only the split `eigen`. For this one it masks ground truth at 0 m only, so that depths beyond 80 m count.
const IMPROVED: Published = Published {
    tables: "the published KITTI Eigen tables with improved ground truth",
    images: 652,
    crop: Crop::None,
    gt: GroundTruth::Annotated,
    and: ", except that depths beyond 80 m count there",
};

/// A sentence that says whether a report's figures are comparable with the published tables.
pub(super) fn beside_published(report: &Report) -> String {
    let published = match report.protocol.gt {
        GroundTruth::Annotated => &IMPROVED,
        GroundTruth::Z | GroundTruth::Velodyne => &RECORDED,
    };
    match differences(report, published).as_slice() {
        [] => format!(
            "Protocol and number of images are those of {}{}.",
            published.tables, published.and
        ),
        differences => format!(
            "Not comparable with {}: {}.",
            published.tables,
            differences.join(", ")
        ),
    }
}

fn differences(report: &Report, published: &Published) -> Vec<String> {
    let p = &report.protocol;
    let mut differences = Vec::new();
    if report.n != published.images {
        differences.push(format!(
            "{} instead of {}",
            count_of(report.n, "image"),
            published.images
        ));
    }
    if p.crop != published.crop {
        differences.push(match published.crop {
            Crop::Garg => "no Garg crop".into(),
            Crop::None => "Garg's crop instead of the whole image".into(),
        });
    }
    if p.cap_m != 80.0 || p.min_m != 1e-3 {
        differences.push(format!(
            "{} to {} m instead of 0.001 to 80 m",
            p.min_m, p.cap_m
        ));
    }
    if p.gt != published.gt {
        differences.push(format!(
            "{} instead of {}",
            p.gt.meaning(),
            published.gt.meaning()
        ));
    }
    differences
}
