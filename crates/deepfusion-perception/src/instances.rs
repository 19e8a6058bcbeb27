//! Instances: objects whose pixels come from a segmentation model, fused with their depth.

use crate::clusters::{Cluster, Run};
use crate::obstacles::{NONE, Obstacles};
use crate::{Error, PerceptionConfig, Result};

/// An object's class and its score.
#[derive(Debug, Clone, PartialEq)]
pub struct Kind {
    /// The class, such as `car`.
    pub class: String,
    /// Score of the class, 0 to 1.
    pub score: f32,
}

/// An object in the image, given by its pixels.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Instance {
    /// Its class, such as `car`.
    pub class: String,
    /// Score of the class, 0 to 1.
    pub score: f32,
    /// Its pixels, at the depth image's size; the whole box if only the box is known.
    pub runs: Vec<Run>,
    /// Whether the pixels are a mask and not a box.
    pub drawn: bool,
}

/// Quantiles of depth between which an object's pixels are assumed to lie: a mask's edge and windows show the background.
const OF_A_MASK: [f32; 2] = [0.05, 0.9];
/// As [`OF_A_MASK`], for a box: its corners show the background, and its lower edge the foreground.
const OF_A_BOX: [f32; 2] = [0.1, 0.6];
/// Margin beyond them, metres.
const MARGIN_M: f32 = 1.0;

impl Instance {
    /// Its class and score.
    pub(crate) fn kind(&self) -> Kind {
        Kind {
            class: self.class.clone(),
            score: self.score.clamp(0.0, 1.0),
        }
    }

    /// Checks that it lies inside a depth image of this width and height.
    ///
    /// # Errors
    /// [`Error::Instance`].
    pub(crate) fn check(&self, (width, height): (usize, usize)) -> Result<()> {
        let outside =
            |run: &&Run| run.v as usize >= height || run.to as usize > width || run.from >= run.to;
        match self.runs.iter().find(outside) {
            None => Ok(()),
            Some(run) => Err(Error::Instance {
                class: self.class.clone(),
                run: [run.v, run.from, run.to],
                size: (width, height),
            }),
        }
    }

    /// Its obstacle pixels at about the distance of most of them.
    pub(crate) fn cluster(
        &self,
        depth: &[f32],
        width: usize,
        obstacles: &Obstacles,
        config: &PerceptionConfig,
    ) -> Cluster {
        let at = |v: u32, u: u32| v as usize * width + u as usize;
        let mut depths: Vec<f32> = self
            .runs
            .iter()
            .flat_map(|run| (run.from..run.to).map(|u| at(run.v, u)))
            .filter(|i| obstacles.height[*i] != NONE)
            .map(|i| depth[i])
            .collect();
        if depths.is_empty() {
            return Cluster::default();
        }
        let last = depths.len() - 1;
        let shares = if self.drawn { OF_A_MASK } else { OF_A_BOX };
        let [near, far] = shares.map(|share| {
            let place = (share * last as f32) as usize;
            *depths.select_nth_unstable_by(place, f32::total_cmp).1
        });
        let slack = |z: f32| MARGIN_M + 2.0 * config.relative_error * z;
        let range = near - slack(near)..=far + slack(far);
        let mut cluster = Cluster::default();
        for run in &self.runs {
            let belongs = |u: u32| {
                let i = at(run.v, u);
                u < run.to && obstacles.height[i] != NONE && range.contains(&depth[i])
            };
            let mut open = None;
            for u in run.from..=run.to {
                match (belongs(u), open) {
                    (true, None) => open = Some(u),
                    (false, Some(from)) => {
                        cluster.pixels += (u - from) as usize;
                        cluster.runs.push(Run {
                            v: run.v,
                            from,
                            to: u,
                        });
                        open = None;
                    }
                    _ => {}
                }
            }
        }
        cluster
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_hint::Hint;

    #[test]
    fn background_inside_a_mask_is_left_out() {
        let (width, height) = (20, 10);
        // An object 8 m away in the middle, a wall at 30 m around it, the road below.
        let is_thing = |u: usize, v: usize| (5..15).contains(&u) && (2..8).contains(&v);
        let depth: Vec<f32> = (0..width * height)
            .map(|i| {
                if is_thing(i % width, i / width) {
                    8.0
                } else {
                    30.0
                }
            })
            .collect();
        let obstacles = Obstacles {
            height: (0..width * height)
                .map(|i| if i / width < 8 { 1.0 } else { NONE })
                .collect(),
        };
        let run = |v: u32, from: u32, to: u32| Run { v, from, to };
        let mask = Instance {
            class: "car".into(),
            score: 0.9,
            runs: (1..10).map(|v| run(v, 4, 15)).collect(),
            drawn: false,
        };
        assert!(mask.check((width, height)).is_ok());
        let config = PerceptionConfig::default();
        let cluster = mask.cluster(&depth, width, &obstacles, &config);
        let expected: Vec<Run> = (2..8).map(|v| run(v, 5, 15)).collect();
        assert_eq!((cluster.runs, cluster.pixels), (expected, 60));

        // A mask is trusted.
        let drawn = Instance {
            drawn: true,
            ..mask.clone()
        };
        assert!(drawn.cluster(&depth, width, &obstacles, &config).pixels > 60);
        let nothing = Instance {
            runs: vec![run(9, 0, 20)],
            ..mask.clone()
        };
        assert_eq!(
            nothing.cluster(&depth, width, &obstacles, &config),
            Cluster::default()
        );
        for wrong in [run(10, 0, 5), run(0, 0, 21), run(0, 7, 7)] {
            let mask = Instance {
                runs: vec![wrong],
                ..mask.clone()
            };
            let error = mask.check((width, height)).unwrap_err();
            assert!(
                error.to_string().contains("car") && error.hint().is_some(),
                "{error}"
            );
        }
    }
}
