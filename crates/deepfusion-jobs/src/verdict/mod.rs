//! Judges a network's depth on drives with speeds, without ground truth.
//!
//! Frames that training did not see are taken in blocks along each drive ([`plan`]). Each is predicted and compared with frames before it
//! (`evidence_of_frame`): the motion of the scene determines depth in metres, the error of warping one frame to the other shows whether
//! depth and motion are consistent, and the mirrored image shows how much of the depth is random. [`verdict`] combines the results.

mod evidence;
mod page;
mod plan;
#[cfg(feature = "train")]
mod pose;
mod speeds;
mod warning;

use std::collections::HashSet;

use deepfusion_data::Dataset;
use deepfusion_eval::median;
use deepfusion_eval::verdict::{
    BlockScale, Evidence, NoCertificate, Reprojection, ScaleCertificate, Verdict, scale_rows,
    speed_rows,
};
use deepfusion_runtime::DepthEstimator;

pub use self::page::verdict_page;
pub use self::plan::{Block, Plan, Target, plan};
#[cfg(feature = "train")]
pub use self::pose::{metric_pose_net, pose_net_is_metric, pose_speeds, pose_speeds_of};
pub use self::warning::VerdictWarning;

use self::evidence::{FrameEvidence, evidence_of_frame};
use crate::Result;

/// The default standard error of a vehicle's speed, as a share of it: tyres wear and warm up, wheels slip, GPS is smoothed.
pub const SPEED_SD: f64 = 0.03;
/// Smallest number of scene points in a block that counts.
const LEAST_POINTS: usize = 40;

/// Options of a verdict.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct VerdictOptions {
    /// Standard error of the vehicle's speed, as a share of it.
    pub speed_sd: f64,
    /// Whether depth is corrected for a focal length other than the one trained with.
    pub focal_correction: bool,
    /// Largest number of blocks, over all drives.
    pub blocks: usize,
}

impl VerdictOptions {
    /// Options with the standard error of the speed as a share of it, with or without the focal correction; 40 blocks.
    #[must_use]
    pub fn new(speed_sd: f64, focal_correction: bool) -> Self {
        Self {
            speed_sd,
            focal_correction,
            blocks: 40,
        }
    }
}

impl Default for VerdictOptions {
    fn default() -> Self {
        Self::new(SPEED_SD, true)
    }
}

/// Which frames training has not seen.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unseen {
    /// None of the frames was seen.
    All,
    /// These were seen, given by data set and frame.
    Except(HashSet<(usize, usize)>),
    /// Unknown.
    NotKnown,
}

/// Judges a network on `datasets`. `progress` receives the number of frames done, and of all.
///
/// # Errors
/// An image that cannot be read; the error of the network's engine. If no verdict is possible, that is not an error: the verdict contains
/// the reason.
pub fn verdict(
    estimator: &mut DepthEstimator,
    datasets: &[Dataset],
    unseen: &Unseen,
    options: &VerdictOptions,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Verdict> {
    let plan = plan(datasets, unseen, options.blocks);
    let total = plan.frames();
    let certifying = plan.certifying(datasets);
    let mut gathered = GatheredEvidence::default();
    let mut done = 0;
    for block in &plan.blocks {
        let dataset = &datasets[block.dataset];
        let mut points = Vec::new();
        for (i, target) in block.targets.iter().enumerate() {
            // Measures that need further runs of the network are made once per block.
            let evidence =
                evidence_of_frame(estimator, dataset, target, i == 0, options.focal_correction)?;
            gathered.add(&evidence, target.speed_mps);
            points.extend(evidence.points);
            done += 1;
            progress(done, total);
        }
        gathered.close_block(points, certifying.contains(&block.dataset));
    }
    let mut verdict = gathered.verdict(&plan, unseen, total, options);
    verdict.without_truth.road_speeds = speeds::road_speeds(datasets, &plan)?;
    Ok(verdict)
}

/// The evidence so far, by block and in total.
#[derive(Default)]
struct GatheredEvidence {
    blocks: Vec<BlockScale>,
    points: Vec<(f64, f64)>,
    speeds: Vec<(f64, f64)>,
    warped: Vec<(f64, f64)>,
    consistency: Vec<f64>,
    flip: Vec<f64>,
}

impl GatheredEvidence {
    fn add(&mut self, evidence: &FrameEvidence, speed_mps: f64) {
        self.speeds
            .extend(evidence.log_way.map(|log| (speed_mps, log)));
        self.warped.extend(evidence.reprojection);
        self.consistency.extend(evidence.consistency);
        self.flip.extend(evidence.flip);
    }

    /// `points` are predicted depths with the logarithm of the factor that would correct them; `certifies` says whether the block counts
    /// for the certificate.
    fn close_block(&mut self, points: Vec<(f64, f64)>, certifies: bool) {
        if certifies
            && points.len() >= LEAST_POINTS
            && let Some(block) = block_scale(&points)
        {
            self.blocks.push(block);
        }
        self.points.extend(points);
    }

    fn verdict(
        self,
        plan: &Plan,
        unseen: &Unseen,
        frames: usize,
        options: &VerdictOptions,
    ) -> Verdict {
        let held_out = match unseen {
            Unseen::NotKnown => None,
            _ => Some(!plan.all_seen()),
        };
        let certificate = match unseen {
            Unseen::NotKnown => None,
            _ => ScaleCertificate::of(&self.blocks, options.speed_sd),
        };
        let no_certificate = certificate
            .is_none()
            .then_some(match (unseen, plan.nothing) {
                (_, Some(nothing)) => nothing,
                (Unseen::NotKnown, None) => NoCertificate::SeenNotKnown,
                (_, None) => NoCertificate::FewPoints,
            });
        let mean = |of: fn(&(f64, f64)) -> f64| {
            self.warped.iter().map(of).sum::<f64>() / self.warped.len() as f64
        };
        Verdict {
            scale_certificate: certificate,
            no_certificate,
            without_truth: Evidence {
                held_out,
                frames,
                reprojection: (!self.warped.is_empty()).then(|| Reprojection {
                    warped: mean(|w| w.0),
                    unwarped: mean(|w| w.1),
                    pairs: self.warped.len(),
                }),
                consistency: median(&self.consistency),
                flip: median(&self.flip),
                speeds: speed_rows(&self.speeds),
                road_speeds: Vec::new(),
                pose_speeds: Vec::new(),
                ranges: scale_rows(&self.points),
            },
        }
    }
}

/// The medians of a block's points: of all, and the nearer half's minus the farther half's.
fn block_scale(points: &[(f64, f64)]) -> Option<BlockScale> {
    let logs: Vec<f64> = points.iter().map(|p| p.1).collect();
    let mut by_depth = points.to_vec();
    by_depth.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (near, far) = by_depth.split_at(points.len() / 2);
    let middle = |half: &[(f64, f64)]| median(&half.iter().map(|p| p.1).collect::<Vec<_>>());
    Some(BlockScale {
        log_scale: median(&logs)?,
        near_less_far: middle(near)? - middle(far)?,
        points: points.len(),
    })
}
