//! An upright box on the ground.

/// A box on the ground, in the ground's axes (right, forward, height).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundBox {
    /// Middle of the footprint: right, forward, in metres.
    pub middle: [f32; 2],
    /// Angle from `right` to the length, towards `forward`, in radians; defined up to half a turn.
    pub angle: f32,
    /// Length and width, in metres; the length is not smaller than the width.
    pub footprint: [f32; 2],
    /// Heights of the lower and the upper face above the ground, in metres.
    pub heights: [f32; 2],
    /// Visible share of the length and of the width.
    pub seen: [f32; 2],
    /// The point of the footprint that stays fixed when the extents are corrected: the corner, or the middle of the visible side (right,
    /// forward), in metres.
    pub anchor: [f32; 2],
}

impl GroundBox {
    /// The four corners of the footprint, in order: right, forward, in metres.
    #[must_use]
    pub fn corners(&self) -> [[f32; 2]; 4] {
        let [along, across] = axes(self.angle);
        let [length, width] = self.footprint.map(|s| 0.5 * s);
        [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|[a, b]| {
            [0, 1].map(|k| self.middle[k] + a * length * along[k] + b * width * across[k])
        })
    }

    /// Middle of the footprint with these extents along its length and width, in metres.
    #[must_use]
    pub fn middle_with(&self, extents: [f32; 2]) -> [f32; 2] {
        let mut middle = self.anchor;
        for (i, axis) in axes(self.angle).into_iter().enumerate() {
            let off = (self.middle[0] - self.anchor[0]) * axis[0]
                + (self.middle[1] - self.anchor[1]) * axis[1];
            let off = off * extents[i] / self.footprint[i].max(1e-3);
            middle = [middle[0] + off * axis[0], middle[1] + off * axis[1]];
        }
        middle
    }

    /// Intersection of two footprints divided by the area of the smaller, 0 to 1.
    #[must_use]
    pub fn overlap(&self, other: &Self) -> f32 {
        let apart = [0, 1].map(|k| self.middle[k] - other.middle[k]);
        let reach = |b: &Self| 0.5 * b.footprint[0].hypot(b.footprint[1]);
        if apart[0].hypot(apart[1]) > reach(self) + reach(other) {
            return 0.0;
        }
        let area = |b: &Self| b.footprint[0] * b.footprint[1];
        let shared = polygon_area(&clipped(self.corners().to_vec(), other));
        shared / area(self).min(area(other)).max(1e-6)
    }
}

/// Clips a convex polygon to a box (Sutherland and Hodgman).
fn clipped(mut polygon: Vec<[f32; 2]>, within: &GroundBox) -> Vec<[f32; 2]> {
    for (axis, half) in axes(within.angle).into_iter().zip(within.footprint) {
        for sign in [1.0, -1.0] {
            let inside = |p: &[f32; 2]| {
                let off = (p[0] - within.middle[0]) * axis[0] + (p[1] - within.middle[1]) * axis[1];
                0.5 * half - sign * off
            };
            let mut next = Vec::with_capacity(polygon.len() + 1);
            for (i, p) in polygon.iter().enumerate() {
                let q = &polygon[(i + 1) % polygon.len()];
                let (a, b) = (inside(p), inside(q));
                if a >= 0.0 {
                    next.push(*p);
                }
                if (a >= 0.0) != (b >= 0.0) {
                    let share = a / (a - b);
                    next.push([0, 1].map(|k| p[k] + share * (q[k] - p[k])));
                }
            }
            polygon = next;
        }
    }
    polygon
}

fn polygon_area(polygon: &[[f32; 2]]) -> f32 {
    let next = polygon.iter().cycle().skip(1);
    let twice: f32 = polygon
        .iter()
        .zip(next)
        .map(|(p, q)| p[0] * q[1] - p[1] * q[0])
        .sum();
    0.5 * twice.abs()
}

/// Unit vectors along and across an angle.
pub(crate) fn axes(angle: f32) -> [[f32; 2]; 2] {
    let (sin, cos) = angle.sin_cos();
    [[cos, sin], [-sin, cos]]
}
