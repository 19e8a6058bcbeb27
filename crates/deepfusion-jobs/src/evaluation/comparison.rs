//! A method beside the mean-depth baseline, on the same images.

use std::collections::BTreeMap;

use deepfusion_eval::{
    Evaluator, MeanDepthBaseline, Prediction, Protocol, Report, Sample, ScenarioRow,
};

use super::{Evaluated, ImageRef};
use crate::Result;

/// Evaluates a method and, beside it, the mean-depth baseline on the same images.
pub struct Comparison {
    method: Evaluator,
    mean_depth_baseline: Option<(Evaluator, MeanDepthBaseline)>,
    /// By kind of drive, where the recordings say theirs.
    scenarios: BTreeMap<String, Evaluator>,
    protocol: Protocol,
}

impl Comparison {
    /// Without any image yet; a baseline without scans gives no mean-depth baseline.
    ///
    /// # Errors
    /// A protocol that nothing can be measured with.
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

    /// Compares one image; whether it had a pixel to compare.
    ///
    /// # Errors
    /// A prediction that cannot be one, or is of another shape than the truth.
    pub fn add(&mut self, image: &Sample<'_>) -> Result<bool> {
        let counted = self.method.add_sample(image)?.is_some();
        if let Some((evaluator, baseline)) = &mut self.mean_depth_baseline
            && counted
        {
            // A baseline of this one scan alone has nothing else to say than "80 m": that is its score.
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

    /// All that was found; `places` says where the images that counted are.
    ///
    /// # Errors
    /// Where no image had a pixel to compare.
    pub fn evaluated(&self, places: Vec<ImageRef>) -> Result<Evaluated> {
        Ok(Evaluated {
            report: self.report()?,
            images: self.method.images().to_vec(),
            points: self.method.drawn_points().to_vec(),
            places,
        })
    }

    /// The method's report with the mean-depth baseline, and a row for each kind of drive where there are several.
    fn report(&self) -> Result<Report> {
        let mut report = self.method.report()?;
        if self.scenarios.len() > 1 {
            // A kind of drive may have no depth within the range.
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
