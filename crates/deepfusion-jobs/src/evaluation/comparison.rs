//! Compares a method with the mean-depth baseline on the same images.

use std::collections::BTreeMap;

use deepfusion_eval::{
    Evaluator, MeanDepthBaseline, Prediction, Protocol, Report, Sample, ScenarioRow,
};

use super::{Evaluated, ImageRef};
use crate::Result;

/// Evaluates a method and the mean-depth baseline on the same images.
pub struct Comparison {
    method: Evaluator,
    mean_depth_baseline: Option<(Evaluator, MeanDepthBaseline)>,
    /// By kind of drive, for recordings that have one.
    scenarios: BTreeMap<String, Evaluator>,
    protocol: Protocol,
}

impl Comparison {
    /// A comparison without images yet. A baseline without scans gives no mean-depth baseline.
    ///
    /// # Errors
    /// A protocol that cannot measure anything.
    pub fn new(protocol: &Protocol, baseline: Option<MeanDepthBaseline>) -> Result<Self> {
        let baseline = baseline.filter(|b| b.scans() > 0);
        Ok(Self {
            method: Evaluator::new(protocol.clone())?,
            mean_depth_baseline: match baseline {
                Some(baseline) => Some((Evaluator::new(protocol.clone())?, baseline)),
                None => None,
            },
            scenarios: BTreeMap::new(),
            protocol: protocol.clone(),
        })
    }

    /// Adds one image; returns whether it had a pixel to compare.
    ///
    /// # Errors
    /// An invalid prediction, or one whose shape differs from the ground truth's.
    pub fn add(&mut self, image: &Sample<'_>) -> Result<bool> {
        let counted = self.method.add_sample(image)?.is_some();
        if let Some((evaluator, baseline)) = &mut self.mean_depth_baseline
            && counted
        {
            // A baseline from this scan alone predicts 80 m, which is then its score.
            let depth = baseline.depth_for(Some(image.ground_truth))?;
            evaluator.add(image.name, &Prediction::Depth(depth), image.ground_truth)?;
        }
        Ok(counted)
    }

    /// Counts an image for its kind of drive, too.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn add_to_scenario(&mut self, name: &str, image: &Sample<'_>) -> Result<()> {
        if !self.scenarios.contains_key(name) {
            let evaluator = Evaluator::new(self.protocol.clone())?;
            self.scenarios.insert(name.to_owned(), evaluator);
        }
        if let Some(evaluator) = self.scenarios.get_mut(name) {
            evaluator.add_sample(image)?;
        }
        Ok(())
    }

    /// The results; `places` are the places of the images that counted.
    ///
    /// # Errors
    /// No image had a pixel to compare.
    pub fn evaluated(&self, places: Vec<ImageRef>) -> Result<Evaluated> {
        Ok(Evaluated {
            report: self.report()?,
            images: self.method.images().to_vec(),
            points: self.method.drawn_points().to_vec(),
            places,
        })
    }

    /// The report on the method and the mean-depth baseline, with a row for each kind of drive if there are several.
    fn report(&self) -> Result<Report> {
        let mut report = self.method.report()?;
        if self.scenarios.len() > 1 {
            // A kind of drive may have no ground truth within the range.
            let measured = self.scenarios.iter();
            for (name, evaluator) in measured.filter(|(_, e)| !e.images().is_empty()) {
                let row = ScenarioRow::new(name, &evaluator.report()?);
                report.scenarios.push(row);
            }
        }
        Ok(match &self.mean_depth_baseline {
            Some((evaluator, _)) => report.with_mean_depth_baseline(&evaluator.report()?),
            None => report,
        })
    }
}
