//! Cars stand in rows: the orientation of a clearly visible car helps with its less visible neighbours.

use crate::GroundBox;

/// An orientation (defined up to half a turn) and its weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Turn {
    /// Cosine and sine of twice the angle (as [`crate::GroundBox::angle`]), multiplied by the weight.
    doubled: [f32; 2],
}

/// Cost of an orientation that contradicts the expectation completely, per unit of weight.
const COST: f32 = 0.25;
/// Largest weight of a vote for the road's direction, of one against it, and of all votes together.
const MOST: [f32; 3] = [0.5, 4.0, 6.0];
/// How far a row reaches to both sides of a car in it, in metres; nearer cars have more weight.
const ROW_M: f32 = 15.0;
/// Margin of a row beyond a box's own length or width, in metres.
const BESIDE_M: f32 = 0.3;

impl Turn {
    /// An orientation with an angle in radians and a weight; the road has weight 1.
    pub(crate) fn new(angle: f32, weight: f32) -> Self {
        let (sin, cos) = (2.0 * angle).sin_cos();
        Self {
            doubled: [weight * cos, weight * sin],
        }
    }

    /// The orientation along the road.
    pub(crate) fn ahead() -> Self {
        Self::new(std::f32::consts::FRAC_PI_2, 1.0)
    }

    /// The angle, in radians.
    pub(crate) fn angle(self) -> f32 {
        0.5 * self.doubled[1].atan2(self.doubled[0])
    }

    fn weight(self) -> f32 {
        self.doubled[0].hypot(self.doubled[1])
    }

    /// The cost of an angle relative to this orientation.
    pub(crate) fn against(self, angle: f32) -> f32 {
        let (sin, cos) = (2.0 * angle).sin_cos();
        COST * (self.weight() - self.doubled[0] * cos - self.doubled[1] * sin)
    }

    fn at_most(self, most: f32) -> Self {
        let share = (most / self.weight().max(1e-6)).min(1.0);
        Self {
            doubled: self.doubled.map(|x| share * x),
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            doubled: [0, 1].map(|i| self.doubled[i] + other.doubled[i]),
        }
    }
}

/// A box's vote on the orientation of its neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Vote {
    /// Position of the middle of its visible part: right, forward, in metres.
    pub at: [f32; 2],
    /// The fitted box.
    pub place: GroundBox,
    /// How much worse the other orientation would fit.
    pub margin: f32,
}

impl Vote {
    /// Its vote for something at `at`, if that is in its row: before, behind or beside it.
    fn on(&self, at: [f32; 2]) -> Option<Turn> {
        let (sin, cos) = self.place.angle.sin_cos();
        let middle = self.place.middle;
        let off = [at[0] - middle[0], at[1] - middle[1]];
        let apart = [cos * off[0] + sin * off[1], cos * off[1] - sin * off[0]].map(f32::abs);
        let inside = |i: usize| apart[i] < 0.5 * self.place.footprint[i] + BESIDE_M;
        let farthest = apart[0].max(apart[1]);
        // Standing along the road, as most do, is weaker evidence than standing across it.
        let as_all = Turn::ahead().against(self.place.angle) < COST;
        let weight = self.margin.min(MOST[usize::from(!as_all)]) * (1.0 - farthest / ROW_M);
        ((inside(0) || inside(1)) && weight > 0.0).then(|| Turn::new(self.place.angle, weight))
    }
}

/// The expected orientation of the `index`-th box, from the `usual` orientation there and the votes of the others in its row.
pub(crate) fn expected(votes: &[Vote], index: usize, usual: Turn) -> Turn {
    let others = votes.iter().enumerate().filter(|(i, _)| *i != index);
    others
        .filter_map(|(_, vote)| vote.on(votes[index].at))
        .fold(usual, Turn::plus)
        .at_most(MOST[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_2;

    /// A completely visible car, turned to `angle`.
    fn vote(middle: [f32; 2], angle: f32, margin: f32) -> Vote {
        Vote {
            at: middle,
            place: GroundBox {
                middle,
                angle,
                footprint: [4.4, 1.8],
                heights: [0.0, 1.5],
                seen: [1.0; 2],
                anchor: middle,
            },
            margin,
        }
    }

    #[test]
    fn a_row_gives_the_orientation_of_its_cars() {
        let clear = vote([6.0, 10.0], 0.0, 3.0);
        let beside = vote([5.0, 15.2], FRAC_PI_2, 0.0);
        let in_the_lane = vote([0.5, 12.0], FRAC_PI_2, 0.0);
        let votes = [clear, beside, in_the_lane];
        assert!(expected(&votes, 1, Turn::ahead()).angle().abs() < 0.1);
        // Neither beside nor before it: the road's orientation.
        assert_eq!(expected(&votes, 2, Turn::ahead()), Turn::ahead());
    }

    #[test]
    fn votes_along_the_road_weigh_less_than_votes_across() {
        let votes = [
            vote([6.0, 10.0], 0.0, 3.0),
            vote([6.0, 13.0], 0.0, 0.0),
            vote([6.0, 16.0], FRAC_PI_2, 3.0),
        ];
        assert!(expected(&votes, 1, Turn::ahead()).angle().abs() < 0.2);
    }

    #[test]
    fn the_cost_is_smallest_at_the_orientations_own_angle() {
        let turn = Turn::new(0.3, 2.0);
        assert!(turn.against(0.3).abs() < 1e-6);
        assert!((turn.against(0.3 + FRAC_PI_2) - 4.0 * COST).abs() < 1e-5);
    }
}
