//! Convolutions in bf16 on AMX, the matrix unit of Xeon processors since Sapphire Rapids.
//!
//! A tile register has 16 rows of 64 bytes. Sixteen pixels whose inputs are equally spaced in memory are the rows of one operand without
//! any copying; the weights are packed as the other operand. The instructions have no stable intrinsics, so they are written in assembly.

use std::arch::asm;

use deepfusion_kernels::matrix_unit::{TileSizes, configured};

use super::{Epilogue, OutputPixel};
use crate::Conv;
use crate::aligned::Aligned;
use crate::conv::{ConvForm, Geometry, Runs, Tasks, padded_bias, weight};
use crate::element::{Bf16, Element};
use crate::scratch::with_scratch;
use crate::tile::LANES;
use crate::view::Shared;

/// Rows of a tile: pixels.
const PIXELS: usize = 16;
/// Inputs in a row of a tile.
const INPUTS: usize = 32;
/// Output channels whose sums are computed at once: two tiles of 16.
const GROUP: usize = 32;
/// Elements of a tile.
const TILE: usize = PIXELS * INPUTS;
/// Sums of a tile: pixels × channels.
const TILE_SUMS: usize = PIXELS * LANES;
/// Sums of two strips by two tiles of channels; the index of a tile is `2·strip + channels`.
const SUMS: usize = 4 * TILE_SUMS;
/// Inputs summed before the sums are written to memory, so that the weights of a group stay in the L1 cache.
const INPUTS_AT_ONCE: usize = 512;
/// Strips of a task, so that their inputs and outputs stay in the L2 cache.
const STRIPS_AT_ONCE: usize = 32;

/// A convolution ready to run.
#[derive(Debug)]
pub(crate) struct Amx {
    geometry: Geometry,
    runs: Runs,
    /// For each group of [`GROUP`] output channels and 32 inputs: one or two tiles of 16 pairs of inputs × 16
    /// outputs.
    panels: Aligned<Bf16>,
    bias: Vec<f32>,
    strips: Vec<Strip>,
}

/// Sixteen pixels equally spaced in the input, some of which may be outside the image.
#[derive(Debug)]
struct Strip {
    /// Offset of the first pixel's first tap.
    input: usize,
    /// `None` if it is not a pixel of the output.
    places: [Option<OutputPixel>; PIXELS],
}

impl ConvForm<Bf16> for Amx {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        // With few channels, several taps fill one row of a tile.
        let runs = if channel_of.len() < INPUTS {
            Runs::new(&geometry, channel_of, usize::MAX, INPUTS)
        } else {
            Runs::by_channels(&geometry, channel_of, INPUTS)
        };
        let columns = conv.channels_out.next_multiple_of(LANES);
        let mut panels = Vec::with_capacity(runs.sources.len() * columns);
        for first in (0..columns).step_by(GROUP) {
            for inputs in runs.sources.chunks(INPUTS) {
                for tile in (first..(first + GROUP).min(columns)).step_by(LANES) {
                    for pair in inputs.chunks(2) {
                        for o in tile..tile + LANES {
                            panels.extend(pair.iter().map(|s| Bf16::of(weight(conv, o, *s))));
                        }
                    }
                }
            }
        }
        Self {
            bias: padded_bias(conv, columns),
            strips: strips(&geometry),
            geometry,
            runs,
            panels: Aligned::from_slice(&panels),
        }
    }

    /// Fifteen pixels that complete a strip, at stride 2, and a row of inputs.
    fn overread(pitch: usize) -> usize {
        2 * PIXELS * pitch + INPUTS
    }

    fn name(&self) -> &'static str {
        "amx"
    }

    fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    fn reads_beyond_inputs(&self) -> Option<(&Geometry, &Runs)> {
        let own = (&self.geometry, &self.runs);
        self.runs.read_on().then_some(own)
    }

    /// # Safety
    /// As for the trait; the processor must have the matrix unit.
    unsafe fn run(&self, arena: Shared<Bf16>) {
        let groups = self.bias.len().div_ceil(GROUP);
        Tasks::new(self.strips.len(), STRIPS_AT_ONCE, 2, groups).run(|strips, groups| {
            let strips = &self.strips[strips];
            with_scratch(|scratch| {
                let sums = scratch.first.take(strips.len().div_ceil(2) * SUMS);
                // SAFETY: the processor has the unit and nobody else uses the output (guaranteed by the caller), of which each strip
                // belongs to one task; the tiles are configured first.
                unsafe {
                    configured(TileSizes::WHOLE, || {
                        for group in groups {
                            self.group(arena, group, strips, sums);
                        }
                    });
                }
            });
        });
    }
}

impl Amx {
    /// Computes all of a task's strips, for one group of output channels.
    ///
    /// # Safety
    /// As for [`ConvForm::run`]; the strips must be used by this thread only, and the tiles configured.
    unsafe fn group(
        &self,
        arena: Shared<Bf16>,
        group: usize,
        strips: &[Strip],
        scratch: &mut [f32],
    ) {
        let first = group * GROUP;
        let width = GROUP.min(self.bias.len() - first);
        let panel = &self.panels[first * self.runs.sources.len()..];
        let at_once = (INPUTS_AT_ONCE / self.runs.len).max(1);
        let last = self.runs.offsets.len().div_ceil(at_once) - 1;
        let stride = self.geometry.stride * self.geometry.input.pitch;
        let extent = (PIXELS - 1) * stride + self.runs.extent;
        for (i, runs) in self.runs.offsets.chunks(at_once).enumerate() {
            for (pair, sums) in strips.chunks(2).zip(scratch.chunks_exact_mut(SUMS)) {
                let product = Product {
                    // An odd strip is computed twice and written once.
                    inputs: [&pair[0], pair.last().unwrap_or(&pair[0])]
                        .map(|strip| arena.at(strip.input, extent).cast_const()),
                    stride: stride * size_of::<Bf16>(),
                    runs,
                    len: self.runs.len,
                    panel: &panel[i * at_once * self.runs.len * width..],
                    add: i > 0,
                };
                // SAFETY: sixteen pixels of the runs are in the arena, as `at` has checked; the tiles are configured (guaranteed by the
                // caller).
                unsafe {
                    if width == GROUP {
                        product.two_by_two(sums);
                    } else {
                        product.two_by_one(sums);
                    }
                }
                if i == last {
                    // SAFETY: a processor with the unit has the instructions; the output is used by this thread only.
                    unsafe { self.finish(arena, pair, sums, first, width) };
                }
            }
        }
    }

    /// # Safety
    /// The output must be used by this thread only; the processor must have the instructions.
    #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl,avx512bf16")]
    unsafe fn finish(
        &self,
        arena: Shared<Bf16>,
        strips: &[Strip],
        sums: &[f32],
        first: usize,
        width: usize,
    ) {
        let finish = Epilogue::new(&self.geometry, &self.bias, arena);
        for (i, strip) in strips.iter().enumerate() {
            let tiles = &sums[2 * i * TILE_SUMS..];
            if self.geometry.out.result {
                // SAFETY: the strip's pixels are used by this thread only (guaranteed by the caller).
                unsafe { finish.results(&strip.places, |p| tiles[p * LANES]) };
                continue;
            }
            for (c, tile) in (first..first + width)
                .step_by(LANES)
                .zip(tiles.chunks_exact(TILE_SUMS))
            {
                for (place, sums) in strip.places.iter().zip(tile.as_chunks::<LANES>().0) {
                    if let Some(place) = *place {
                        // SAFETY: sixteen sums; the rest as above.
                        unsafe { finish.channels(place, c, sums.as_ptr()) };
                    }
                }
            }
        }
    }
}

/// The strips of all output pixels.
fn strips(g: &Geometry) -> Vec<Strip> {
    let corner = g.corner();
    let place = |x: usize, y: usize| {
        let inside = x < g.out.width && y < g.out.height;
        inside.then(|| OutputPixel::new(g, x, y))
    };
    // The step from a row's last pixel to the next row's first spans the border between them, so strips can continue across it. With a wide
    // border that makes more strips than handling each row separately.
    let across = g.input.row / g.input.pitch;
    let last = (g.out.height - 1) * across + g.out.width;
    let by_rows = g.out.height * g.out.width.div_ceil(PIXELS);
    if g.stride == 1 && last.div_ceil(PIXELS) <= by_rows {
        let strip = |start: usize| Strip {
            input: corner + start * g.input.pitch,
            places: std::array::from_fn(|i| place((start + i) % across, (start + i) / across)),
        };
        return (0..last).step_by(PIXELS).map(strip).collect();
    }
    let rows =
        (0..g.out.height).flat_map(|y| (0..g.out.width).step_by(PIXELS).map(move |x| (x, y)));
    rows.map(|(x, y)| Strip {
        input: corner + g.stride * (y * g.input.row + x * g.input.pitch),
        places: std::array::from_fn(|i| place(x + i, y)),
    })
    .collect()
}

/// Two strips' inputs times one group's weights.
struct Product<'a> {
    inputs: [*const Bf16; 2],
    /// Bytes from a pixel of a strip to the next.
    stride: usize,
    runs: &'a [usize],
    len: usize,
    /// One or two tiles for each [`INPUTS`] of each run.
    panel: &'a [Bf16],
    /// Whether to add to the existing sums.
    add: bool,
}

impl Product<'_> {
    /// Checks that the panel is as long as the runs, with this number of tiles of channels, and that there is room for all sums. Returns
    /// the number of tiles of inputs in a run.
    fn checked(&self, tiles: usize, sums: &[f32]) -> usize {
        let rows = self.len / INPUTS;
        assert!(rows > 0 && rows * INPUTS == self.len && !self.runs.is_empty());
        assert!(self.panel.len() >= self.runs.len() * rows * tiles * TILE);
        assert!(sums.len() >= SUMS);
        rows
    }

    /// Two tiles of channels. A single assembly block from the first load to the last store, as the compiler does not know that the
    /// registers contain the sums.
    ///
    /// # Safety
    /// The runs of sixteen pixels must be readable, the tiles configured.
    #[inline(always)]
    unsafe fn two_by_two(&self, sums: &mut [f32]) {
        let rows = self.checked(2, sums);
        // SAFETY: sums and panel are long enough, as was just checked; the runs are readable (guaranteed by the caller). The written
        // registers are declared.
        unsafe {
            asm!(
                "test {left}, {left}",
                "jz 2f",
                "tileloadd tmm0, [{c} + {s}*1]",
                "tileloadd tmm1, [{c} + {s}*1 + 1024]",
                "tileloadd tmm2, [{c} + {s}*1 + 2048]",
                "tileloadd tmm3, [{c} + {s}*1 + 3072]",
                "jmp 3f",
                "2:",
                "tilezero tmm0",
                "tilezero tmm1",
                "tilezero tmm2",
                "tilezero tmm3",
                // For each run:
                "3:",
                "mov {p0}, [{run}]",
                "lea {p1}, [{a1} + {p0}*2]",
                "lea {p0}, [{a0} + {p0}*2]",
                "add {run}, 8",
                "mov {left}, {rows}",
                // For each thirty-two inputs of it:
                "4:",
                "tileloadd tmm6, [{b} + {s}*1]",
                "tileloadd tmm4, [{p0} + {sa}*1]",
                "tileloadd tmm5, [{p1} + {sa}*1]",
                "tileloadd tmm7, [{b} + {s}*1 + 1024]",
                "add {p0}, 64",
                "add {p1}, 64",
                "add {b}, 2048",
                "tdpbf16ps tmm0, tmm4, tmm6",
                "tdpbf16ps tmm2, tmm5, tmm6",
                "tdpbf16ps tmm1, tmm4, tmm7",
                "tdpbf16ps tmm3, tmm5, tmm7",
                "dec {left}",
                "jnz 4b",
                "cmp {run}, {end}",
                "jne 3b",
                "tilestored [{c} + {s}*1], tmm0",
                "tilestored [{c} + {s}*1 + 1024], tmm1",
                "tilestored [{c} + {s}*1 + 2048], tmm2",
                "tilestored [{c} + {s}*1 + 3072], tmm3",
                c = in(reg) sums.as_mut_ptr(),
                s = in(reg) 64_usize,
                a0 = in(reg) self.inputs[0],
                a1 = in(reg) self.inputs[1],
                sa = in(reg) self.stride,
                rows = in(reg) rows,
                end = in(reg) self.runs.as_ptr_range().end,
                run = inout(reg) self.runs.as_ptr() => _,
                b = inout(reg) self.panel.as_ptr() => _,
                left = inout(reg) usize::from(self.add) => _,
                p0 = out(reg) _,
                p1 = out(reg) _,
                out("tmm0") _, out("tmm1") _, out("tmm2") _, out("tmm3") _,
                out("tmm4") _, out("tmm5") _, out("tmm6") _, out("tmm7") _,
                options(nostack),
            );
        }
    }

    /// One tile of channels.
    ///
    /// # Safety
    /// As for [`Self::two_by_two`].
    #[inline(always)]
    unsafe fn two_by_one(&self, sums: &mut [f32]) {
        let rows = self.checked(1, sums);
        // SAFETY: as in [`Self::two_by_two`].
        unsafe {
            asm!(
                "test {left}, {left}",
                "jz 2f",
                "tileloadd tmm0, [{c} + {s}*1]",
                "tileloadd tmm2, [{c} + {s}*1 + 2048]",
                "jmp 3f",
                "2:",
                "tilezero tmm0",
                "tilezero tmm2",
                "3:",
                "mov {p0}, [{run}]",
                "lea {p1}, [{a1} + {p0}*2]",
                "lea {p0}, [{a0} + {p0}*2]",
                "add {run}, 8",
                "mov {left}, {rows}",
                "4:",
                "tileloadd tmm6, [{b} + {s}*1]",
                "tileloadd tmm4, [{p0} + {sa}*1]",
                "tileloadd tmm5, [{p1} + {sa}*1]",
                "add {p0}, 64",
                "add {p1}, 64",
                "add {b}, 1024",
                "tdpbf16ps tmm0, tmm4, tmm6",
                "tdpbf16ps tmm2, tmm5, tmm6",
                "dec {left}",
                "jnz 4b",
                "cmp {run}, {end}",
                "jne 3b",
                "tilestored [{c} + {s}*1], tmm0",
                "tilestored [{c} + {s}*1 + 2048], tmm2",
                c = in(reg) sums.as_mut_ptr(),
                s = in(reg) 64_usize,
                a0 = in(reg) self.inputs[0],
                a1 = in(reg) self.inputs[1],
                sa = in(reg) self.stride,
                rows = in(reg) rows,
                end = in(reg) self.runs.as_ptr_range().end,
                run = inout(reg) self.runs.as_ptr() => _,
                b = inout(reg) self.panel.as_ptr() => _,
                left = inout(reg) usize::from(self.add) => _,
                p0 = out(reg) _,
                p1 = out(reg) _,
                out("tmm0") _, out("tmm2") _, out("tmm4") _, out("tmm5") _, out("tmm6") _,
                options(nostack),
            );
        }
    }
}
