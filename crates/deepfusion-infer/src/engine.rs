//! The engine: a graph laid out and packed for one image size, run again and again without allocating
//! buffers.

use std::time::{Duration, Instant};

use crate::conv::Geometry;
use crate::direct::Direct;
use crate::head::Head;
use crate::movement::{self, ByteTable};
use crate::plan::{Plan, Step};
use crate::view::Shared;
use crate::winograd::Winograd;
use crate::{Border, Conv, Error, Graph};

/// A network that runs.
#[derive(Debug)]
pub struct Engine {
    plan: Plan<F32Conv>,
    arena: Vec<f32>,
    bytes: ByteTable,
    size: (usize, usize),
}

/// The forms of a convolution in f32.
#[derive(Debug)]
enum F32Conv {
    Direct(Direct),
    Winograd(Winograd),
    Head(Head),
}

impl F32Conv {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        if conv.channels_out == 1 && geometry.out.pitch == 1 {
            Self::Head(Head::new(conv, geometry, channel_of))
        } else if Winograd::fits(conv, &geometry) {
            Self::Winograd(Winograd::new(conv, geometry, channel_of))
        } else {
            Self::Direct(Direct::new(conv, geometry, channel_of))
        }
    }

    unsafe fn run(&self, arena: Shared<f32>) {
        // SAFETY: the caller's promise.
        unsafe {
            match self {
                Self::Direct(conv) => conv.run(arena),
                Self::Winograd(conv) => conv.run(arena),
                Self::Head(conv) => conv.run(arena),
            }
        }
    }
}

impl Engine {
    /// Packs the graph for images of this size.
    ///
    /// # Errors
    /// [`Error::Size`] where the graph cannot work on such images.
    pub fn new(graph: Graph, width: usize, height: usize) -> Result<Self, Error> {
        graph.check_size(width, height)?;
        let bytes = ByteTable::new(graph.mean(), graph.std());
        let plan = Plan::new(graph, width, height, |conv, geometry, channel_of| {
            F32Conv::new(&conv, geometry, channel_of)
        });
        Ok(Self {
            arena: vec![0.0; plan.arena],
            plan,
            bytes,
            size: (width, height),
        })
    }

    /// Width and height of the images, in pixels.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Runs the network on an image; afterwards [`Self::output`] gives the results.
    ///
    /// # Shapes
    /// - `rgb`: height × width × 3, row by row, red, green, blue
    ///
    /// # Panics
    /// When the image has another size.
    pub fn run(&mut self, rgb: &[u8]) {
        self.run_steps(rgb, |_, _| {});
    }

    /// The same; gives each step's name (its node's, and what it does) and time.
    ///
    /// # Panics
    /// As [`Self::run`].
    pub fn profile(&mut self, rgb: &[u8]) -> Vec<(String, Duration)> {
        let mut times = Vec::new();
        let mut start = Instant::now();
        self.run_steps(rgb, |name, kind| {
            times.push((format!("{name} {kind}"), start.elapsed()));
            start = Instant::now();
        });
        times
    }

    fn run_steps(&mut self, rgb: &[u8], mut after: impl FnMut(&str, &str)) {
        let (width, height) = self.size;
        assert_eq!(
            rgb.len(),
            3 * width * height,
            "an image of {width}x{height}"
        );
        let arena = Shared(self.arena.as_mut_ptr());
        for (name, step) in &self.plan.steps {
            // SAFETY: the plan's views lie in the arena; steps run one after the other, and the output of
            // each lies apart from what it reads.
            unsafe {
                match step {
                    Step::Image(to) => self.bytes.run(rgb, arena, to),
                    Step::Border { view, reach, kind } => match kind {
                        Border::Zero => movement::zero_border(arena, view, *reach),
                        Border::Reflect => movement::reflect_border(arena, view, *reach),
                    },
                    Step::Conv(conv) => conv.run(arena),
                    Step::MaxPool(from, to) => movement::max_pool(arena, from, to),
                    Step::Upsample(from, to) => movement::upsample(arena, from, to),
                    Step::Copy(from, to) => movement::copy(arena, from, to),
                }
            }
            after(name, kind(step));
        }
    }

    /// The values of an output after the last run: channel by channel, row by row.
    ///
    /// # Panics
    /// When the graph has no such output.
    #[must_use]
    pub fn output(&self, index: usize) -> Vec<f32> {
        let (view, places) = &self.plan.outputs[index];
        let mut out = Vec::with_capacity(places.len() * view.pixels());
        for c in places {
            for y in 0..view.height {
                out.extend((0..view.width).map(|x| self.arena[view.at(x, y) + c]));
            }
        }
        out
    }
}

fn kind(step: &Step<F32Conv>) -> &'static str {
    match step {
        Step::Image(_) => "image",
        Step::Border { .. } => "border",
        Step::Conv(F32Conv::Direct(_)) => "direct",
        Step::Conv(F32Conv::Winograd(_)) => "winograd",
        Step::Conv(F32Conv::Head(_)) => "head",
        Step::MaxPool(..) => "maximum",
        Step::Upsample(..) => "upsample",
        Step::Copy(..) => "copy",
    }
}
