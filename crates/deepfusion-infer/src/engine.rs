//! The engine: a graph laid out and packed for one image size, which runs any number of times without allocating buffers.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::aligned::Aligned;
use crate::conv::ConvForm;
use crate::element::{Bf16, Element};
use crate::forms::{Bf16Conv, F32Conv, Int8Conv};
use crate::movement::{self, Normalisation};
use crate::plan::{Plan, Step};
use crate::ranges::SeenInputs;
use crate::view::Shared;
use crate::{Border, Error, Graph};
use crate::{channel_norm, enlarge, masks, means, recurrent};

/// The precision of the network's arithmetic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// 32-bit floats throughout.
    #[default]
    F32,
    /// Weights and the values between operations in bf16 (8 bits of mantissa), sums in f32.
    Bf16,
    /// Convolutions of 8-bit integers, weights and inputs, if the graph has their input ranges ([`Graph::set_input_ranges`]); everything
    /// else as in bf16.
    Int8,
}

impl Precision {
    /// Its name, on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::Bf16 => "bf16",
            Self::Int8 => "int8",
        }
    }
}

/// An executable network: a plan with packed weights, shared with [`Engine::another`], and buffers of its own.
#[derive(Debug)]
pub struct Engine {
    runner: Runner,
    size: (usize, usize),
}

#[derive(Debug)]
enum Runner {
    F32(Typed<f32, F32Conv>),
    Bf16(Typed<Bf16, Bf16Conv>),
    Int8(Typed<Bf16, Int8Conv>),
}

/// A network laid out and packed for images of one size, without buffers. Any number of engines can use it, on any threads.
#[derive(Debug, Clone)]
pub struct EnginePlan {
    packed: PackedFor,
    size: (usize, usize),
}

#[derive(Debug, Clone)]
enum PackedFor {
    F32(Arc<Packed<F32Conv>>),
    Bf16(Arc<Packed<Bf16Conv>>),
    Int8(Arc<Packed<Int8Conv>>),
}

impl EnginePlan {
    /// An engine with this network, and buffers of its own.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is no memory for them.
    pub fn engine(&self) -> Result<Engine, Error> {
        let size @ (width, height) = self.size;
        let full = || Error::Memory { width, height };
        let runner = match &self.packed {
            PackedFor::F32(packed) => Runner::F32(Typed::on(packed).ok_or_else(full)?),
            PackedFor::Bf16(packed) => Runner::Bf16(Typed::on(packed).ok_or_else(full)?),
            PackedFor::Int8(packed) => Runner::Int8(Typed::on(packed).ok_or_else(full)?),
        };
        Ok(Engine { runner, size })
    }
}

impl Engine {
    /// Packs the graph for images of this size.
    ///
    /// # Errors
    /// [`Error::Size`] if the graph cannot run on such images, [`Error::Graph`] if a residual or a mask's operand is a concatenation or the
    /// image, [`Error::Memory`] if there is not enough memory, [`Error::NoBf16`] or [`Error::NoInt8`] if the processor lacks the
    /// instructions, [`Error::Ranges`] for int8 without ranges.
    pub fn new(
        graph: Graph,
        width: usize,
        height: usize,
        precision: Precision,
    ) -> Result<Self, Error> {
        graph.check_size(width, height)?;
        graph.check_operands()?;
        let runner = match precision {
            Precision::F32 => Runner::F32(Typed::new(graph, width, height)?),
            Precision::Bf16 if !Self::has_bf16() => return Err(Error::NoBf16),
            Precision::Bf16 => Runner::Bf16(Typed::new(graph, width, height)?),
            Precision::Int8 if !Self::has_int8() => return Err(Error::NoInt8),
            Precision::Int8 => {
                graph.check_input_ranges()?;
                Runner::Int8(Typed::new(graph, width, height)?)
            }
        };
        Ok(Self {
            runner,
            size: (width, height),
        })
    }

    /// Whether this processor can compute in bf16.
    #[must_use]
    pub fn has_bf16() -> bool {
        Bf16Conv::available()
    }

    /// Whether this processor can compute in int8.
    #[must_use]
    pub fn has_int8() -> bool {
        Int8Conv::available()
    }

    /// A second engine on the same packed weights, with its own buffers: one for each thread.
    ///
    /// # Errors
    /// [`Error::Memory`] if there is no memory for them.
    pub fn another(&self) -> Result<Self, Error> {
        self.plan().engine()
    }

    /// The packed weights, without buffers, which engines can share.
    #[must_use]
    pub fn plan(&self) -> EnginePlan {
        let packed = match &self.runner {
            Runner::F32(runner) => PackedFor::F32(Arc::clone(&runner.packed)),
            Runner::Bf16(runner) => PackedFor::Bf16(Arc::clone(&runner.packed)),
            Runner::Int8(runner) => PackedFor::Int8(Arc::clone(&runner.packed)),
        };
        EnginePlan {
            packed,
            size: self.size,
        }
    }

    /// Width and height of the images, in pixels.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Runs the network on an image; [`Self::output`] then returns the results.
    ///
    /// # Shapes
    /// - `image`: 3 × height × width, RGB in [0, 1]
    ///
    /// # Panics
    /// If the image has another size.
    pub fn run(&mut self, image: &[f32]) {
        self.run_steps(image, |_, _| {});
    }

    /// Like [`Self::run`]; returns each step's name (its node and its kind) and duration.
    ///
    /// # Panics
    /// As for [`Self::run`].
    pub fn profile(&mut self, image: &[f32]) -> Vec<(String, Duration)> {
        let mut times = Vec::new();
        let mut start = Instant::now();
        self.run_steps(image, |name, kind| {
            times.push((format!("{name} {kind}"), start.elapsed()));
            start = Instant::now();
        });
        times
    }

    /// Like [`Self::run`], and adds the values that each convolution reads to `seen`.
    ///
    /// # Panics
    /// As for [`Self::run`].
    pub fn observe(&mut self, image: &[f32], seen: &mut SeenInputs) {
        self.check(image);
        rayon::scope(|_| match &mut self.runner {
            Runner::F32(runner) => runner.observe(image, seen),
            Runner::Bf16(runner) => runner.observe(image, seen),
            Runner::Int8(runner) => runner.observe(image, seen),
        });
        seen.images += 1;
    }

    fn check(&self, image: &[f32]) {
        let (width, height) = self.size;
        assert_eq!(
            image.len(),
            3 * width * height,
            "an image of {width}x{height}"
        );
    }

    fn run_steps(&mut self, image: &[f32], after: impl FnMut(&str, &str) + Send) {
        self.check(image);
        // On one of rayon's threads: from outside, each step would be handed over to them.
        rayon::scope(|_| match &mut self.runner {
            Runner::F32(runner) => runner.run(image, after),
            Runner::Bf16(runner) => runner.run(image, after),
            Runner::Int8(runner) => runner.run(image, after),
        });
    }

    /// The values of an output after the last run: channel by channel, row by row.
    ///
    /// # Panics
    /// If the graph has no such output.
    #[must_use]
    pub fn output(&self, index: usize) -> Vec<f32> {
        let mut values = Vec::new();
        self.read_output(index, &mut values);
        values
    }

    /// Like [`Self::output`], but written into `values`.
    ///
    /// # Panics
    /// As for [`Self::output`].
    pub fn read_output(&self, index: usize, values: &mut Vec<f32>) {
        match &self.runner {
            Runner::F32(runner) => runner.read_output(index, values),
            Runner::Bf16(runner) => runner.read_output(index, values),
            Runner::Int8(runner) => runner.read_output(index, values),
        }
    }
}

/// The part of an engine that is shared.
#[derive(Debug)]
pub(crate) struct Packed<C> {
    plan: Plan<C>,
    /// Number of elements in each engine's arena.
    arena: usize,
    normalisation: Normalisation,
}

/// An engine whose values are stored as `E`.
#[derive(Debug)]
pub(crate) struct Typed<E, C> {
    packed: Arc<Packed<C>>,
    arena: Aligned<E>,
}

impl<E: Element, C: ConvForm<E>> Typed<E, C> {
    pub(crate) fn new(graph: Graph, width: usize, height: usize) -> Result<Self, Error> {
        let normalisation = Normalisation {
            mean: graph.mean(),
            std: graph.std(),
        };
        let (plan, arena) = Plan::new(graph, width, height)?;
        let packed = Arc::new(Packed {
            plan,
            arena: arena.len(),
            normalisation,
        });
        Ok(Self { packed, arena })
    }

    /// An engine with a shared plan; `None` if there is no memory for another arena.
    fn on(packed: &Arc<Packed<C>>) -> Option<Self> {
        Some(Self {
            packed: Arc::clone(packed),
            arena: Aligned::try_zeros(packed.arena)?,
        })
    }

    pub(crate) fn run(&mut self, image: &[f32], after: impl FnMut(&str, &str)) {
        self.run_watched(image, |_, _, _| {}, after);
    }

    fn observe(&mut self, image: &[f32], seen: &mut SeenInputs) {
        self.run_watched(
            image,
            |name, step, arena| {
                if let Step::Conv(conv) = step {
                    // SAFETY: between two steps nobody writes.
                    unsafe { seen.of(name).add(arena, &conv.geometry().input) };
                }
            },
            |_, _| {},
        );
    }

    /// `before` is called before each step, with the step and the arena.
    fn run_watched(
        &mut self,
        image: &[f32],
        mut before: impl FnMut(&str, &Step<C>, Shared<E>),
        mut after: impl FnMut(&str, &str),
    ) {
        // An image may overflow and leave NaN in the arena, which must not affect the next one.
        for places in &self.packed.plan.stale {
            self.arena[places.clone()].fill(E::default());
        }
        let arena = Shared::new(&mut self.arena);
        for (name, step) in &self.packed.plan.steps {
            before(name, step, arena);
            // SAFETY: the plan's views are in the arena, which is borrowed here only; steps run one after the other, and the output of each
            // is separate from its inputs.
            unsafe {
                match step {
                    Step::Image(to) => self.packed.normalisation.run(image, arena, to),
                    Step::Border { view, reach, kind } => match kind {
                        Border::Zero => movement::zero_border(arena, view, *reach),
                        Border::Reflect => movement::reflect_border(arena, view, *reach),
                    },
                    Step::Conv(conv) => conv.run(arena),
                    Step::MaxPool(from, to) => movement::max_pool(arena, from, to),
                    Step::Upsample(from, to) => movement::upsample(arena, from, to),
                    Step::Copy(from, to) => movement::copy(arena, from, to),
                    Step::GlobalMean(from, to) => means::global_mean(arena, from, to),
                    Step::ChannelExtent(from, channels, to) => {
                        means::channel_extent(arena, from, channels, to);
                    }
                    Step::Gate(gate) => gate.run(arena),
                    Step::AddPixel(from, pixel, to) => masks::add_pixel(arena, from, pixel, to),
                    Step::Depthwise(step) => step.run(arena),
                    Step::Enlarge(from, to) => enlarge::enlarge(arena, from, to),
                    Step::ChannelNorm {
                        from,
                        channels,
                        epsilon,
                        to,
                    } => channel_norm::channel_norm(arena, from, channels, *epsilon, to),
                    Step::CrossCovariance(step) => step.run(arena),
                    Step::Constants(values, to) => enlarge::constants(arena, values, to),
                    Step::Multiply([a, b], to) => recurrent::multiply(arena, [a, b], to),
                    Step::Blend([h, q, z], to) => recurrent::blend(arena, [h, q, z], to),
                    Step::ConvexUpsample(step) => step.run(arena),
                    Step::DepthToSpace(from, to) => movement::depth_to_space(arena, from, to),
                }
            }
            let kind = match step {
                Step::Image(_) => "image",
                Step::Border { .. } => "border",
                Step::Conv(conv) => conv.name(),
                Step::MaxPool(..) => "maximum",
                Step::Upsample(..) => "upsample",
                Step::Copy(..) => "copy",
                Step::GlobalMean(..) => "mean",
                Step::ChannelExtent(..) => "extent",
                Step::Gate(_) => "gate",
                Step::AddPixel(..) => "add",
                Step::Depthwise(_) => "depthwise",
                Step::Enlarge(..) => "enlarge",
                Step::ChannelNorm { .. } => "norm",
                Step::CrossCovariance(_) => "attention",
                Step::Constants(..) => "constants",
                Step::Multiply(..) => "multiply",
                Step::Blend(..) => "blend",
                Step::ConvexUpsample(_) => "convex",
                Step::DepthToSpace(..) => "pixels",
            };
            after(name, kind);
        }
    }

    pub(crate) fn read_output(&self, index: usize, out: &mut Vec<f32>) {
        let (view, places) = &self.packed.plan.outputs[index];
        out.clear();
        out.reserve(places.len() * view.pixels());
        let value = |at: usize| {
            if view.result {
                let slots = &self.arena[at..at + size_of::<f32>() / size_of::<E>()];
                // SAFETY: the slice is as large as an f32, of which any bits are valid, and the pointer need not be aligned.
                unsafe { slots.as_ptr().cast::<f32>().read_unaligned() }
            } else {
                self.arena[at].value()
            }
        };
        for c in places {
            for y in 0..view.height {
                out.extend((0..view.width).map(|x| value(view.at(x, y) + c)));
            }
        }
    }
}

#[cfg(test)]
impl<E: Element, C: ConvForm<E>> Typed<E, C> {
    pub(crate) fn output(&self, index: usize) -> Vec<f32> {
        let mut values = Vec::new();
        self.read_output(index, &mut values);
        values
    }

    /// Fills the arena with NaN, as the worst of images might.
    pub(crate) fn poison(&mut self) {
        self.arena.fill(E::of(f32::NAN));
    }
}
