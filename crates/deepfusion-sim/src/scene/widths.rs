//! A road whose widths change from section to section.

use super::World;
use crate::road::STEP;
use crate::texture::noise::{lerp, smoothstep};

/// The widths of a section of a street.
pub(super) struct Widths {
    /// End of the section, metres along the road.
    pub to: f64,
    /// Half the width of the carriageway, metres.
    pub half_width: f32,
    /// Widths of pavement and verge, metres: right, left.
    pub sides: [(f32, f32); 2],
}

impl World {
    /// Sets the widths of the road's samples. Each section blends into the next over its last `blend` metres.
    pub(super) fn apply_widths(&mut self, sections: &[Widths], blend: f64) {
        let start = self.road.start;
        let samples = self.road.samples_mut();
        self.stretch_of = vec![0; samples.len()];
        let mut number = 0;
        for (i, sample) in samples.iter_mut().enumerate() {
            let s = start + i as f64 * STEP;
            while number + 1 < sections.len() && s >= sections[number].to {
                number += 1;
            }
            let here = &sections[number];
            let next = &sections[(number + 1).min(sections.len() - 1)];
            let t = smoothstep((here.to - blend) as f32, here.to as f32, s as f32);
            sample.half_width = lerp(here.half_width, next.half_width, t);
            for side in 0..2 {
                let ((pavement, verge), next) = (here.sides[side], next.sides[side]);
                sample.pavement[side] = lerp(pavement, next.0, t);
                sample.verge[side] = lerp(verge, next.1, t);
            }
            self.stretch_of[i] = number as u16;
        }
        self.road.index();
    }
}
