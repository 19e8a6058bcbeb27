//! Which form a convolution takes.

use crate::Conv;
use crate::conv::Geometry;
use crate::direct::Direct;
use crate::element::Bf16;
use crate::head::Head;
use crate::view::Shared;
use crate::winograd::Winograd;

/// A convolution ready to run on values stored as `E`.
pub(crate) trait ConvForm<E> {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self;

    /// What profiles call it.
    fn name(&self) -> &'static str;

    /// # Safety
    /// `arena` must hold every view of the geometry, its border included, and nobody else may use the
    /// output meanwhile.
    unsafe fn run(&self, arena: Shared<E>);
}

/// In f32.
#[derive(Debug)]
pub(crate) enum F32Conv {
    Direct(Direct),
    Winograd(Winograd),
    Head(Head),
}

impl ConvForm<f32> for F32Conv {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        if geometry.out.result {
            Self::Head(Head::new(conv, geometry, channel_of))
        } else if Winograd::fits(conv, &geometry, channel_of) {
            Self::Winograd(Winograd::new(conv, geometry, channel_of))
        } else {
            Self::Direct(Direct::new(conv, geometry, channel_of))
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Direct(_) => "direct",
            Self::Winograd(_) => "winograd",
            Self::Head(_) => "head",
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

/// In bf16.
#[cfg(target_arch = "x86_64")]
#[derive(Debug)]
pub(crate) enum Bf16Conv {
    Amx(crate::bf16::Amx),
    Dot(crate::bf16::Dot),
}

#[cfg(target_arch = "x86_64")]
impl Bf16Conv {
    pub(crate) fn available() -> bool {
        crate::bf16::has_dot()
    }
}

#[cfg(target_arch = "x86_64")]
impl ConvForm<Bf16> for Bf16Conv {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        if crate::bf16::has_amx() {
            Self::Amx(crate::bf16::Amx::new(conv, geometry, channel_of))
        } else {
            Self::Dot(crate::bf16::Dot::new(conv, geometry, channel_of))
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Amx(conv) => conv.name(),
            Self::Dot(conv) => conv.name(),
        }
    }

    unsafe fn run(&self, arena: Shared<Bf16>) {
        // SAFETY: the caller's promise; `new` is only called where `available` holds.
        unsafe {
            match self {
                Self::Amx(conv) => conv.run(arena),
                Self::Dot(conv) => conv.run(arena),
            }
        }
    }
}

/// Other processors' forms are not written yet.
#[cfg(not(target_arch = "x86_64"))]
#[derive(Debug)]
pub(crate) enum Bf16Conv {}

#[cfg(not(target_arch = "x86_64"))]
impl Bf16Conv {
    pub(crate) fn available() -> bool {
        false
    }
}

#[cfg(not(target_arch = "x86_64"))]
impl ConvForm<Bf16> for Bf16Conv {
    fn new(_: &Conv, _: Geometry, _: &[Option<usize>]) -> Self {
        unreachable!("the engine asks `available` first")
    }

    fn name(&self) -> &'static str {
        match *self {}
    }

    unsafe fn run(&self, _: Shared<Bf16>) {
        match *self {}
    }
}
