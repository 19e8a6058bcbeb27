//! The camera's clock against the vehicle's.

use super::camera_ahead;
use super::epipolar::EpipolarPair;
use super::finding::{Figure, Limit, Outcome, Severity};
use super::survey::Survey;
use super::turn::picture_turn;
use deepfusion_data::{Dataset, Ego};
use deepfusion_motion::{
    ImageMotion, NoTimeOffset, OffsetConfig, Signal, TimeOffset, VehicleRates, time_offset,
};
use rayon::prelude::*;

/// Offset that matters, in seconds: at 10 m/s² of braking 20 ms are 0.2 m/s.
const MOST_S: f64 = 0.020;
/// The same where positions alone show the turns: a receiver's own delay is of that size.
const MOST_BY_COURSE_S: f64 = 0.1;
/// An estimate counts where it is so many standard errors from 0, and these are below `SURE_S`.
const SIGMAS: f64 = 4.0;
const SURE_S: f64 = 0.05;

/// How often the offset is measured again with what it says, at most, and by how little it then changes, seconds.
const ROUNDS: usize = 4;
/// See [`ROUNDS`].
const SETTLED_S: f64 = 0.001;

pub(super) fn check(survey: &Survey<'_>, pairs: &[EpipolarPair]) -> Outcome {
    let Estimate { offset, least_s } = match estimate(survey, pairs) {
        Ok(estimate) => estimate,
        Err(why) => return Outcome::skipped("clock", why),
    };
    let (value, error) = (offset.vehicle_minus_camera_s, offset.std_error_s);
    let mut outcome = Outcome::new("clock");
    // What the estimate cannot tell from 0 holds.
    let limit = least_s.max(SIGMAS * error);
    let figure = Figure::new(
        "offset, vehicle less camera",
        value,
        "s",
        Limit::Within(-limit, limit),
    );
    outcome.judge(Severity::Error, figure, || {
        let camera_ahead_s = survey.dataset.camera_ahead_s() - value;
        let ahead = if value < 0.0 { "ahead of" } else { "behind" };
        (
            format!(
                "the camera's clock is {:.0} ± {:.0} ms {ahead} the vehicle's: every frame gets the speed of another moment",
                1e3 * value.abs(),
                1e3 * error
            ),
            format!(
                "clock.camera_ahead_s = {camera_ahead_s:.3} in the file beside the recording, or a clock offset of {:.0} ms given (--clock-offset auto measures it again on opening). \
                 Better: one clock for all (PTP, trigger)",
                1e3 * camera_ahead_s
            ),
        )
    });
    outcome
}

/// An offset that is sure enough.
pub(super) struct Estimate {
    pub(super) offset: TimeOffset,
    /// What is smaller does not count, in seconds.
    least_s: f64,
}

/// The offset of the clocks; else why there is none.
pub(super) fn estimate(survey: &Survey<'_>, pairs: &[EpipolarPair]) -> Result<Estimate, String> {
    let rates = rates(survey.dataset).filter(|rates| rates.yaw_rate_radps.is_some());
    let rates = rates.ok_or("no speed and yaw rate to compare the picture with")?;
    if !survey.dataset.yaw_known() {
        // A course takes more pictures and other settings than a yaw rate.
        let offset = camera_ahead::offset(survey.dataset).map_err(|why| why.to_string())?;
        let least_s = MOST_BY_COURSE_S;
        return Ok(Estimate { offset, least_s });
    }
    let offset = settled(survey, pairs, &rates, &OffsetConfig::default());
    let offset = offset.map_err(|why| why.to_string())?;
    let (value, error) = (offset.vehicle_minus_camera_s, offset.std_error_s);
    if error.is_nan() || error >= SURE_S {
        Err(format!(
            "the estimate {value:.2} s has a standard error of {error:.2} s"
        ))
    } else {
        // A stream is not placed better than its own interval (KITTI's oxts, at 10 Hz, come out 60 ms late).
        let interval_s = rates.speed_mps.as_ref().and_then(Signal::interval_s);
        let least_s = MOST_S.max(interval_s.unwrap_or(0.0));
        Ok(Estimate { offset, least_s })
    }
}

/// What the vehicle measured of its motion: without a yaw rate the turns of its course, where a receiver shows them. `None` without
/// speeds.
pub(super) fn rates(dataset: &Dataset) -> Option<VehicleRates> {
    let mut rates = VehicleRates::from(dataset.track()?);
    if !dataset.yaw_known() {
        rates.yaw_rate_radps = dataset.receiver().course_rate_radps.clone();
    }
    Some(rates)
}

/// The offset, and with it which way the camera headed: that is taken from the vehicle, whose times are known once the offset
/// is. Taken at another time it adds a part of that time's turn to the picture's, and a tenth to the offset. By how much it
/// still changes in the end is in the standard error.
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
        // A track that ends too early for the offset leaves too few pairs: what was measured before holds.
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

/// How far about a first estimate the better one is looked for, and in what steps, seconds.
const AROUND_S: f64 = 0.06;
/// See [`AROUND_S`].
const STEP_S: f64 = 0.004;
/// Pairs that are left out together for the standard error: half a second of them.
const BLOCK: usize = 5;

/// The offset at which the points agree best with the vehicle's turns about all three axes, where an inertial unit has them. A
/// turn that is measured in the picture first is coupled to the others, and to what near things do; here none is measured.
/// The first estimate where the best one lies at the end of what was looked at.
fn refined(survey: &Survey<'_>, pairs: &[EpipolarPair], first: TimeOffset) -> TimeOffset {
    let Ok(ego) = survey.dataset.ego() else {
        return first;
    };
    let steps = (AROUND_S / STEP_S).round() as i32;
    let offset_s = |step: f64| first.vehicle_minus_camera_s + step * STEP_S;
    // Costs of each pair that has a motion at every offset, by offset.
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

/// Where a parabola through the lowest value and its neighbours is least; `None` at an end.
fn lowest(values: &[f64]) -> Option<f64> {
    let at = (0..values.len()).min_by(|a, b| values[*a].total_cmp(&values[*b]))?;
    let (before, after) = (values.get(at.checked_sub(1)?)?, values.get(at + 1)?);
    let bend = before - 2.0 * values[at] + after;
    Some(at as f64 + 0.5 * (before - after) / bend.max(1e-12))
}

/// How the pictures moved. The turn by the points that were followed is truer than shift, drop and roll of the whole picture,
/// which near things move as well; it is taken where enough pairs have it.
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
