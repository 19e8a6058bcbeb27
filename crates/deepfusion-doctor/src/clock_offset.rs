//! The offset between the camera's clock and the vehicle's, from how pictures and vehicle turn.

use super::epipolar::EpipolarPair;
use super::survey::Survey;
use super::turn::picture_turn;
use deepfusion_data::{Dataset, Ego};
use deepfusion_motion::{
    ImageMotion, NoTimeOffset, OffsetConfig, TimeOffset, VehicleRates, time_offset,
};
use rayon::prelude::*;

/// The offset is measured again with its own result at most this often, or until it changes by less than this, in seconds.
const ROUNDS: usize = 4;
/// See [`ROUNDS`].
const SETTLED_S: f64 = 0.001;

/// What the vehicle measured of its motion; without a yaw rate, the turns of its course if a receiver recorded one. `None` without
/// speeds.
pub(super) fn rates(dataset: &Dataset) -> Option<VehicleRates> {
    let mut rates = VehicleRates::from(dataset.track()?);
    if !dataset.yaw_known() {
        rates.yaw_rate_radps = dataset.receiver().course_rate_radps.clone();
    }
    Some(rates)
}

/// Finds the offset, and with it the camera's direction of travel. That direction is taken from the vehicle, whose times are
/// known only once the offset is. Taken at another time it adds a part of that time's turn to the picture's, and a tenth to the
/// offset. The last change of the offset is part of the standard error.
pub(super) fn settled(
    survey: &Survey<'_>,
    pairs: &[EpipolarPair],
    rates: &VehicleRates,
    config: &OffsetConfig,
) -> Result<TimeOffset, NoTimeOffset> {
    let measure = |pairs: &[EpipolarPair]| time_offset(&pictures(survey, pairs), rates, config);
    let mut offset = measure(pairs)?;
    let Ok(ego) = survey.dataset.ego().map(Ego::level) else {
        return Ok(offset);
    };
    for _ in 0..ROUNDS {
        let before = offset.vehicle_minus_camera_s;
        let headed = |pair: &EpipolarPair| pair.with_clock(&ego, before);
        let again: Vec<EpipolarPair> = pairs.iter().filter_map(headed).collect();
        // A track that ends too early for the offset leaves too few pairs: the earlier result is kept.
        let Ok(measured) = measure(&again) else { break };
        let change = (measured.vehicle_minus_camera_s - before).abs();
        offset = TimeOffset {
            std_error_s: measured.std_error_s.max(change),
            ..measured
        };
        if change < SETTLED_S {
            break;
        }
    }
    if rates.pitch_rate_radps.is_some() {
        Ok(refined(survey, pairs, offset))
    } else {
        Ok(offset)
    }
}

/// How far about a first estimate the better one is searched for, and in what steps, seconds.
const AROUND_S: f64 = 0.06;
/// See [`AROUND_S`].
const STEP_S: f64 = 0.004;
/// Pairs that are left out together for the standard error: half a second's worth.
const BLOCK: usize = 5;

/// The offset at which the points agree best with the vehicle's turns about all three axes, if an inertial unit measured them. A
/// turn measured in the picture first would be coupled to the other axes, and to the motion of near things; here none is measured.
/// Returns the first estimate if the best offset lies at the end of the range.
fn refined(survey: &Survey<'_>, pairs: &[EpipolarPair], first: TimeOffset) -> TimeOffset {
    let Ok(ego) = survey.dataset.ego() else {
        return first;
    };
    let steps = (AROUND_S / STEP_S).round() as i32;
    let offset_s = |step: f64| first.vehicle_minus_camera_s + step * STEP_S;
    // Costs at each offset, of the pairs that have a motion at all offsets.
    let costs: Vec<Vec<f64>> = pairs
        .par_iter()
        .filter_map(|pair| {
            let cost = |step: i32| {
                let pair = pair.with_clock(&ego, offset_s(f64::from(step)))?;
                Some(pair.cost_of_the_vehicle_s_turn(&pair.direction()?))
            };
            (-steps..=steps).map(cost).collect()
        })
        .collect();
    let best_without = |block: Option<usize>| {
        let kept = costs.iter().enumerate();
        let kept = kept.filter(|(i, _)| block != Some(i / BLOCK));
        let mut sums = vec![0.0; 2 * steps as usize + 1];
        for (_, of_pair) in kept {
            sums.iter_mut().zip(of_pair).for_each(|(s, c)| *s += c);
        }
        lowest(&sums).map(|at| offset_s(at - f64::from(steps)))
    };
    let Some(best) = best_without(None) else {
        return first;
    };
    // Delete-a-block jackknife.
    let blocks = costs.len().div_ceil(BLOCK);
    let others: Vec<f64> = (0..blocks).filter_map(|b| best_without(Some(b))).collect();
    if blocks < 4 || others.len() < blocks {
        return first;
    }
    let squares: f64 = others.iter().map(|o| (o - best).powi(2)).sum();
    let share = (blocks - 1) as f64 / blocks as f64;
    TimeOffset {
        vehicle_minus_camera_s: best,
        std_error_s: (share * squares).sqrt(),
        ..first
    }
}

/// Where a parabola through the lowest value and its neighbours has its minimum; `None` at an end.
fn lowest(values: &[f64]) -> Option<f64> {
    let at = (0..values.len()).min_by(|a, b| values[*a].total_cmp(&values[*b]))?;
    let (before, after) = (values.get(at.checked_sub(1)?)?, values.get(at + 1)?);
    let bend = before - 2.0 * values[at] + after;
    Some(at as f64 + 0.5 * (before - after) / bend.max(1e-12))
}

/// How the pictures moved. The turn from the followed points is more accurate than shift, drop and roll of the whole picture,
/// which near things change as well; it is used if enough pairs have it.
fn pictures(survey: &Survey<'_>, pairs: &[EpipolarPair]) -> Vec<ImageMotion> {
    let whole: Vec<ImageMotion> = survey.pairs.iter().filter_map(|p| p.image).collect();
    let turned = |pair: &EpipolarPair| {
        let from_s = pair.middle_s - 0.5 * pair.dt_s;
        let same = whole.iter().find(|m| (m.from_s - from_s).abs() < 1e-6)?;
        let turn = picture_turn(pair)?;
        Some(ImageMotion {
            shift: -turn.y,
            drop: turn.x,
            clockwise_rad: -turn.z,
            ..*same
        })
    };
    let turned: Vec<ImageMotion> = pairs.iter().filter_map(turned).collect();
    if 2 * turned.len() > whole.len() {
        turned
    } else {
        whole
    }
}
