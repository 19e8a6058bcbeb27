//! The line on which cars stand side by side.

use super::HALF_M;
use nalgebra::{Matrix4, Vector4};

/// A car that stands across the lane, in the ground's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Parked {
    /// Position of its middle: right, forward, in metres.
    pub middle: [f32; 2],
    /// Direction of the row at the car, right over forward: at a right angle to the car.
    pub slope: f32,
    /// Approximate number of sightings.
    pub weight: f32,
}

/// Limits for two neighbours, in metres: the offset of their middles from a common line, and their distance along it.
const OFF_M: f32 = 0.9;
/// See [`OFF_M`].
const APART_M: [f32; 2] = [1.5, 14.0];
/// Largest angle between two neighbours, in radians.
const TURN: f32 = 0.35;
/// Weight of a car's orientation relative to its position: that of a position at this distance, in metres.
const TURN_M: f32 = 12.0;
/// Prior weights of a straight row, and of one along the lane.
const STRAIGHT: f32 = 4.0;
/// See [`STRAIGHT`].
const AHEAD: f32 = 1.0;
/// Unit of a row's curvature: 1/this per metre.
const BEND: f32 = 10.0;
/// Distance along a row within which its cars count, in metres, because a lane's curvature varies. Beyond it a small weight remains.
const COUNTS_M: f32 = 15.0;
/// See [`COUNTS_M`].
const LEFT: f32 = 0.02;
/// Number of sightings from which a car is certain.
const SURE: f32 = 2.0;
/// How far a row is searched before its first car, and beyond its last car or the last one across the lane, in metres.
const BEFORE_M: f32 = 10.0;
/// See [`BEFORE_M`].
const CONTINUES_M: f32 = 15.0;
/// Weight of a vehicle driving along the lane for the lane's curvature, in sightings of a car, at any distance.
const DRIVEN: f32 = 2.0;
/// Smallest distance between two rows, in metres.
const ROWS_M: f32 = 5.0;

/// The lane's direction at a point, as shown by a vehicle driving along it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Heading {
    /// Position of the point, forward in metres.
    pub forward: f32,
    /// The lane's direction there, right over forward.
    pub slope: f32,
}

/// A row of cars, side by side along the lane: right = p₀ + p₁ q + p₂ q² / 10 with q = forward − `from`.
///
/// The row across the lane, if there is one, has the same p₁ and p₂ but its own p₀.
#[derive(Debug, Clone)]
pub(super) struct Row {
    cars: Vec<Parked>,
    across: Vec<Parked>,
    lane: Vec<Heading>,
    from: f32,
    /// p₀, p₁, p₂, and the other row's p₀.
    line: Vector4<f32>,
    /// Cars near this forward position count most.
    focus: Option<f32>,
}

impl Row {
    /// The rows of these cars, the most certain first: each of at least two cars, or of one car across the lane from such a row.
    pub(super) fn all(cars: &[Parked]) -> Vec<Self> {
        let mut groups: Vec<Vec<Parked>> = Vec::new();
        for car in cars {
            // The groups that the car belongs to are merged.
            let (own, others): (Vec<_>, Vec<_>) = groups
                .into_iter()
                .partition(|group| group.iter().any(|other| beside(car, other)));
            groups = others;
            let joined = own.into_iter().flatten().chain([*car]);
            groups.push(joined.collect());
        }
        let (several, single): (Vec<_>, Vec<_>) = groups.into_iter().partition(|g| g.len() > 1);
        let mut rows: Vec<Self> = several.into_iter().map(Self::through).collect();
        let across = single.into_iter().flatten();
        let across = across.filter(|car| rows.iter().any(|row| row.faces(car)));
        let across: Vec<Self> = across.map(|car| Self::through(vec![car])).collect();
        rows.extend(across);
        rows.sort_by_key(|row| std::cmp::Reverse(row.sure()));
        let mut apart: Vec<Self> = Vec::new();
        for row in rows {
            if !apart.iter().any(|surer| row.crowds(surer)) {
                apart.push(row);
            }
        }
        apart
    }

    fn through(cars: Vec<Parked>) -> Self {
        let mut row = Self {
            cars,
            across: Vec::new(),
            lane: Vec::new(),
            from: 0.0,
            line: Vector4::zeros(),
            focus: None,
        };
        row.fit();
        row
    }

    /// Whether a car that was seen often enough stands across the lane from this row.
    fn faces(&self, car: &Parked) -> bool {
        let seen = |c: &&Parked| c.weight >= SURE;
        let [first, last] = self.reach();
        let turn = self.slope(car.middle[1]).atan() - car.slope.atan();
        seen(&car)
            && self.cars.iter().filter(seen).count() > 1
            && (first - APART_M[1]..last + APART_M[1]).contains(&car.middle[1])
            && turn.abs() < TURN
            && self.at(car.middle[1]) * car.middle[0] < 0.0
    }

    /// Whether two rows are too close to each other.
    fn crowds(&self, other: &Self) -> bool {
        let [from, to] = self.reach();
        [from, 0.5 * (from + to), to]
            .iter()
            .any(|at| (self.at(*at) - other.at(*at)).abs() < ROWS_M)
    }

    /// Includes the other row's cars in the fit, if that row is across the lane.
    pub(super) fn align_with(&mut self, other: &Self) {
        let [from, to] = self.reach();
        let [other_from, other_to] = other.reach();
        let between = 0.5 * (from.max(other_from) + to.min(other_to));
        let turn = self.slope(between).atan() - other.slope(between).atan();
        if self.at(between) * other.at(between) < 0.0 && turn.abs() < TURN {
            self.across.extend(&other.cars);
            self.fit();
        }
    }

    /// Includes the headings of vehicles along the lane in the fit.
    pub(super) fn keep_to(&mut self, lane: &[Heading]) {
        self.lane = lane.to_vec();
        self.fit();
    }

    /// Adds a car.
    pub(super) fn add(&mut self, car: Parked) {
        self.cars.push(car);
        self.fit();
    }

    /// From now on cars near this forward position, in metres, count most.
    pub(super) fn focus(&mut self, forward: f32) {
        self.focus = Some(forward);
        self.fit();
    }

    /// Weighted least squares over positions and orientations.
    fn fit(&mut self) {
        let weight: f32 = self.cars.iter().map(|c| c.weight).sum();
        let forward = |c: &Parked| c.weight * c.middle[1];
        self.from = self.cars.iter().map(forward).sum::<f32>() / weight;
        // Without a row across the lane, nothing else determines its p₀.
        let least = Vector4::new(0.0, AHEAD.powi(2), STRAIGHT.powi(2), 1e-3);
        let mut normal = Matrix4::from_diagonal(&least);
        let mut sum = Vector4::zeros();
        let mut turns = Vec::with_capacity(self.cars.len() + self.across.len());
        let own = self.cars.iter().map(|car| (car, 1.0));
        let across = self.across.iter().map(|car| (car, 0.0));
        for (car, own) in own.chain(across) {
            let off = self.focus.map_or(0.0, |focus| car.middle[1] - focus);
            let weight = car.weight * (-(off / COUNTS_M).powi(2)).exp().max(LEFT);
            let q = car.middle[1] - self.from;
            let place = Vector4::new(own, q, q * q / BEND, 1.0 - own) * weight;
            normal += place * place.transpose();
            sum += place * (weight * car.middle[0]);
            turns.push((car.middle[1], car.slope, weight));
        }
        let lane = self.lane.iter().map(|h| (h.forward, h.slope, DRIVEN));
        for (forward, slope, weight) in turns.into_iter().chain(lane) {
            let q = forward - self.from;
            let turn = Vector4::new(0.0, 1.0, 2.0 * q / BEND, 0.0) * (TURN_M * weight);
            normal += turn * turn.transpose();
            sum += turn * (TURN_M * weight * slope);
        }
        // Positive definite for weights above 0.
        if let Some(cholesky) = normal.cholesky() {
            self.line = cholesky.solve(&sum);
        }
    }

    /// Lateral position of its cars' middles at this forward position, right in metres.
    pub(super) fn at(&self, forward: f32) -> f32 {
        let q = forward - self.from;
        self.line[0] + self.line[1] * q + self.line[2] * q * q / BEND
    }

    /// Its direction at this forward position, right over forward.
    pub(super) fn slope(&self, forward: f32) -> f32 {
        self.line[1] + 2.0 * self.line[2] * (forward - self.from) / BEND
    }

    /// Range of its own cars, forward in metres.
    pub(super) fn reach(&self) -> [f32; 2] {
        let ends = [f32::INFINITY, f32::NEG_INFINITY];
        self.cars.iter().fold(ends, |[low, high], car| {
            [low.min(car.middle[1]), high.max(car.middle[1])]
        })
    }

    /// Start of the search range, forward in metres.
    pub(super) fn start(&self) -> f32 {
        self.reach()[0] - BEFORE_M
    }

    /// End of the search range, forward in metres.
    pub(super) fn end(&self) -> f32 {
        let all = self.cars.iter().chain(&self.across);
        let last = all.map(|car| car.middle[1]);
        last.fold(f32::NEG_INFINITY, f32::max) + CONTINUES_M
    }

    /// Whether this forward position is within the search range.
    pub(super) fn passes(&self, along: f32) -> bool {
        (self.start()..self.end()).contains(&along)
    }

    /// Whether a point (right, forward) is in the row.
    pub(super) fn holds(&self, at: [f32; 2]) -> bool {
        let [along, off] = self.locate(at);
        off.abs() <= HALF_M && self.passes(along)
    }

    /// Number of its cars that were seen often.
    pub(super) fn sure(&self) -> usize {
        self.cars.iter().filter(|car| car.weight >= SURE).count()
    }

    /// A point in the row's coordinates: position along the row (as forward, on its line), and offset from the line to the right.
    pub(super) fn locate(&self, [right, forward]: [f32; 2]) -> [f32; 2] {
        let off = right - self.at(forward);
        [forward + self.slope(forward) * off, off]
    }

    /// The point at this position along the row and this offset to the right of it: right, forward in metres.
    pub(super) fn place(&self, along: f32, off: f32) -> [f32; 2] {
        let (sin, cos) = self.angle(along).sin_cos();
        [self.at(along) + off * cos, along + off * sin]
    }

    /// Orientation of its cars at this position, as [`crate::GroundBox::angle`].
    pub(super) fn angle(&self, along: f32) -> f32 {
        (-self.slope(along)).atan()
    }
}

/// Whether two cars stand side by side.
fn beside(a: &Parked, b: &Parked) -> bool {
    let apart = a.middle[1] - b.middle[1];
    let slope = 0.5 * (a.slope + b.slope);
    let off = a.middle[0] - b.middle[0] - slope * apart;
    (APART_M[0]..APART_M[1]).contains(&apart.abs())
        && off.abs() < OFF_M + 0.05 * apart.abs()
        && (a.slope.atan() - b.slope.atan()).abs() < TURN
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car(right: f32, forward: f32, slope: f32) -> Parked {
        Parked {
            middle: [right, forward],
            slope,
            weight: 1.0,
        }
    }

    #[test]
    fn both_sides_of_a_lane_are_rows_but_a_car_in_it_is_not() {
        let cars = [
            car(6.0, 4.0, 0.0),
            car(-6.1, 6.0, 0.0),
            car(5.9, 9.0, 0.0),
            car(0.2, 10.0, 0.0),
            car(-5.9, 11.5, 0.0),
            car(6.1, 22.0, 0.0),
        ];
        let mut rows = Row::all(&cars);
        rows.sort_by(|a, b| a.at(5.0).total_cmp(&b.at(5.0)));
        assert_eq!(rows.len(), 2);
        assert!((rows[0].at(9.0) + 6.0).abs() < 0.1);
        assert!((rows[1].at(30.0) - 6.0).abs() < 0.3);
        assert_eq!(rows[1].reach(), [4.0, 22.0]);
    }

    #[test]
    fn one_car_across_the_lane_is_a_row_once_it_was_seen_often() {
        let often = |car: Parked| Parked { weight: 3.0, ..car };
        let row = [often(car(6.0, 4.0, 0.0)), often(car(6.0, 9.0, 0.0))];
        let once = [row[0], row[1], car(-6.0, 7.0, 0.0)];
        assert_eq!(Row::all(&once).len(), 1);
        let rows = Row::all(&[row[0], row[1], often(car(-6.0, 7.0, 0.0))]);
        assert_eq!(rows.len(), 2);
    }

    #[test]
    fn a_row_continues_in_the_direction_of_its_cars() {
        let row = Row::through(vec![car(5.0, 5.0, 0.1), car(5.3, 8.0, 0.1)]);
        assert!((row.slope(10.0) - 0.1).abs() < 0.02, "{row:?}");
        let [along, off] = row.locate([row.at(10.0) + 1.0, 10.0]);
        // A point one metre to the right is a little less than a metre off the row, and a little farther along it.
        assert!(
            (along - 10.1).abs() < 0.02 && (off - 1.0).abs() < 0.01,
            "{along} {off}"
        );
        let back = row.place(along, off);
        assert!((back[1] - 10.0).abs() < 0.05, "{back:?}");
    }

    #[test]
    fn a_row_bends_with_vehicles_along_the_lane() {
        let mut row = Row::through(vec![car(6.0, 2.0, 0.0), car(6.0, 5.0, 0.0)]);
        let straight = row.at(24.0);
        row.keep_to(&[Heading {
            forward: 25.0,
            slope: -0.4,
        }]);
        assert!((row.at(4.0) - 6.0).abs() < 0.3, "{row:?}");
        assert!((row.slope(25.0) + 0.4).abs() < 0.15, "{row:?}");
        assert!(row.at(24.0) < straight - 2.0, "{row:?}");
    }

    #[test]
    fn a_row_bends_like_the_one_across_the_lane() {
        // A bend of 40 m radius; the left row shows more of it.
        let turn = |forward: f32| forward / 40.0;
        let on = |right: f32, forward: f32| {
            car(right + forward * forward / 80.0, forward, turn(forward))
        };
        let mut right = Row::through(vec![on(6.0, 2.0), on(6.0, 5.0)]);
        let left = Row::through((1..7).map(|i| on(-6.0, 4.0 * i as f32)).collect());
        right.align_with(&left);
        let expected = 6.0 + 24.0 * 24.0 / 80.0;
        assert!((right.at(24.0) - expected).abs() < 0.6, "{right:?}");
        assert!((right.end() - 39.0).abs() < 1e-3);
    }
}
