//! Elements that kernels read before they are written for the current image.
//!
//! If a convolution's inputs do not fill a whole run, a bf16 kernel reads beyond them and multiplies by zero. Those elements may still
//! contain values of the previous image, and zero times NaN is NaN: an image that overflowed would affect the next one. So exactly these
//! elements are cleared before each image.

use std::ops::Range;

use crate::conv::{ConvForm, Geometry, Runs};
use crate::element::Element;
use crate::movement::for_border;
use crate::plan::Step;
use crate::view::View;

/// The ranges of an arena that the steps read before they write them.
pub(crate) fn stale<E: Element, C: ConvForm<E>>(
    steps: &[(String, Step<C>)],
    arena: usize,
) -> Vec<Range<usize>> {
    let reads_beyond_inputs =
        |step: &Step<C>| matches!(step, Step::Conv(conv) if conv.reads_beyond_inputs().is_some());
    if !steps.iter().any(|(_, step)| reads_beyond_inputs(step)) {
        return Vec::new();
    }
    let mut first_uses = vec![FirstUse::Untouched; arena];
    for (_, step) in steps {
        if let Step::Conv(conv) = step
            && let Some((geometry, runs)) = conv.reads_beyond_inputs()
        {
            idle(geometry, runs, |at| {
                if first_uses[at] == FirstUse::Untouched {
                    first_uses[at] = FirstUse::Stale;
                }
            });
        }
        written(step, |at, count| {
            for first_use in &mut first_uses[at..at + count] {
                if *first_use == FirstUse::Untouched {
                    *first_use = FirstUse::Written;
                }
            }
        });
    }
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for (at, _) in first_uses
        .iter()
        .enumerate()
        .filter(|p| *p.1 == FirstUse::Stale)
    {
        match ranges.last_mut() {
            Some(range) if range.end == at => range.end += 1,
            _ => ranges.push(at..at + 1),
        }
    }
    ranges
}

/// The first access to an element.
#[derive(Clone, Copy, PartialEq)]
enum FirstUse {
    Untouched,
    Written,
    Stale,
}

/// Calls `read` for every element that a convolution multiplies by zero because it is none of its inputs.
fn idle(g: &Geometry, runs: &Runs, mut read: impl FnMut(usize)) {
    let inputs = runs.offsets.iter().zip(runs.sources.chunks(runs.len));
    let taps: Vec<usize> = inputs
        .flat_map(|(run, sources)| {
            let idle = sources.iter().enumerate().filter(|(_, s)| s.is_none());
            idle.map(move |(k, _)| run + k)
        })
        .collect();
    for y in 0..g.out.height {
        for x in 0..g.out.width {
            let pixel = g.first_tap(x, y);
            taps.iter().for_each(|tap| read(pixel + tap));
        }
    }
}

/// Calls `write` with the offset and count of all elements that a step writes.
fn written<E: Element, C: ConvForm<E>>(step: &Step<C>, mut write: impl FnMut(usize, usize)) {
    let mut all = |view: &View, channels: usize| {
        for y in 0..view.height {
            (0..view.width).for_each(|x| write(view.at(x, y), channels));
        }
    };
    match step {
        Step::Image(to) => all(to, 3),
        Step::Border { view, reach, .. } => {
            for_border(view, *reach, |at, _| write(at, view.channels));
        }
        Step::Conv(conv) => all(&conv.geometry().out, conv.geometry().out.channels),
        Step::MaxPool(_, to) | Step::GlobalMean(_, to) | Step::AddPixel(_, _, to) => {
            all(to, to.channels);
        }
        Step::Upsample(from, to) | Step::Copy(from, to) => all(to, from.channels),
        Step::ChannelExtent(_, _, to) => all(to, 2),
        Step::Depthwise(step) => all(&step.out, step.out.channels),
        Step::CrossCovariance(step) => all(&step.out, step.out.channels),
        Step::Enlarge(_, to) | Step::ChannelNorm { to, .. } | Step::Constants(_, to) => {
            all(to, to.channels);
        }
        Step::Gate(gate) => all(&gate.out, gate.out.channels),
        Step::Multiply(_, to) | Step::Blend(_, to) => all(to, to.channels),
        Step::ConvexUpsample(step) => all(&step.out, step.out.channels),
        Step::DepthToSpace(_, to) => all(to, to.channels),
    }
}
